"""Hips, shoulders and the waist between the hips, as lines and home posture tell them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array, cross, norm, rotation_exp
from screwkin.errors import InputError
from screwkin.kinematics.landmarks import limb_root, waist_frame
from screwkin.model.robot import Inertia, Joint, Link, Robot
from tests.laws.descriptions import seen_from
from tests.strategies import unit_vectors, vectors


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


@given(turns=st.tuples(unit_vectors, unit_vectors), places=st.tuples(vectors, vectors))
def test_a_shoulder_of_skew_axes_is_the_foot_of_their_common_normal(
    turns: tuple[Vector, Vector], places: tuple[Vector, Vector]
) -> None:
    """On the first axis, by least squares over both lines."""
    assume(norm(cross(*turns)) > 0.11)  # below, axes count as parallel
    robot = sk.load_robot("bioloid")
    axes = dict(
        zip(("right_shoulder_pitch", "right_shoulder_roll"), zip(turns, places, strict=True), strict=True)
    )
    joints = tuple(
        replace(joint, screw=replace(joint.screw, s=axes[joint.name][0], s0=axes[joint.name][1]))
        if joint.name in axes
        else joint
        for joint in robot.joints
    )
    (s, other), (p, q) = np.array([[*v] for v in turns]), np.array([[*v] for v in places])
    along = np.linalg.lstsq(np.stack([s, -other], axis=1), q - p, rcond=None)[0][0]
    root = limb_root(replace(robot, joints=joints), "right_arm")
    np.testing.assert_allclose([*root], p + along * s, atol=1e-9)


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


def test_the_waist_lies_midway_between_hips_and_turns_with_the_base_frame() -> None:
    """Feet that lean to either side have a mean direction that is no unit vector."""
    robot = sk.load_robot("bioloid")
    lean = {"left_leg": 0.3, "right_leg": -0.3}
    limbs = tuple(
        replace(limb, frame=limb.frame @ Pose(rotation_exp(Vector(lean[limb.name], 0, 0)), Vector(0, 0, 0)))
        if limb.name in lean
        else limb
        for limb in robot.limbs
    )
    robot = replace(robot, limbs=limbs, links=tuple(replace(link, boxes=()) for link in robot.links))
    np.testing.assert_allclose(as_array(waist_frame(robot)).astype(float), np.eye(4), atol=1e-15)
    place = Pose(rotation_exp(Vector(0.3, -0.2, 1.0)), Vector(0.1, -0.2, 0.3))
    elsewhere = as_array(waist_frame(seen_from(robot, place))).astype(float)
    np.testing.assert_allclose(elsewhere, np.linalg.inv(as_array(place).astype(float)), atol=1e-14)


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
