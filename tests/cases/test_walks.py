"""Walks of robots that are the Bioloid described otherwise, or have other joints than it."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from screwkin.errors import LimitError, UnreachableError
from screwkin.model.library import gait_names
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot
from tests.cases.tables import AXIS_POINTS, BIOLOID, LONG_LEGS, NECK, WAIST_JOINT, WITHOUT_YAW
from tests.laws.descriptions import seen_from
from tests.laws.test_geometry import assert_same_walk

GAITS = [name for name in gait_names() if "poppy" not in name and name != "auto"]


@cache
def robot_of(text: str) -> Robot:
    return parse_robot(text)


@cache
def walked(text: str, gait: str, rate: float = 10) -> sk.Trajectory:
    return sk.walk(robot_of(text), sk.load_gait(gait).replace(rate=rate), 2)


@cache
def seen_from_the_chest() -> Robot:
    return seen_from(robot_of(BIOLOID), Pose(UNTURNED, Vector(0.02, 0.0, 0.12)))


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("case", AXIS_POINTS)
def test_other_points_of_the_axes_walk_the_same(case: str, gait: str) -> None:
    assert_same_walk(walked(AXIS_POINTS[case], gait), walked(BIOLOID, gait))


@pytest.mark.parametrize("gait", GAITS)
def test_a_base_frame_at_the_chest_walks_the_same(gait: str) -> None:
    moved = sk.walk(seen_from_the_chest(), sk.load_gait(gait).replace(rate=10), 2)
    assert_same_walk(moved, walked(BIOLOID, gait))
    height = moved.T_world_base[:, 2, 3] - walked(BIOLOID, gait).T_world_base[:, 2, 3]
    np.testing.assert_allclose(height, 0.12, atol=1e-12)


@pytest.mark.parametrize("gait", GAITS)
def test_a_neck_rests_and_nothing_else_changes(gait: str) -> None:
    necked = walked(NECK, gait)
    assert not necked.qd[:, 0].any()
    np.testing.assert_array_equal(necked.q[:, 0], 0.0)
    if sk.load_gait(gait).kind != "preview":  # which leads the CoM, of the head too
        np.testing.assert_allclose(necked.q[:, 1:], walked(BIOLOID, gait).q, atol=1e-12)


@pytest.mark.parametrize("gait", GAITS)
def test_a_joint_below_both_arms_rests(gait: str) -> None:
    waisted = walked(WAIST_JOINT, gait)
    np.testing.assert_array_equal(waisted.q[:, 0], 0.0)
    assert waisted.margin.min() > 0.004


def test_legs_without_yaw_walk_straight_and_sideways_and_name_what_they_lack_in_a_turn() -> None:
    for gait in ("walk", "sideways"):
        assert walked(WITHOUT_YAW, gait, rate=4).margin.min() > 0
    lacks = (
        r"no joint of right_leg \(right_hip_roll, .*\) turns right_foot about the vertical.* "
        r"turn 0\.174533 is too far: 0 works"
    )
    with pytest.raises(UnreachableError, match=lacks):
        walked(WITHOUT_YAW, "turn", rate=4)


def test_a_gait_that_stoops_too_low_names_the_key_to_change() -> None:
    key = r"right_knee at .*\. .*waist_height 0\.15 (.*: .*waist_height 0\.\d+ work|is too low: )"
    with pytest.raises(LimitError, match=key):
        walked(LONG_LEGS, "walk", rate=4)
    higher = sk.load_gait("walk").replace(rate=4, waist_height=0.23)
    assert sk.walk(robot_of(LONG_LEGS), higher, 2).samples > 2


def test_hands_out_of_reach_rest_and_name_their_key() -> None:
    low = sk.walk(robot_of(BIOLOID), sk.load_gait("walk").replace(rate=10, hand_drop=0.3), 2)
    remark = r"right_arm rests: .* out of reach by .*; hand_drop is 0\.3, at home 0\.113"
    assert any(re.match(remark, note) for note in low.meta["notes"])
    assert low.meta["at_rest"] == ["right_arm", "left_arm"]
    arms = [i for i, name in enumerate(low.joint_names) if "shoulder" in name or "elbow" in name]
    np.testing.assert_array_equal(
        low.q[:, arms], np.tile(sk.home(robot_of(BIOLOID)).q[arms], (low.samples, 1))
    )
    legs = [i for i in range(18) if i not in arms]
    np.testing.assert_array_equal(low.q[:, legs], walked(BIOLOID, "walk").q[:, legs])
