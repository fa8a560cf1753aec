"""``screwkin new``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from screwkin.algebra.se3 import as_array
from screwkin.anatomy.humanoid import anatomy
from screwkin.anatomy.record import Anatomy
from screwkin.anatomy.written import commented_table
from screwkin.cli.options import AsJson
from screwkin.cli.output import aligned, print_json, remark, say
from screwkin.errors import InputError
from screwkin.files import atomic_write
from screwkin.model.dh_robot import refuse_dh
from screwkin.model.table import load_robot


def new(
    source: Annotated[str, typer.Argument(metavar="FILE", help="A .urdf file, or any other robot.")],
    target: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="NAME.toml", help="The table to write; default: by its name."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Write the table of a humanoid: limbs, soles, waist and a home posture, from its geometry alone.

    Each is explained, with a confidence from 0 to 1, here and in comments of the table, for you to edit.
    A robot that does not stand on two legs is refused, with the reason.
    """
    refuse_dh(source, "finding limbs")
    found = anatomy(load_robot(source))
    path = Path(f"{found.robot.name}.toml") if target is None else target
    if path.suffix.lower() != ".toml":
        raise InputError(f"cannot write {path}: -o must end with .toml")
    with atomic_write(path) as file:
        file.write(commented_table(found, path.parent))
    if as_json:
        print_json(_data(found, path))
        return 0
    say(f"{path}: {found.robot.name}, {len(found.robot.joints)} joints, confidence {found.confidence:.2f}")
    say(aligned([(f.about, f"{f.confidence:.2f}", f.answer) for f in found.findings], "  "))
    for text in found.remarks:
        remark(f"remark: {text}")
    return 0


def _data(found: Anatomy, path: Path) -> dict[str, Any]:
    """The findings for programs: each with its answer, its confidence and its reason."""
    robot, home = found.robot, found.robot.posture("home")
    limbs = {
        limb.name: {
            "kind": limb.kind,
            "link": limb.link,
            "tip": limb.tip,
            "joints": [robot.tree[i].name for i in robot.path_to(limb.link)],
            "frame": as_array(limb.frame).tolist(),
        }
        for limb in robot.limbs
    }
    return {
        "robot": robot.name,
        "file": str(path),
        "limbs": limbs,
        "soles": {sole.limb: [list(map(float, corner)) for corner in sole.corners] for sole in robot.soles},
        "home": {
            "base_height": home.base_height,
            "q": dict(zip(robot.joint_names, home.q, strict=True)),
        },
        "turn": as_array(found.turn).astype(float).tolist(),
        "confidence": found.confidence,
        "findings": [
            {"about": f.about, "answer": f.answer, "confidence": f.confidence, "why": f.why}
            for f in found.findings
        ],
        "remarks": list(found.remarks),
    }
