"""``screwkin workspace``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from screwkin.analysis.map_arrays import workspace_arrays
from screwkin.analysis.workspace import WorkspaceMap
from screwkin.cli.maps import Heights, LimbName, MapResult, Pictures, Resolution, reached_maps, run_maps
from screwkin.cli.options import AsJson, OutputFolder, RobotName
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot


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

    def compute() -> MapResult:
        maps = reached_maps(table, limb, heights, resolution)
        title = f"{table.name}, {maps[0].limb}: reach with the tip held level, grid {1e3 * resolution:g} mm"
        data = workspace_data(table, maps)
        return MapResult(workspace_arrays(maps), data, title, _rows(maps), _pictures(table, maps))

    return run_maps("workspace", table, compute, plots, output, as_json)


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


def _pictures(robot: Robot, maps: Sequence[WorkspaceMap]) -> dict[str, Callable[[], Any]]:
    from screwkin.report.maps import workspace_overview, workspace_picture

    most = max(_best(place) for place in maps if place.area)
    each = {
        f"workspace_{1e3 * place.height:g}mm.png": partial(workspace_picture, robot, place, most)
        for place in maps
    }
    return {"workspace.png": partial(workspace_overview, robot, maps, most), **each}
