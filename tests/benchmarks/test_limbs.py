"""Rows of limbs: their poses are solved, and arms that begin at the waist have a row from their shoulder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.limbs import BATCHES, limbs_of, page_of, row_of, rows_of, shouldered
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.table import parse_robot
from screwkin.model.urdf import urdf_from_robot
from tests.bodies import humanoid


def test_limbs_of_a_humanoid_are_measured(tmp_path: Path) -> None:
    file = tmp_path / "one.urdf"
    file.write_text(urdf_from_robot(parse_robot(humanoid())), encoding="utf-8")
    rows = list(rows_of(file, 20))
    assert {"right_leg", "left_leg"} <= {row.limb for row in rows}
    for row in rows:
        assert len(row.times) == BATCHES
        assert row.inside == 1.0
        assert row.own in (None, 1.0)
    page = page_of(rows)
    assert all(str(row) in page for row in rows)


def test_an_arm_from_its_shoulder_is_its_last_seven_joints() -> None:
    chain = limbs_of(parse_robot(humanoid()))[1][0][1]
    rng = np.random.default_rng(0)
    longer = SerialChain(
        "arm",
        tuple(f"j{i}" for i in range(9)),
        tuple(range(9)),
        tuple(chain.screws[i % len(chain.screws)] for i in range(9)),
        chain.tip,
        -np.ones(9),
        np.ones(9),
        np.ones(9, dtype=bool),
        1.0,
    )
    arm = shouldered(longer)
    assert arm.names == longer.names[2:]
    assert row_of("file", "arm", arm, rng.uniform(-0.1, 0.1, 7), 5).joints == 7
