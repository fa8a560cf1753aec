"""Law 3 over walks: geometry counts, not its description.

A walk is the same when points slide along their axes, when the base frame lies elsewhere, when rows change
order, when a joint is added that no limb needs; and mirrored when the robot is.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array, rotation_exp
from tests.laws.descriptions import (
    lopsided,
    mirrored,
    reordered,
    seen_from,
    slid,
    with_a_joint,
    without_boxes,
)

GAITS = ("walk", "turn", "sideways", "preview")
RATE = 10.0
metres = st.floats(-10.0, 10.0)
few = settings(max_examples=3, deadline=None)
"""Robots: recording the programs of one takes longer than its walks by all gaits."""


@cache
def gait_of(name: str) -> sk.Gait:
    return sk.load_gait(name).replace(rate=RATE)


@cache
def robot_of(name: str = "bioloid") -> sk.Robot:
    return sk.load_robot(name)


@cache
def reference(gait: str) -> sk.Trajectory:
    return sk.walk(robot_of(), gait_of(gait), 2)


def assert_same_walk(one: sk.Trajectory, other: sk.Trajectory, atol: float = 1e-9) -> None:
    """Joints, ZMP, margins, notes: everything but where the base frame lies."""
    order = [one.joint_names.index(name) for name in other.joint_names]
    feet = [one.feet.index(name) for name in other.feet]
    np.testing.assert_allclose(one.q[:, order], other.q, atol=atol)
    np.testing.assert_allclose(one.qd[:, order], other.qd, atol=100 * atol)
    np.testing.assert_allclose(one.qdd[:, order], other.qdd, atol=1e4 * atol)
    np.testing.assert_allclose(one.margin, other.margin, atol=atol)
    np.testing.assert_allclose(one.zmp, other.zmp, atol=atol)
    np.testing.assert_allclose(one.com, other.com, atol=atol)
    np.testing.assert_array_equal(one.contact[:, feet], other.contact)
    for tip in other.T_world_tip:
        np.testing.assert_allclose(one.T_world_tip[tip], other.T_world_tip[tip], atol=atol)
    assert one.meta["notes"] == other.meta["notes"]
    for limb, sigma in other.meta["sigma"].items():
        assert one.meta["sigma"][limb] == pytest.approx(sigma, abs=atol)


@few
@given(shifts=st.dictionaries(st.sampled_from(sk.load_robot("bioloid").joint_names), metres, max_size=18))
def test_points_may_slide_along_their_axes(shifts: dict[str, float]) -> None:
    robot = slid(robot_of(), shifts)
    for gait in GAITS:
        assert_same_walk(sk.walk(robot, gait_of(gait), 2), reference(gait))


@few
@given(x=metres, y=metres, z=metres)
def test_the_base_frame_may_lie_elsewhere(x: float, y: float, z: float) -> None:
    place = Pose(UNTURNED, Vector(x, y, z))
    robot = seen_from(robot_of(), place)
    for gait in GAITS:
        moved = sk.walk(robot, gait_of(gait), 2)
        assert_same_walk(moved, reference(gait))
        expected = reference(gait).T_world_base @ as_array(place).astype(float)
        np.testing.assert_allclose(moved.T_world_base, expected, atol=1e-9)


@cache
def without_boxes_walked(gait: str) -> sk.Trajectory:
    return sk.walk(without_boxes(robot_of()), gait_of(gait), 2)


@few
@given(
    lean=st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9)),
    yaw=st.floats(-3.0, 3.0),
    place=st.tuples(metres, metres, metres),
)
def test_the_base_frame_may_be_turned(
    lean: tuple[float, float], yaw: float, place: tuple[float, float, float]
) -> None:
    """Up to a right angle off upright: a table gives its soles as seen from above."""
    turn = rotation_exp(Vector(0, 0, yaw)) @ rotation_exp(Vector(*lean, 0.0))
    robot = seen_from(without_boxes(robot_of()), Pose(turn, Vector(*place)))
    for gait in GAITS:
        assert_same_walk(sk.walk(robot, gait_of(gait), 2), without_boxes_walked(gait))


@few
@given(data=st.data())
def test_rows_may_stand_in_any_order(data: st.DataObject) -> None:
    robot = robot_of()
    orders = [data.draw(st.permutations(range(len(r)))) for r in (robot.joints, robot.links, robot.limbs)]
    shuffled = reordered(robot, *orders)
    for gait in GAITS:
        assert_same_walk(sk.walk(shuffled, gait_of(gait), 2), reference(gait))


@few
@given(limp=st.floats(-0.01, 0.01))
def test_the_mirrored_robot_walks_the_mirrored_walk(limp: float) -> None:
    robot = lopsided(robot_of(), limp)
    image, names = mirrored(robot)
    for plan in map(gait_of, GAITS):
        other = "left" if plan.first == "right" else "right"
        towards = plan.replace(first=other, side=-plan.side, turn=-plan.turn)
        one, two = sk.walk(robot, plan, 2), sk.walk(image, towards, 2)
        for i, name in enumerate(one.joint_names):
            twin, sign = names[name]
            np.testing.assert_allclose(two.q[:, two.joint_names.index(twin)], sign * one.q[:, i], atol=1e-9)
        np.testing.assert_allclose(two.zmp * [1, -1], one.zmp, atol=1e-9)
        np.testing.assert_allclose(two.margin, one.margin, atol=1e-9)


@pytest.mark.parametrize("gait", ["walk", "preview"])
@pytest.mark.parametrize("parent", ["torso", "right_forearm", "left_foot_link"])
def test_a_joint_that_no_limb_needs_rests_where_its_posture_has_it(parent: str, gait: str) -> None:
    robot = with_a_joint(robot_of(), parent)
    walked = sk.walk(robot, gait_of(gait), 2)
    np.testing.assert_array_equal(walked.q[:, -1], 0.3)
    np.testing.assert_allclose(walked.q[:, :-1], reference(gait).q, atol=1e-9)
    np.testing.assert_allclose(walked.margin, reference(gait).margin, atol=1e-9)
