"""Walks of legs with linkages: what their motors can do, and what the reader is told."""

from __future__ import annotations

import re

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import LimitError, SingularError
from screwkin.gait.lengths import fitted
from screwkin.gait.walk import planned_walk
from tests.linked import flat_at_90

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


def test_a_walk_says_how_near_a_linkage_comes_to_its_dead_point_and_is_refused_there() -> None:
    """Bars that lie flat at a knee of 90 degrees: the nearest knee of the walk is what the note says."""
    robot = flat_at_90()
    low = sk.load_gait("walk").replace(lift=0.012, rate=10.0)
    walk = sk.walk(robot, low, 2)
    notes = [note for note in walk.meta["notes"] if "dead point" in note]
    assert len(notes) == 2  # one for each knee
    knees = walk.q[:, [robot.joint_names.index(f"{s}_knee") for s in ("right", "left")]]
    left = min(float(re.findall(r"within (\d\.\d) deg of its dead point", note)[0]) for note in notes)
    assert 2 < left < 10
    assert left == pytest.approx(90 - np.degrees(knees.max()), abs=1.0)
    with pytest.raises(SingularError, match=r"right_leg, sample \d+ .* reaches its dead point"):
        planned_walk(robot, fitted(low.replace(lift=0.03), robot), 1)  # ``walk`` without its remedies
