"""``screwkin ik``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import typer

from screwkin.analysis.ik_study import PAPER_TABLE_5, IkRow, ik_study
from screwkin.cli.options import AsJson, RobotName
from screwkin.cli.output import aligned, print_json, progress_bar, say
from screwkin.model.table import load_robot

HEAD = ("method", "iterations: mean", "max", "solved", "in limits", "us each", "settings")
TITLES = {"gait": "along a walk", "random": "random poses inside the limits"}


def ik(
    robot: RobotName,
    limb: Annotated[str, typer.Argument(metavar="LIMB", help="A limb's name, or its tip's.")],
    poses: Annotated[int, typer.Option(help="Number of random poses.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Seed of the random poses.")] = 0,
    waist: Annotated[
        float | None,
        typer.Option(help="Waist above the soles in the walk [m]; default: high, as in the paper."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Compare inverse kinematics methods on a limb, over a walk (legs only) and over random poses.

    Closed form, hybrid and numeric methods; Pinocchio's CLIK and EAIK where they are installed.
    """
    with progress_bar("ik") as done:
        study = ik_study(load_robot(robot), limb, poses, seed, waist=waist, progress=done)
    if as_json:
        paper = [
            {"method": name, "iterations": iterations, "milliseconds": milliseconds}
            for name, (iterations, milliseconds) in PAPER_TABLE_5.items()
        ]
        content = {"rows": [asdict(row) for row in study.rows], "notes": study.notes, "paper": paper}
        print_json({"robot": study.robot, "limb": study.limb, **content})
        return 0
    say(f"{study.robot}, {study.limb}: inverse kinematics")
    for data in dict.fromkeys(row.data for row in study.rows):
        rows = [row for row in study.rows if row.data == data]
        say(f"{TITLES[data]}, {rows[0].samples} points")
        say(aligned([HEAD, *(_cells(row, rows[0].samples) for row in rows)], "  "))
    say("paper B, Table 5, its own leg and walk")
    printed = [(name, str(count), f"{ms:g} ms") for name, (count, ms) in PAPER_TABLE_5.items()]
    say(aligned([("method", "iterations", "time"), *printed], "  "))
    say("\n".join(study.notes))
    return 0


def _cells(row: IkRow, samples: int) -> Sequence[str]:
    few = "" if row.samples == samples else f"; the first {row.samples}"
    return (
        row.method,
        f"{row.mean_iterations:.2f}",
        str(row.max_iterations),
        f"{100 * row.solved:.2f} %",
        f"{100 * row.in_limits:.2f} %",
        f"{row.microseconds:.0f}",
        row.settings + few,
    )
