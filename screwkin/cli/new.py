"""``screwkin new``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from screwkin.anatomy.humanoid import anatomy
from screwkin.anatomy.record import Anatomy, Finding
from screwkin.cli.options import AsJson
from screwkin.cli.output import aligned, print_json, remark
from screwkin.errors import InputError
from screwkin.files import atomic_write
from screwkin.model.table import load_robot
from screwkin.model.toml import table_path


def new(
    source: Annotated[str, typer.Argument(metavar="FILE", help="A .urdf file, or any other robot.")],
    target: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="NAME.toml", help="The table to write; default: by its name."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Write the table of a humanoid of unknown names: limbs, soles, waist and a home posture from its geometry.

    Each is explained, with a confidence from 0 to 1, here and in comments of the table, which is to be edited.
    A robot that does not stand on two legs is refused, with the reason.
    """
    found = anatomy(load_robot(source))
    path = Path(f"{found.robot.name}.toml") if target is None else target
    if path.suffix.lower() != ".toml":
        raise InputError(f"cannot write {path}: -o must end with .toml")
    with atomic_write(path) as file:
        file.write(found.robot.text)
    if as_json:
        print_json(_data(found, path))
        return 0
    print(f"{path}: {found.robot.name}, {len(found.robot.joints)} joints, confidence {found.confidence:.2f}")
    print(aligned([(f.about, f"{f.confidence:.2f}", f.answer) for f in found.findings], "  "))
    for text in found.remarks:
        remark(f"remark: {text}")
    return 0
