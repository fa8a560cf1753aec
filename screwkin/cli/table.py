"""``screwkin table``."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from screwkin.algebra.scalar import is_symbolic
from screwkin.cli.options import AsJson, RobotName
from screwkin.cli.output import aligned, print_json, say
from screwkin.errors import InputError
from screwkin.mechanism.printing import Style, print_symbolic, screw_cells, screw_rows, screw_table
from screwkin.model.coupled import coupling_of
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot


def table(
    robot: RobotName,
    symbolic: Annotated[
        bool, typer.Option("--symbolic", help="Keep parameters as symbols; add FK, Jacobian and N of a limb.")
    ] = False,
    limb: Annotated[str | None, typer.Option(help="The limb for --symbolic; default: the first one.")] = None,
    latex: Annotated[bool, typer.Option("--latex", help="As LaTeX.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="As Markdown.")] = False,
    as_json: AsJson = False,
) -> int:
    """The screw table of a robot: for every joint its axis s through s0 in the zero pose, and its pitch."""
    if latex + markdown + as_json > 1:
        raise InputError("--latex, --markdown and --json exclude each other; choose one")
    if limb is not None and not symbolic:
        raise InputError("--limb chooses what --symbolic derives; add --symbolic")
    loaded = load_robot(robot, symbolic)
    style: Style = "latex" if latex else "markdown" if markdown else "text"
    if as_json:
        print_json(_data(loaded, print_symbolic(loaded, limb) if symbolic else None))
        return 0
    derived = [print_symbolic(loaded, limb, style)] if symbolic else []
    if style == "text":
        header, rows = screw_cells(loaded)
        say("\n\n".join([aligned([header, *rows]), *derived]))
    else:
        say("\n\n".join([screw_table(loaded, style), *derived]), folds=False)
    return 0


def _data(robot: Robot, derived: str | None) -> dict[str, Any]:
    rows = [
        {
            "joint": row.joint,
            "type": row.type,
            "s": [_number(c) for c in row.s],
            "s0": [_number(c) for c in row.s0],
            "pitch": _number(row.pitch),
            **({} if row.follows is None else {"mimic": coupling_of(row.follows)}),
        }
        for row in screw_rows(robot)
    ]
    return {"robot": robot.name, "rows": rows, **({} if derived is None else {"symbolic": derived})}


def _number(value: Any) -> Any:
    return str(value) if is_symbolic(value) else float(value)
