"""``screwkin workspace``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from screwkin.analysis.map_arrays import workspace_arrays
from screwkin.analysis.workspace import WorkspaceMap
from screwkin.analysis.workspace import workspace as maps_of
from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder, RobotName
from screwkin.cli.output import aligned, print_json, progress_bar
from screwkin.errors import InputError, UnreachableError
from screwkin.files import atomic_write_bytes, npz_bytes
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot

LimbName = Annotated[str | None, typer.Option(help="The limb; default: the first leg of the table.")]
Heights = Annotated[
    str | None,
    typer.Option(
        metavar="Z,Z,…",
        help="Heights of the waist above the tip [m], as 0.35,0.4; default: five, by the limb's length.",
    ),
]
Resolution = Annotated[float, typer.Option(help="Distance of grid points [m].")]
Pictures = Annotated[bool, typer.Option("--plots/--no-plots", help="Draw the pictures.")]


def workspace(
    robot: RobotName,
    limb: LimbName = None,
    heights: Heights = None,
    resolution: Resolution = 0.0025,
    plots: Pictures = True,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Where a limb can put its tip, held level: area, which joint limit cuts where, conditioning.

    Files: workspace.npz and pictures, one of all heights and one for each. Exit code 3 if nothing is reached.
    The legs may meet: the map does not ask.
    """
    table = load_robot(robot)
    with output_folder(output, "workspace", table.name) as folder:
        maps = reached_maps(table, limb, heights, resolution)
        with atomic_write_bytes(folder / "workspace.npz") as file:
            file.write(npz_bytes(workspace_arrays(maps)))
        if plots:
            _draw(table, maps, folder)
    if as_json:
        print_json({**workspace_data(table, maps), "folder": str(folder)})
    else:
        print(f"{table.name}, {maps[0].limb}: reach with the tip held level, grid {1e3 * resolution:g} mm")
        print(aligned(_rows(maps), "  "))
        print(f"files in {folder}")
    return 0


def reached_maps(
    robot: Robot, limb: str | None, heights: str | None, resolution: float
) -> list[WorkspaceMap]:
    """The workspace at the heights of a command line.

    Raises:
        UnreachableError: nothing is reached at any height.
    """
    name = first_leg(robot) if limb is None else limb
    with progress_bar("workspace") as done:
        maps = maps_of(robot, name, numbers(heights, "--heights"), resolution, done)
    if not any(place.area for place in maps):
        listed = ", ".join(f"{place.height:g}" for place in maps)
        raise UnreachableError(
            f"{maps[0].limb} reaches no point with its tip held level {listed} m below the waist; "
            "take other heights, or a finer resolution",
            maps[0].limb,
        )
    return maps


def first_leg(robot: Robot) -> str:
    """Name of the first leg of a table.

    Raises:
        InputError: it has none.
    """
    for limb in robot.limbs:
        if limb.kind == "leg":
            return limb.name
    raise InputError(f"{robot.name} has no leg; name a limb of six joints or more by --limb")


def numbers(text: str | None, option: str) -> list[float] | None:
    """Finite numbers separated by commas.

    Raises:
        InputError: they are not.
    """
    if text is None:
        return None
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option} {text!r} are no numbers; write them in m, as 0.35,0.4") from None
    if not all(map(math.isfinite, values)):
        raise InputError(f"{option} {text!r} holds NaN or infinity; write finite numbers in m")
    return values


def workspace_data(robot: Robot, maps: Sequence[WorkspaceMap]) -> dict[str, Any]:
    """Areas [cm^2], median condition numbers and cuts [cm^2] as JSON data."""
    return {
        "robot": robot.name,
        "limb": maps[0].limb,
        "resolution": maps[0].resolution,
        "normalising_length": maps[0].length,
        "heights": [place.height for place in maps],
        "areas": [1e4 * place.area for place in maps],
        "medians": [place.median_condition for place in maps],
        "rows": [
            {
                "height": place.height,
                "area_cm2": 1e4 * place.area,
                "median_condition": place.median_condition,
                "best_inverse_condition": _best(place),
                "cuts_cm2": {name: 1e4 * area for name, area in place.cuts.items()},
            }
            for place in maps
        ],
    }


def _best(place: WorkspaceMap) -> float:
    return float(np.nanmax(place.inverse_condition)) if place.area else math.nan


def _rows(maps: Sequence[WorkspaceMap]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("height", "area", "median cond", "cut most by")]
    for place in maps:
        cuts = [f"{name} {1e4 * area:.0f} cm²" for name, area in list(place.cuts.items())[:2]]
        rows.append(
            (
                f"{1e3 * place.height:g} mm",
                f"{1e4 * place.area:.1f} cm²",
                f"{place.median_condition:.1f}",
                ", ".join(cuts),
            )
        )
    return rows


def _draw(robot: Robot, maps: Sequence[WorkspaceMap], folder: Path) -> None:
    from screwkin.report.maps import workspace_overview, workspace_picture
    from screwkin.report.style import save_figure, styled

    most = max(_best(place) for place in maps if place.area)
    with progress_bar("pictures") as done, styled():
        save_figure(workspace_overview(robot, maps, most), folder / "workspace.png")
        for k, place in enumerate(maps):
            figure = workspace_picture(robot, place, most)
            save_figure(figure, folder / f"workspace_{1e3 * place.height:g}mm.png")
            done((k + 1) / len(maps))
