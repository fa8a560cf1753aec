"""The figures of the README's table of walks are what its commands measure, on every digit shown."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.engines import Engine

README = Path(__file__).resolve().parent.parent / "README.md"
STEPS = 8


class Row(NamedTuple):
    """A row of the table: a gait with its changes, and the cells that follow."""

    gait: str
    changes: dict[str, float]
    cells: list[str]


def rows() -> list[Row]:
    text = README.read_text(encoding="utf-8")
    table = text[text.index("| gait | Tc [s] |") :].split("\n\n")[0].splitlines()[2:]
    found = []
    for line in table:
        name, Tc, *cells = [cell.strip().replace("*", "") for cell in line.strip("|").split("|")]
        gait, *others = re.findall(r"`([^`]+)`", name)
        changes = {key: float(value) for key, value in (other.split("=") for other in others)}
        found.append(Row(gait, {"Tc": float(Tc), **changes}, cells))
    return found


def number(cell: str) -> float:
    return float(cell.replace("−", "-").rstrip("°"))


def planned(row: Row) -> tuple[sk.Robot, sk.Trajectory]:
    robot = sk.load_robot("bioloid")
    return robot, sk.walk(robot, sk.load_gait(row.gait).replace(**row.changes), STEPS)


def test_the_table_has_rows_of_three_gaits() -> None:
    assert len(rows()) == 8
    assert {row.gait for row in rows()} == {"paper", "smooth", "walk"}


@pytest.mark.slow
@pytest.mark.parametrize("row", rows(), ids=lambda row: f"{row.gait} {row.changes}")
def test_the_planned_figures_are_those_of_the_walk(row: Row) -> None:
    robot, walk = planned(row)
    balance = sk.zmp(robot, walk)
    knees = [robot.joint_names.index(name) for name in ("right_knee", "left_knee")]
    measured = [
        1e3 * np.linalg.norm(balance.com[:, :2] - balance.zmp, axis=1).max(),
        1e3 * balance.margin.min(),
        np.degrees(np.abs(walk.q[:, knees]).min()),
    ]
    for cell, value in zip(row.cells[:3], measured, strict=True):
        assert number(cell) == pytest.approx(value, abs=0.0501)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
@pytest.mark.parametrize("row", rows(), ids=lambda row: f"{row.gait} {row.changes}")
def test_engines_say_of_the_walk_what_the_table_says(row: Row, engine: Engine) -> None:
    robot, walk = planned(row)
    check = sk.validate(robot, walk, engine, servo="rigid")
    said, rms = row.cells[3:5]
    assert check.passed == (said == "both pass")
    assert check.fell == (said == "it falls in both")
    if rms:
        most = float(rms.split()[-1]) + (0.0 if rms.startswith("below") else 0.0501)
        assert check.zmp_rms_mm is not None
        assert check.zmp_rms_mm < most, "the larger of both engines is shown"
