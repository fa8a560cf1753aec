"""Hips, shoulders and the waist between the hips, as lines and home posture tell them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array
from screwkin.errors import InputError
from screwkin.kinematics.landmarks import limb_root, waist_frame
from screwkin.model.robot import Inertia, Joint, Link, Robot


def place(robot: Robot, limb: str) -> list[float]:
    return [round(float(c), 12) for c in limb_root(robot, limb)]


@pytest.mark.parametrize("name", ["bioloid", "bioloid24", "poppy12"])
def test_the_waist_of_bundled_robots_is_their_base_frame(name: str) -> None:
    waist = as_array(waist_frame(sk.load_robot(name))).astype(float)
    np.testing.assert_allclose(waist, np.eye(4), atol=1e-15)


def test_shoulders_and_hips_are_where_axes_meet() -> None:
    robot = sk.load_robot("bioloid")
    assert place(robot, "right_arm") == [0.0, -0.064646, 0.121451]
    assert place(robot, "left_leg") == [0.0, 0.042165, 0.0]


def test_where_axes_pass_each_other_it_is_the_point_of_the_first_one() -> None:
    assert place(sk.load_robot("poppy12"), "left_leg") == [0.0, 0.019, 0.0]


def test_parallel_axes_leave_the_point_nearest_to_the_tip() -> None:
    robot = sk.load_robot("bioloid")
    parallel = tuple(
        replace(joint, screw=replace(joint.screw, s=Vector(0, 1, 0))) if "arm" in joint.child else joint
        for joint in robot.joints
    )
    assert place(replace(robot, joints=parallel), "right_arm") == [0.0, -0.064646, 0.121451]


def test_a_joint_below_both_arms_is_no_part_of_a_shoulder_but_carries_it() -> None:
    robot, base = sk.load_robot("bioloid"), Pose(UNTURNED, Vector(0, 0, 0))
    screw = replace(robot.joints[0].screw, s=Vector(0, 0, 1), s0=Vector(0, 0, 0))
    yaw = Joint("waist_yaw", "torso", "chest", "revolute", screw, -2.0, 2.0, 6.0, 1.5)
    joints = tuple(replace(j, parent="chest") if "shoulder_pitch" in j.name else j for j in robot.joints)
    turned = replace(
        robot,
        links=(*robot.links, Link("chest", 0, base.p, Inertia(0, 0, 0), base)),
        joints=(*joints, yaw),
        postures=tuple(replace(p, q=(*p.q, np.pi / 2)) for p in robot.postures),
    )
    assert place(turned, "right_arm") == [0.064646, 0.0, 0.121451]


def test_the_table_s_waist_wins() -> None:
    waist = Pose(UNTURNED, Vector(0.01, 0, 0.02))
    named = waist_frame(replace(sk.load_robot("bioloid"), waist=waist))
    np.testing.assert_array_equal(as_array(named), as_array(waist).astype(float))


def test_feet_that_point_in_opposite_directions_leave_no_forward() -> None:
    robot = sk.load_robot("bioloid")
    about = Pose(type(UNTURNED)(Vector(-1, 0, 0), Vector(0, -1, 0), Vector(0, 0, 1)), Vector(0, 0, 0))
    limbs = tuple(
        replace(limb, frame=limb.frame @ about) if limb.name == "left_leg" else limb for limb in robot.limbs
    )
    with pytest.raises(InputError, match=r"right_foot, left_foot point in opposite directions at home"):
        waist_frame(replace(robot, limbs=limbs))
