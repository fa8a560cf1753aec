"""What a gait drives: limbs with more or fewer joints than their targets ask for, joints shared or idle."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from screwkin.errors import InputError, UnknownNameError
from screwkin.gait.driven import driven
from screwkin.gait.held import with_held_joints
from screwkin.model.records import Frame, Limb
from screwkin.model.robot import Inertia, Link, Robot
from screwkin.model.table import parse_robot
from screwkin.model.toml_out import robot_toml
from screwkin.model.values import COUPLINGS
from tests.cases.tables import NECK, WAIST_JOINT
from tests.laws.descriptions import mirrored


def with_arm_yaw(robot: Robot) -> Robot:
    """One more joint in each arm, about the upper arm, before the elbow."""
    joints, links, q = list(robot.joints), list(robot.links), list(robot.posture("home").q)
    for side in ("right", "left"):
        elbow = robot.joint(f"{side}_elbow")
        place = Pose(UNTURNED, elbow.screw.s0)
        links.append(Link(f"{side}_upper", 0, place.p, Inertia(0, 0, 0), place))
        yaw = replace(
            elbow,
            name=f"{side}_arm_yaw",
            child=f"{side}_upper",
            screw=replace(elbow.screw, s=Vector(0, 0, 1.0 if side == "left" else -1.0)),
        )
        joints[joints.index(elbow)] = replace(elbow, parent=f"{side}_upper")
        joints.append(yaw)
        q.append(0.0)
    return replace(
        robot,
        links=tuple(links),
        joints=tuple(joints),
        postures=(replace(robot.posture("home"), q=tuple(q)),),
    )


@pytest.mark.parametrize("name", ["bioloid", "bioloid24"])
def test_bodies_of_a_robot_with_held_joints_are_where_they_are_without_holding(name: str) -> None:
    robot = sk.load_robot(name)
    places = tuple(Frame(f"on_{link.name}", link.name, link.frame) for link in robot.links)
    robot = replace(robot, frames=places)
    rng = np.random.default_rng(1)
    q, names = rng.uniform(-1, 1, len(robot.joints)), ("right_hip_pitch", "left_elbow", "right_shoulder_roll")
    less = with_held_joints(robot, {n: q[robot.joint_names.index(n)] for n in names})
    left = [i for i, n in enumerate(robot.joint_names) if n not in names]
    one, two = sk.State(np.eye(4), q), sk.State(np.eye(4), q[left])
    for frame in (*robot.tip_names, *less.link_names, *(place.name for place in places)):
        np.testing.assert_allclose(
            sk.frame_pose(less, two, frame), sk.frame_pose(robot, one, frame), atol=1e-14
        )
    np.testing.assert_allclose(sk.center_of_mass(less, two), sk.center_of_mass(robot, one), atol=1e-14)
    kept = [*range(6), *(6 + i for i in left)]
    M = sk.mass_matrix(robot, one)[np.ix_(kept, kept)]
    np.testing.assert_allclose(sk.mass_matrix(less, two), M, atol=1e-14)


def test_a_robot_whose_joints_all_follow_is_driven_as_it_is() -> None:
    for name in ("bioloid", "bioloid24", "poppy12"):
        robot = sk.load_robot(name)
        assert driven(robot).moving is robot


@pytest.mark.parametrize(("text", "rests"), [(NECK, "neck"), (WAIST_JOINT, "waist_yaw")])
def test_idle_and_shared_joints_rest(text: str, rests: str) -> None:
    robot = parse_robot(text)
    assert set(robot.joint_names) - set(driven(robot).moving.joint_names) == {rests}


@pytest.mark.parametrize("name", ["bioloid", "bioloid24"])
def test_the_surplus_of_an_arm_rests_and_rates_are_slopes(name: str) -> None:
    robot = with_arm_yaw(sk.load_robot(name))
    drive = driven(robot)
    for limb in drive.moving.limbs[2:]:
        assert len(drive.moving.path_to(limb.link)) == 3
    walked = sk.walk(robot, sk.load_gait("walk").replace(rate=1000, Tc=0.5), steps=1)
    h = walked.time[1] - walked.time[0]
    slope = (walked.q[2:] - walked.q[:-2]) / (2 * h)
    assert np.quantile(np.abs(slope - walked.qd[1:-1]), 0.95) < 1e-3


def test_left_and_right_choose_the_same_joints() -> None:
    robot = with_arm_yaw(sk.load_robot("bioloid"))
    image, names = mirrored(robot)
    chosen = {names[name][0] for name in driven(robot).moving.joint_names}
    assert chosen == set(driven(image).moving.joint_names) == {n for n, _ in names.values() if n in chosen}
    sides = {name.removeprefix("right_") for name in chosen if name.startswith("right")}
    assert sides == {name.removeprefix("left_") for name in chosen if name.startswith("left")}


def test_an_arm_of_two_joints_rests_and_the_walk_says_so() -> None:
    short = with_held_joints(sk.load_robot("bioloid"), {"right_elbow": -0.7, "left_elbow": -0.7})
    walked = sk.walk(short, sk.load_gait("walk").replace(rate=10), steps=2)
    arms = [i for i, name in enumerate(walked.joint_names) if "shoulder" in name]
    assert np.ptp(walked.q[:, arms], axis=0).max() == 0
    assert "right_arm rests: fewer than 3 joints" in walked.meta["notes"][-2]


@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_limbs_that_are_neither_legs_nor_arms_change_no_walk(name: str) -> None:
    """A tip on every link of a leg, and one on the base's first neighbour: poses to ask for, and no more."""
    robot, gait = sk.load_robot(name), sk.load_gait("auto")
    more = tuple(
        Limb(f"{link.name}_limb", "other", link.name, f"{link.name}_tip", link.frame, COUPLINGS)
        for link in robot.links
        if link.name != robot.base_link and robot.leading(link.name)
    )
    seen = sk.robot_from_text(robot_toml(replace(robot, limbs=(*robot.limbs, *more))), name=name)
    assert {limb.kind for limb in seen.limbs} >= {"leg", "other"}
    walked, plain = (
        sk.walk(seen, gait.replace(rate=10), steps=1),
        sk.walk(robot, gait.replace(rate=10), steps=1),
    )
    np.testing.assert_allclose(walked.q, plain.q, rtol=0, atol=1e-12)
    at = sk.State(walked.T_world_base, walked.q)
    for limb in more:
        np.testing.assert_allclose(walked.T_world_tip[limb.tip], sk.frame_pose(seen, at, limb.tip), atol=1e-9)


