"""``screwkin stiffness``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any

import numpy as np
import typer

from screwkin.analysis.map_arrays import deflection_arrays
from screwkin.analysis.stiffness_maps import DeflectionMap, stiffness_maps
from screwkin.cli.loads import LOAD_HELP
from screwkin.cli.maps import Heights, LimbName, MapResult, Pictures, Resolution, reached_maps, run_maps
from screwkin.cli.options import AsJson, OutputFolder, RobotName
from screwkin.cli.output import progress_bar
from screwkin.cli.stiffness_at import stiffness_at
from screwkin.compliance.springs import joint_stiffness
from screwkin.compliance.stiffness import Method
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot


def stiffness(
    robot: RobotName,
    limb: LimbName = None,
    heights: Heights = None,
    resolution: Resolution = 0.0025,
    k: Annotated[
        float | None,
        typer.Option("-k", "--stiffness", help="Of every joint [N m/rad]; default: the table's."),
    ] = None,
    nonlinear: Annotated[
        bool, typer.Option("--nonlinear", help="The equilibrium of springs and weight, not its first order.")
    ] = False,
    support: Annotated[
        list[str] | None,
        typer.Option(help="The tip that stands still; default: the other leg's. Two: see --at."),
    ] = None,
    posture: Annotated[
        str | None, typer.Option(help="Of all other joints, by name; default: all zero.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="POSTURE",
            help="In this posture instead of maps: how joints and links yield to weight and loads, and how "
            "stiff a frame is. So too, at home, with --load, --frame or several --support.",
        ),
    ] = None,
    load: Annotated[list[str] | None, typer.Option(metavar="NAME=VALUES", help=LOAD_HELP)] = None,
    frame: Annotated[
        str | None, typer.Option(help="The frame whose stiffness is shown; default: the base, else a tip.")
    ] = None,
    plots: Pictures = True,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Deflection of a swinging foot under the robot's weight, all over its workspace, in single support.

    Files: stiffness.npz and pictures, one of all heights and one for each. For maps at unit stiffness
    use --stiffness 1. In one posture nothing is written. Exit code 3 where a robot collapses under its loads.
    """
    table = load_robot(robot)
    if at or load or frame or len(support or ()) > 1:
        of_maps = {
            "--limb": limb, "--heights": heights, "--posture": posture, "--nonlinear": nonlinear,
            "--no-plots": not plots, "--output": output,
        }  # fmt: skip
        given = [name for name, value in of_maps.items() if value not in (None, False)]
        if given:
            raise InputError(f"{', '.join(given)}: of maps, not of one posture (--at, --load); leave it out")
        return stiffness_at(table, at, support, k, load or [], frame, as_json)
    joint_stiffness(table, k)  # refused before the workspace is computed
    method: Method = "nonlinear" if nonlinear else "linear"

    def compute() -> MapResult:
        places = reached_maps(table, limb, heights, resolution)
        with progress_bar("deflections") as done:
            maps = stiffness_maps(table, places, k, method, support[0] if support else None, posture, done)
        title = f"{table.name} on its {maps[0].support}: deflection of the {places[0].tip} ({method})"
        data = stiffness_data(table, maps)
        return MapResult(deflection_arrays(maps), data, title, _rows(maps), _pictures(table, maps))

    return run_maps("stiffness", table, compute, plots, output, as_json)


def stiffness_data(robot: Robot, maps: Sequence[DeflectionMap]) -> dict[str, Any]:
    """Areas [cm^2], median and largest deflections [mm] as JSON data; at unit stiffness if all are alike."""
    rows = [{"height": one.place.height, "area_cm2": 1e4 * one.place.area, **one.summary()} for one in maps]
    return {
        "robot": robot.name,
        "limb": maps[0].place.limb,
        "support": maps[0].support,
        "method": maps[0].method,
        "stiffness": dict(zip(robot.joint_names, maps[0].stiffness.tolist(), strict=True)),
        "resolution": maps[0].place.resolution,
        "heights": [row["height"] for row in rows],
        "areas": [row["area_cm2"] for row in rows],
        "medians": [row["median_mm"] for row in rows],
        "deflections": [row["max_mm"] for row in rows],
        "rows": rows,
    }


def _rows(maps: Sequence[DeflectionMap]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("height", "area", "median", "largest", "x", "y", "z")]
    for one in maps:
        numbers = one.summary()
        rows.append(
            (
                f"{1e3 * one.place.height:g} mm",
                f"{1e4 * one.place.area:.1f} cm²",
                f"{numbers['median_mm']:.2f} mm",
                f"{numbers['max_mm']:.2f} mm",
                *(f"{numbers[f'{axis}_mm'][0]:.2f} to {numbers[f'{axis}_mm'][1]:.2f} mm" for axis in "xyz"),
            )
        )
    return rows


def _pictures(robot: Robot, maps: Sequence[DeflectionMap]) -> dict[str, Callable[[], Any]]:
    from screwkin.report.maps import deflection_overview, deflection_picture

    each = {
        f"stiffness_{1e3 * one.place.height:g}mm.png": partial(deflection_picture, robot, one)
        for one in maps
        if np.isfinite(one.magnitude).any()
    }
    return {"stiffness.png": partial(deflection_overview, robot, maps), **each}
