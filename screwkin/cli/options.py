"""Arguments and options that several verbs share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from screwkin.errors import InputError

RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="A bundled robot's name, or a .toml, .urdf, MJCF .xml or DH .csv file."
    ),
]
TrajectoryPath = Annotated[Path, typer.Argument(metavar="TRAJ", help="A trajectory.npz, as walk writes it.")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]
OutputFolder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Folder for the files; default runs/<time>-…"),
]


def settings(assignments: list[str]) -> dict[str, str]:
    """Keys and values of ``key=value`` texts.

    Raises:
        InputError: a text is no assignment, or a key is given twice.
    """
    values: dict[str, str] = {}
    for text in assignments:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (equals and key and value):
            raise InputError(f"--set {text!r} is no assignment; write --set key=value, such as --set Tc=1.2")
        if key in values:
            raise InputError(f"--set {key} is given twice: {values[key]} and {value}; once is enough")
        values[key] = value
    return values


def point_of(text: str | None, option: str) -> tuple[float, float, float] | None:
    """Three finite numbers written ``X,Y,Z``.

    Raises:
        InputError: they are not.
    """
    if text is None:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text!r} is no point; write three numbers in m, as 50,0,0") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{option} {text!r} holds NaN or infinity; write three finite numbers in m")
    return x, y, z