def test_what_cannot_be_held_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="unknown joint 'tail'"):
        with_held_joints(sk.load_robot("bioloid"), {"tail": 0.0})
    with pytest.raises(InputError, match="has closures"):
        with_held_joints(
            sk.load_robot("linkages/four-bar"), {sk.load_robot("linkages/four-bar").joint_names[0]: 0.0}
        )


def test_what_is_driven_lasts_as_the_robot_does() -> None:
    """Else the programs of the moving joints would be recorded anew for every walk."""
    robot = with_arm_yaw(sk.load_robot("bioloid"))
    moving = driven(robot).moving
    assert moving is not robot
    assert driven(robot).moving is moving
    gone = weakref.ref(robot)
    del robot
    gc.collect()
    assert gone() is None


FINGERS = """
[[link]]
name = "right_thumb"
mass = 0.01
com = [0, -0.05, -0.02]
inertia = { box = [0.01, 0.01, 0.04] }

[[link]]
name = "right_finger"
mass = 0.01
com = [0, -0.08, -0.02]
inertia = { box = [0.01, 0.01, 0.04] }

[[joint]]
name = "right_thumb"
parent = "right_forearm"
child = "right_thumb"
type = "revolute"
s = [1, 0, 0]
s0 = [0, -0.05, 0]
lower = 0
upper = 0.8

[[joint]]
name = "right_finger"
parent = "right_forearm"
child = "right_finger"
type = "revolute"
s = [1, 0, 0]
s0 = [0, -0.08, 0]
mimic = { joint = "right_thumb", ratio = -1.0, offset = 0.1 }
"""


def test_coupled_joints_of_no_limb_rest_with_their_leaders():
    robot = sk.robot_from_text(sk.load_robot("bioloid").text + FINGERS)
    drive = driven(robot)
    assert not drive.moving.coupled
    assert drive.moving.joint_names == sk.load_robot("bioloid").joint_names
    assert float(drive.moving.mass) == pytest.approx(float(robot.mass), abs=1e-12)
    state, less = sk.home(robot), sk.home(drive.moving)
    coms = [sk.center_of_mass(one, here) for one, here in ((robot, state), (drive.moving, less))]
    np.testing.assert_allclose(*coms, atol=1e-12)


def test_a_joint_coupled_to_a_driven_one_stays_coupled_and_one_within_a_limb_holds_its_leader():
    text = sk.load_robot("bioloid").text + FINGERS
    led = sk.robot_from_text(text.replace('joint = "right_thumb", ratio', 'joint = "right_elbow", ratio'))
    assert [joint.leader for joint in driven(led).moving.coupled] == ["right_elbow", "left_elbow"]
    rows = sk.load_robot("bioloid").text.splitlines()
    rows = [row for row in rows if not row.startswith(("right_elbow =", "left_elbow ="))]
    at = next(i for i, row in enumerate(rows) if row.startswith('name = "right_elbow"'))
    robot = sk.robot_from_text(
        "\n".join([*rows[:at], 'mimic = { joint = "right_shoulder_roll" }', *rows[at:]])
    )
    assert "right_shoulder_roll" not in driven(robot).moving.joint_names
