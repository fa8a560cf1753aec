"""Joints that follow in linkages: closed to rounding, on one branch, whatever is asked beside them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.errors import InputError
from screwkin.ik.linkage import needs_newton, with_followers
from screwkin.mechanism.linkages import Linkage, limb_linkages, linkages, motor_joints
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot
from tests.linked import BUNDLED, flat_at_90, four_bar_knee, gaps


def moved(robot: Robot, linkage: Linkage, *angles: np.ndarray) -> np.ndarray:
    """q (B, n) at home but for the imposed joints of a linkage."""
    q = np.tile(sk.home(robot).q, (len(angles[0]), 1))
    q[:, list(linkage.imposed)] = np.stack(angles, axis=1)
    return q


pins = st.tuples(st.floats(0.012, 0.04), st.floats(-0.015, 0.015))
"""Behind the axes, so that no bar lies along the thigh at the reference posture."""


@settings(max_examples=8, deadline=None)
@given(pins, pins, st.floats(0.05, 1.2))
def test_a_knee_by_any_four_bar_closes_or_is_known_not_to(
    top: tuple[float, float], end: tuple[float, float], most: float
) -> None:
    top, end = (-top[0], top[1]), (-end[0], end[1])
    crank = np.hypot(*top)
    robot = four_bar_knee(top, end)
    linkage = limb_linkages(robot, "right_leg")[0]
    assert not needs_newton(robot, linkage)
    knee = np.linspace(0, most, 40)
    done = with_followers(robot, linkage, moved(robot, linkage, knee))
    np.testing.assert_allclose(gaps(robot, done.q)[done.closed, 0], 0, atol=1e-12)
    # The rod reaches exactly as far as the triangle of crank, rod and the lever's pin.
    thigh, rod = (
        robot.parameters["thigh"],
        np.hypot(top[0] - end[0], top[1] - end[1] + robot.parameters["thigh"]),
    )
    c, s = np.cos(knee), np.sin(knee)
    far = np.hypot(c * end[0] + s * end[1], -s * end[0] + c * end[1] - thigh)
    reach = np.minimum(far - abs(crank - rod), crank + rod - far)
    assert (done.closed == (reach > 0))[abs(reach) > 1e-9].all()


@pytest.mark.parametrize("name", BUNDLED)
@settings(max_examples=6, deadline=None)
@given(data=st.data())
def test_linkages_follow_without_a_jump_and_alone_as_in_a_batch(name: str, data: st.DataObject) -> None:
    robot = sk.load_robot(name)
    linkage = limb_linkages(robot, data.draw(st.sampled_from(["right_leg", "left_leg"])))[0]
    home = sk.home(robot).q[list(linkage.imposed)]
    ends = [data.draw(st.floats(-0.5, 0.5)) for _ in linkage.imposed]
    ways = [h + np.linspace(0, e, 60) for h, e in zip(home, ends, strict=True)]
    q = moved(robot, linkage, *ways)
    done = with_followers(robot, linkage, q)
    assert done.closed.all()
    row = robot.closures.index(linkage.closures[0])
    np.testing.assert_allclose(gaps(robot, done.q)[:, row], 0, atol=1e-10)
    assert np.abs(np.diff(done.q, axis=0)).max() < 0.1
    k = data.draw(st.integers(0, 59))
    alone = with_followers(robot, linkage, q[k : k + 1])
    np.testing.assert_allclose(alone.q[0], done.q[k], atol=1e-12)


def test_the_motor_of_a_parallelogram_turns_with_the_knee() -> None:
    robot = flat_at_90()
    linkage = limb_linkages(robot, "left_leg")[0]
    knee = np.linspace(-1.5, 1.5, 101)
    q = with_followers(robot, linkage, moved(robot, linkage, knee)).q
    np.testing.assert_allclose(q[:, robot.joint_names.index("left_knee_motor")], knee, atol=1e-7)


def test_motors_stand_beside_the_way_to_the_tip_unless_the_table_says_otherwise() -> None:
    text = (robot := flat_at_90()).text
    motors = {name for name in motor_joints(robot) if "knee" in name}
    assert motors == {"right_knee_motor", "left_knee_motor"}
    silent = parse_robot(text.replace("passive = true", ""))
    assert motor_joints(silent) == motor_joints(robot)
    named = text.replace("passive = true    # the linkage turns it", "")
    named = named.replace('name = "right_knee_motor"', 'name = "right_knee_motor"\npassive = true')
    direct = parse_robot(named)
    assert {name for name in motor_joints(direct) if "knee" in name} == {"right_knee", "left_knee"}


def test_parallel_ankles_have_two_motors_for_two_joints() -> None:
    robot = sk.load_robot("linkages/parallel-ankles")
    (linkage,) = limb_linkages(robot, "right_leg")
    name = robot.joint_names.__getitem__
    assert list(map(name, linkage.imposed)) == ["right_ankle_pitch", "right_ankle_roll"]
    assert list(map(name, linkage.motors)) == ["right_outer_ankle_motor", "right_inner_ankle_motor"]
    assert len(linkages(robot)) == 2
    assert needs_newton(robot, linkage)
    assert len(motor_joints(robot)) == 18


def test_a_loop_that_is_open_at_home_is_refused_by_name() -> None:
    text = flat_at_90().text.replace('right_rod_top = "-knee_angle"', 'right_rod_top = "-0.5*knee_angle"')
    with pytest.raises(InputError, match="closure right_knee_loop is open by"):
        motor_joints(parse_robot(text))
