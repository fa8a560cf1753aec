"""Walks of legs with linkages: what their motors can do, and what the reader is told."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import LimitError

LIMIT = np.deg2rad(60)


def test_a_motor_of_60_degrees_is_honoured_by_walks() -> None:
    """The motor turns with the knee: steps low and short enough pass unchanged, others name the motor."""
    free = sk.load_robot("linkages/knee-parallelogram")
    robot = free.replace(limits={"right_knee_motor": (-LIMIT, LIMIT)})
    gait, motors = (
        sk.load_gait("walk"),
        [free.joint_names.index(f"{s}_knee_motor") for s in ("right", "left")],
    )
    with pytest.raises(LimitError, match=r"right_knee_motor at \d+.\d deg, limits -60.0 to 60.0 deg"):
        sk.walk(robot, gait, 2)
    assert np.abs(sk.walk(free, gait, 2).q[:, motors]).max() > LIMIT
    low = gait.replace(lift=0.003, stride=0.02, waist_height=0.175)
    walk = sk.walk(robot, low, 2)
    assert 0.7 * LIMIT < np.abs(walk.q[:, motors]).max() < LIMIT
    np.testing.assert_array_equal(walk.q, sk.walk(free, low, 2).q)
