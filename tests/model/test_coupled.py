"""Coupled joints of tables: read, refused with the reason, mirrored, changed, written and read again."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError, TableError, UnknownNameError
from screwkin.kinematics.limits import limited_joints, limits_of
from screwkin.model.records import CoupledJoint, same_content
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot
from screwkin.model.toml_out import robot_toml
from tests.model.tables import MINI, changed, faults_of, only_fault

KNEE = 'lower = "-20*deg"\nupper = 1.5\n'
COUPLED = changed(KNEE, f'{KNEE}mimic = {{ joint = "right_hip", ratio = -0.5, offset = "20*deg" }}\n')
TOE = """
[[link]]
name = "right_toe"
mass = 0

[[joint]]
name = "right_toe"
parent = "right_shin"
child = "right_toe"
type = "prismatic"
s = [0, 0.6, 0.8]
s0 = [0, 0, 0]
mimic = { joint = "right_knee", ratio = 0.2, offset = 0.01 }
"""


def test_a_coupled_joint_has_no_place_in_q_and_follows_in_every_pose():
    robot, free = parse_robot(COUPLED), parse_robot(MINI)
    assert robot.joint_names == ("right_hip", "left_hip")
    assert [joint.name for joint in robot.coupled] == ["right_knee", "left_knee"]
    assert robot.joint("right_knee") is robot.coupled[0]
    q = np.array([0.4, 0.7])
    bent = np.radians(20) - 0.5 * q
    poses = sk.link_poses(free, sk.State(np.eye(4), np.array([q[0], bent[0], q[1], -bent[1]])))
    order = [free.link_names.index(name) for name in robot.link_names]
    np.testing.assert_allclose(sk.link_poses(robot, sk.State(np.eye(4), q)), poses[order], atol=1e-15)


def test_a_mirrored_coupling_is_the_mirror_image_of_the_motion():
    """The knee turns about x, whose image turns the other way: ratio and offset change their signs."""
    left = parse_robot(COUPLED).coupled[1]
    assert (left.leader, left.ratio, left.offset) == ("left_hip", 0.5, -np.radians(20))


def test_a_joint_that_follows_a_coupled_one_follows_its_leader():
    robot = parse_robot(COUPLED + TOE)
    toe = robot.joint("right_toe")
    assert isinstance(toe, CoupledJoint)
    assert toe.leader == "right_hip"
    np.testing.assert_allclose((toe.ratio, toe.offset), (-0.1, 0.2 * np.radians(20) + 0.01), rtol=1e-15)
    assert robot.joint("left_toe").leader == "left_hip"


def test_limits_and_speeds_are_those_that_all_coupled_joints_leave():
    robot = parse_robot(COUPLED.replace(KNEE, f"{KNEE}velocity = 2\n"))
    lower, upper = limits_of(robot)
    np.testing.assert_allclose(lower, [-1, -1])
    np.testing.assert_allclose(upper, [np.radians(80), np.radians(80)])
    assert [joint.velocity for joint in limited_joints(robot)] == [4, 4]
    assert (robot.joints[0].lower, robot.joints[0].upper) == (-1, 2)


@pytest.mark.parametrize(
    ("old", "new", "key", "found"),
    [
        ('"right_hip", ratio', '"right_hipp", ratio', "mimic.joint", "there is no joint 'right_hipp'"),
        ('"right_hip", ratio', '"right_knee", ratio', "mimic.joint", "right_knee -> right_knee"),
        ("ratio = -0.5", "ratio = nan", "mimic.ratio", "nan"),
        ("ratio = -0.5", "rate = -0.5", "mimic.rate", "is unknown"),
        ('joint = "right_hip", ', "", "mimic.joint", "is missing"),
    ],
)
def test_a_faulty_coupling_is_told_with_its_place(old, new, key, found):
    fault = faults_of(changed(old, new, COUPLED))[0]
    assert (fault.row, fault.key) == ("[[joint]] 2 'right_knee'", key)
    assert found in fault.found


def test_joints_that_follow_one_another_are_told_once():
    circle = changed("upper = 2\n", 'upper = 2\nmimic = { joint = "right_knee" }\n', COUPLED)
    faults = [fault for fault in faults_of(circle) if fault.key == "mimic.joint"]
    assert [fault.found for fault in faults] == [
        "joints follow one another in a circle: right_hip -> right_knee -> right_hip"
    ]


def test_a_posture_names_leaders_only_within_what_the_coupling_leaves():
    fault = only_fault(changed("right_hip = 0.5,", "right_hip = 0.5, right_knee = 0,", COUPLED))
    assert (fault.key, fault.found) == ("q.right_knee", "is a coupled joint")
    fault = only_fault(changed("right_hip = 0.5,", "right_hip = 1.5,", COUPLED))
    assert fault.found == "1.5 lies outside [-1, 1.39626]"


def test_limits_that_leave_a_leader_no_position_are_told():
    faults = faults_of(changed(KNEE, "lower = 1.4\nupper = 1.5\n", MINI).replace(
        "upper = 1.5\n", 'upper = 1.5\nmimic = { joint = "right_hip", ratio = -1.0 }\n'
    ))  # fmt: skip
    assert faults[0].found == "leave 'right_hip' no position: right_knee = -right_hip"


def test_records_tables_pickles_and_copies_hold_the_same_couplings():
    robot = parse_robot(COUPLED + TOE)
    for again in (
        parse_robot(robot_toml(robot)),
        pickle.loads(pickle.dumps(robot)),  # noqa: S301
        copy.deepcopy(robot),
        Robot(**{name: getattr(robot, name) for name in robot.__getstate__()}),
    ):
        assert same_content(robot, again)


def test_records_with_faulty_couplings_are_refused():
    robot = parse_robot(COUPLED)
    with pytest.raises(TableError, match="there is no joint 'nobody'"):
        Robot(
            **{
                **robot.__getstate__(),
                "coupled": (CoupledJoint(**{**vars(robot.coupled[0]), "leader": "nobody"}), robot.coupled[1]),
            }
        )


def test_replaced_limits_of_a_coupled_joint_narrow_its_leader():
    robot = parse_robot(COUPLED).replace(limits={"right_knee": (0, 0.6)}, velocity={"right_knee": 1})
    np.testing.assert_allclose(limits_of(robot)[0][0], -2 * (0.6 - np.radians(20)))
    assert robot.joint("left_knee").upper == 0
    with pytest.raises(UnknownNameError):
        robot.replace(limits={"knee": (0, 1)})
    with pytest.raises(InputError):
        robot.replace(limits={"left_knee": (0, 0.1)})


def test_a_robot_shows_its_couplings():
    robot = parse_robot(COUPLED)
    assert "coupled: right_knee = -0.5 right_hip + 0.349066, left_knee = 0.5 left_hip - 0.349066" in repr(
        robot
    )
    assert "right_knee = -0.5 right_hip + 0.349066" in robot._repr_html_()
