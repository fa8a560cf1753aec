"""Arguments and options that several verbs share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer

from screwkin.errors import InputError
from screwkin.sim.perturbation import Perturbation
from screwkin.sim.perturbation_files import described, load_perturbation, perturbation_from_texts

RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="A bundled robot's name, or a .toml, .urdf, MJCF .xml or DH .csv file."
    ),
]
TrajectoryPath = Annotated[Path, typer.Argument(metavar="TRAJ", help="A trajectory.npz, as walk writes it.")]
GaitName = Annotated[
    str | None,
    typer.Option(metavar="NAME|FILE", help="A bundled gait's name or a file; default: ROBOT-… or walk."),
]
FittingGait = Annotated[
    bool, typer.Option("--auto", help="A gait that fits the robot; limbs are found where none are named.")
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]
OutputFolder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Folder for the files; default runs/<time>-…"),
]

Perturbed = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=VALUE",
        help="A world other than the planned one: push=0.2,0,0, slope=3*deg,0, lag.right_knee=0.02, or a "
        ".toml file with [perturbation]; repeatable.",
    ),
]


def refuse_together(options: Mapping[str, object]) -> None:
    """Refuse options that exclude each other, if several are given: those that are neither None nor False.

    Raises:
        InputError: several are given.
    """
    given = [name for name, value in options.items() if value is not None and value is not False]
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} exclude each other; give one of them")


def perturbation_of(texts: Sequence[str]) -> Perturbation:
    """The perturbation of ``--perturb``: ``key=value`` texts, over those of a file.

    Raises:
        InputError: a text is neither an assignment nor a file, or a value is wrong.
    """
    files = [text for text in texts if "=" not in text]
    if len(files) > 1:
        raise InputError(f"--perturb {' and '.join(files)}: give one file, and key=value beside it")
    of_file = described(load_perturbation(files[0])) if files else ()
    own = [text for text in texts if "=" in text]
    keys = {text.partition("=")[0].partition(".")[0].strip() for text in own}
    base = [text for text in of_file if text.partition("=")[0].partition(".")[0] not in keys]
    return perturbation_from_texts([*base, *own])


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
    x, y, z = numbers_of(text, option, (3,), "point", "three numbers in m, as 50,0,0")
    return x, y, z


def numbers_of(
    text: str,
    option: str,
    counts: tuple[int, ...],
    what: str = "list of numbers",
    write: str = "",
) -> list[float]:
    """Finite numbers written with commas between them.

    Args:
        text: ``X,Y,...``.
        option: its name in messages.
        counts: how many there may be.
        what: they are, in messages.
        write: what to write instead.

    Raises:
        InputError: they are not.
    """
    write = write or f"{' or '.join(map(str, counts))} numbers, with commas between them"
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts:
        raise InputError(f"{option} {text!r} is no {what}; write {write}")
    if not all(map(math.isfinite, values)):
        raise InputError(f"{option} {text!r} holds NaN or infinity; write {write}")
    return values


def assignment(option: str, text: str, example: str) -> tuple[str, str]:
    """Name and value of ``NAME=VALUE``.

    Raises:
        InputError: the text is no assignment.
    """
    name, equals, value = (part.strip() for part in text.partition("="))
    if not (equals and name and value):
        raise InputError(f"{option} {text!r} is no assignment; write {option} {example}")
    return name, value


def assignments(option: str, texts: Sequence[str], example: str) -> dict[str, float]:
    """Numbers by name, of ``NAME=NUMBER`` texts.

    Raises:
        InputError: a text is no assignment of a finite number, or a name is given twice.
    """
    values: dict[str, float] = {}
    for text in texts:
        name, value = assignment(option, text, example)
        if name in values:
            raise InputError(f"{option} {name} is given twice; once is enough")
        (values[name],) = numbers_of(value, f"{option} {name}", (1,), "number", "one number")
    return values
