"""What the verbs that draw maps share: their options, and their files."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from screwkin.analysis.workspace import WorkspaceMap
from screwkin.analysis.workspace import workspace as maps_of
from screwkin.cli.folder import output_folder
from screwkin.cli.output import aligned, drawn, print_json, progress_bar, say
from screwkin.errors import InputError, UnreachableError
from screwkin.files import atomic_write_bytes, npz_bytes
from screwkin.model.robot import Robot

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


@dataclass(frozen=True)
class MapResult:
    """The result of a verb: arrays for ``.npz``, JSON data, a title with rows, and pictures by file name."""

    arrays: Mapping[str, np.ndarray[Any, Any]]
    data: Mapping[str, Any]
    title: str
    rows: Sequence[Sequence[str]]
    pictures: Mapping[str, Callable[[], Any]]


def run_maps(
    verb: str, robot: Robot, compute: Callable[[], MapResult], plots: bool, output: Path | None, as_json: bool
) -> int:
    """Compute maps, write them as ``VERB.npz`` and pictures, and print them."""
    with output_folder(output, verb, robot.name) as folder:
        result = compute()
        with atomic_write_bytes(folder / f"{verb}.npz") as file:
            file.write(npz_bytes(result.arrays))
        if plots:
            drawn(lambda: _draw(result, folder))
    if as_json:
        print_json({**result.data, "folder": str(folder)})
    else:
        say(result.title)
        say(aligned(result.rows, "  "))
        say(f"files in {folder}")
    return 0


def _draw(result: MapResult, folder: Path) -> list[Path]:
    from screwkin.report.style import save_figure, styled

    saved = []
    with progress_bar("pictures") as done, styled():
        for count, (name, picture) in enumerate(result.pictures.items()):
            saved.append(save_figure(picture(), folder / name))
            done((count + 1) / len(result.pictures))
    return saved


def reached_maps(
    robot: Robot, limb: str | None, heights: str | None, resolution: float
) -> list[WorkspaceMap]:
    """The workspace at the heights of a command line.

    Raises:
        UnreachableError: nothing is reached at any height.
    """
    name = first_leg(robot) if limb is None else limb
    with progress_bar("workspace") as done:
        maps = maps_of(robot, name, listed_numbers(heights, "--heights"), resolution, done)
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


def listed_numbers(text: str | None, option: str) -> list[float] | None:
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
