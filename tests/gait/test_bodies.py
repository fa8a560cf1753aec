"""Whole bodies walk, whatever their joints: legs of four to seven, arms of any number, waists, necks."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from screwkin.errors import UnreachableError
from screwkin.gait.driven import driven
from screwkin.model.robot import Inertia, Joint, Link, Robot
from screwkin.model.table import parse_robot
from tests.bodies import LEG, SEVEN, humanoid

GAIT = sk.load_gait("walk").replace(
    rate=20, Tc=1.5, stride=0.1, waist_height=0.48, hand_drop=0.38, sway=1.9, lift=0.02
)
BODIES = {
    "six": {},
    "no yaw": {"leg": LEG[1:], "waist": "yaw"},
    "no ankle roll": {"leg": LEG[:-1]},
    "neither": {"leg": LEG[1:-1]},
    "seven": {"arm": SEVEN, "waist": "yaw"},
}


@cache
def robot_of(name: str) -> Robot:
    return parse_robot(humanoid(**BODIES[name]))


@cache
def walked(name: str) -> sk.Trajectory:
    return sk.walk(robot_of(name), GAIT, 2)


@pytest.mark.parametrize("name", BODIES)
def test_feet_stand_where_they_are_planned_and_rates_are_slopes(name: str) -> None:
    robot, walk = robot_of(name), walked(name)
    six = walked("six")
    for foot in walk.feet:
        np.testing.assert_allclose(
            walk.T_world_tip[foot][:, :3, 3], six.T_world_tip[foot][:, :3, 3], atol=1e-12
        )
        own = sk.frame_pose(robot, sk.State(walk.T_world_base, walk.q), foot)
        np.testing.assert_allclose(own, walk.T_world_tip[foot], atol=1e-9)
    h = walk.time[1] - walk.time[0]
    for value, rate in ((walk.q, walk.qd), (walk.qd, walk.qdd)):
        slope = (value[2:] - value[:-2]) / (2 * h)
        assert np.quantile(np.abs(slope - rate[1:-1]), 0.9) < 0.03 * max(1.0, np.abs(rate).max())


@pytest.mark.parametrize("name", ["six", "no yaw", "seven"])
def test_robots_with_level_soles_keep_their_balance(name: str) -> None:
    assert walked(name).margin.min() > 0.005
    assert np.ptp(walked(name).q[:, robot_of(name).joint_names.index("right_elbow_pitch")]) > 0.01


@pytest.mark.parametrize("name", ["no ankle roll", "neither"])
def test_a_sole_that_leans_is_told_and_stands_on_its_edge(name: str) -> None:
    walk = walked(name)
    lean = np.degrees(np.arcsin(np.abs(walk.T_world_tip["right_foot"][:, 2, 1]).max()))
    remark = next(
        note for note in walk.meta["notes"] if note.startswith("right_foot leans sideways by up to")
    )
    assert float(re.findall(r"[\d.]+", remark)[0]) == pytest.approx(lean, rel=0.06)
    assert walk.margin.min() < 0
    np.testing.assert_allclose(sk.zmp(robot_of(name), walk).margin, walk.margin, atol=1e-9)


def test_a_leg_without_yaw_names_what_a_turn_needs() -> None:
    turning = GAIT.replace(turn=0.2)
    with pytest.raises(
        UnreachableError, match=r"no joint of right_leg .* a turn needs one.* set turn = 0 \(now 0\.2"
    ):
        sk.walk(robot_of("no yaw"), turning, 2)
    assert sk.walk(robot_of("no ankle roll"), turning, 2).samples


def test_arms_of_seven_joints_swing_alike_in_every_process() -> None:
    again = sk.walk(parse_robot(humanoid(**BODIES["seven"])), GAIT, 2)
    np.testing.assert_array_equal(again.q, walked("seven").q)


def test_the_toe_of_a_leg_of_seven_joints_rests_and_a_joint_at_its_limit_does_not_lead_an_arm() -> None:
    robot = parse_robot(humanoid((*LEG, "toe_pitch"), SEVEN))
    resting = set(robot.joint_names) - set(driven(robot).moving.joint_names)
    assert {"right_toe_pitch", "left_toe_pitch"} < resting
    arm = [name for name in driven(robot).moving.joint_names if name.startswith("right_sh")]
    stuck = tuple(replace(j, lower=0.0) if j.name == "right_shoulder_roll" else j for j in robot.joints)
    moving = driven(replace(robot, joints=stuck, text="")).moving.joint_names
    assert "right_shoulder_roll" in arm
    assert "right_shoulder_roll" not in moving
    assert (
        sum("right" in name and ("shoulder" in name or "elbow" in name or "wrist" in name) for name in moving)
        == 3
    )


PLACES = {
    "neck": "torso",
    "gripper": "right_forearm",
    "toe": "left_foot_link",
    "wheel": "right_calf",
}
PLAIN = sk.load_gait("turn").replace(rate=8)


def with_joint(robot: Robot, parent: str, below: tuple[str, ...] = (), kind: str = "revolute") -> Robot:
    """The robot with a massless link on a joint of its own; ``below`` names joints that then stand on it."""
    s0, s = Vector(0.01, 0.02, 0.03), Vector(0.6, 0.0, 0.8)
    screw = Screw(s, s0) if kind == "revolute" else Screw(s, s0, INFINITE)
    added = Joint("added", parent, "added_link", kind, screw, -1.0, 1.0, 5.0, 5.0)
    joints = tuple(replace(j, parent="added_link") if j.name in below else j for j in robot.joints)
    link = Link("added_link", 0.0, s0, Inertia(0, 0, 0), Pose(UNTURNED, s0))
    postures = tuple(replace(p, q=(*p.q, 0.0)) for p in robot.postures)
    return replace(robot, links=(*robot.links, link), joints=(*joints, added), postures=postures, text="")


@cache
def plain() -> sk.Trajectory:
    return sk.walk(sk.load_robot("bioloid"), PLAIN, 1)


@pytest.mark.parametrize(
    ("place", "kind"), [*((place, "revolute") for place in PLACES), ("gripper", "prismatic")]
)
def test_a_joint_that_no_limb_needs_rests_wherever_it_is(place: str, kind: str) -> None:
    walk = sk.walk(with_joint(sk.load_robot("bioloid"), PLACES[place], kind=kind), PLAIN, 1)
    assert not walk.q[:, -1].any()
    assert not walk.qd[:, -1].any()
    for field in ("q", "qd", "qdd"):
        np.testing.assert_allclose(getattr(walk, field)[:, :-1], getattr(plain(), field), atol=1e-11)
    np.testing.assert_allclose(walk.zmp, plain().zmp, atol=1e-12)


@pytest.mark.parametrize("limb", ["hip_yaw", "shoulder_pitch"])
def test_a_joint_below_both_legs_or_both_arms_rests(limb: str) -> None:
    below = tuple(f"{side}_{limb}" for side in ("right", "left"))
    walk = sk.walk(with_joint(sk.load_robot("bioloid"), "torso", below), PLAIN, 1)
    np.testing.assert_allclose(walk.q[:, :-1], plain().q, atol=1e-11)
    assert not walk.qdd[:, -1].any()


def test_a_whole_body_is_confirmed_as_far_as_perfect_tracking_goes() -> None:
    check = sk.validate(robot_of("no yaw"), walked("no yaw"), "kinematic")
    assert check.reasons == ("engine kinematic simulates no forces and confirms nothing; use mujoco",)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["no yaw", "seven"])
@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_whole_bodies_walk_in_both_engines(name: str, engine: str) -> None:
    pytest.importorskip(engine)
    walk = sk.walk(robot_of(name), GAIT.replace(rate=50), 2)
    assert sk.validate(robot_of(name), walk, engine).passed  # type: ignore[arg-type]
