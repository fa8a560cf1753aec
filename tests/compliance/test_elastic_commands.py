"""Commands that undo what joints and links bend: an independent equilibrium stands where it was asked."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings

import screwkin as sk
from screwkin.algebra.se3 import exp, twist_from_array
from screwkin.compliance.elastic_commands import ElasticCommands
from screwkin.errors import InputError, LimitError, SingularError, UnknownNameError
from screwkin.model.records import LinkSpring
from screwkin.model.robot import Robot
from tests.compliance.elastic_robots import random_case
from tests.compliance.test_passive import arm, at
from tests.kinematics.machines import array_of, seeds


def settled(robot: Robot, told: ElasticCommands, bent: sk.Deflection, frame: str) -> np.ndarray:
    """Where a frame stands under commands: its commanded pose, and what the deflection changes there."""
    bent.raise_on_failure()
    commanded, change = sk.frame_pose(robot, told.state, frame), bent.of(frame)
    turn = array_of(exp(twist_from_array(np.concatenate([change[:3], np.zeros(3)]))))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn[:3, :3] @ commanded[:3, :3], commanded[:3, 3] + change[3:]
    return pose


@given(seed=seeds)
@settings(max_examples=1, deadline=None)
def test_a_random_arm_of_bending_links_settles_where_it_was_asked(seed: int) -> None:
    """Seven joints between the ends; forces, an effort and a hardening spring."""
    case = random_case(seed, branching=False)
    robot, wanted = case.robot, case.state.T_world_base
    options = {"stiffness": case.stiffness, **case.options}
    told = sk.elastic_commands(robot, case.state, case.support, ["base"], **options)
    bent = sk.static_deflection(robot, told.state, case.support, **options)
    found = settled(robot, told, bent, "base")
    assert np.abs(told.state.q - case.state.q).max() > 1e-4
    if told.residual < 1e-9:
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)
    left = told.apart[0]
    turned = array_of(exp(twist_from_array(np.concatenate([left[:3], np.zeros(3)]))))[:3, :3]
    np.testing.assert_allclose(turned @ found[:3, :3], wanted[:3, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[:3, 3] + left[3:], wanted[:3, 3], rtol=0, atol=1e-9)


@cache
def bending_biped() -> Robot:
    """The Bioloid on thighs and shins of some 2000 N m/rad and 1e6 N/m."""
    robot = sk.load_robot("bioloid")
    links = []
    for link in robot.links:
        if link.name.endswith(("_thigh", "_shin")):
            K = tuple(map(tuple, np.diag([20.0, 20, 20, 1e5, 1e5, 1e5]).tolist()))
            link = replace(link, spring=LinkSpring(link.com, link.com, K))
        links.append(link)
    return replace(robot, links=tuple(links), text="", path="")


def test_a_humanoid_on_one_foot_holds_its_base_its_other_foot_and_its_hands() -> None:
    """Hands on three joints keep their places only."""
    robot, home = bending_biped(), sk.home(sk.load_robot("bioloid"))
    hands, load = ["right_hand", "left_hand"], {"left_hand": [0, 0, -0.5]}
    options = {"stiffness": 20.0, "loads": load}
    told = sk.elastic_commands(robot, home, "right_foot", points=hands, **options)
    assert told.frames == ("base", "left_foot", "right_hand", "left_hand")
    assert told.residual < 1e-11
    bent = sk.static_deflection(robot, told.state, "right_foot", **options)
    for frame in told.frames:
        pose, wanted = settled(robot, told, bent, frame), sk.frame_pose(robot, home, frame)
        np.testing.assert_allclose(pose[:3, 3], wanted[:3, 3], rtol=0, atol=1e-9)
        if frame not in hands:
            np.testing.assert_allclose(pose, wanted, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        sk.frame_pose(robot, told.state, "right_foot"), sk.frame_pose(robot, home, "right_foot"), atol=1e-12
    )


def test_joints_alone_are_commanded_as_compensate_says() -> None:
    """Rigid links, one foot: efforts of the wanted posture by Davies' statics."""
    robot = sk.load_robot("bioloid")
    home = sk.home(robot)
    leg = [name for name in robot.joint_names if name.startswith("right_") and "shoulder" not in name]
    told = sk.elastic_commands(robot, home, "right_foot", ["base"], 20.0)
    forces = sk.static_forces(sk.closed_mechanism(robot), home, weights=True, contacts=["right_foot"])
    held = np.array([forces.efforts[name] for name in robot.joint_names])
    commands = sk.compensate(robot, home, held, 20.0)
    own = [robot.joint_names.index(name) for name in leg if "elbow" not in name]
    np.testing.assert_allclose(told.state.q[own], commands[own], rtol=0, atol=1e-4)


@pytest.mark.slow
def test_two_feet_and_a_batch_of_loads() -> None:
    """On both feet base and feet stay; every sample by itself."""
    robot, home = bending_biped(), sk.home(sk.load_robot("bioloid"))
    push = np.array([[3.0, 0, 0], [0, 0, -5.0]])
    feet = ["right_foot", "left_foot"]
    told = sk.elastic_commands(robot, home, feet, ["base"], 20.0, loads={"base": push})
    assert told.residual.max() < 1e-11
    one = sk.elastic_commands(robot, home, feet, ["base"], 20.0, loads={"base": push[1]})
    np.testing.assert_allclose(one.state.q, told.state.q[1], rtol=0, atol=1e-10)


def test_what_joints_cannot_undo_is_named() -> None:
    """A bar that slides along itself and bends across: its slide undoes nothing of the sag."""
    from tests.compliance.test_links import AT_REST, beam

    bar = beam()
    told = sk.elastic_commands(bar, AT_REST, "base", ["right_end"], 1e7)
    bent = sk.static_deflection(bar, AT_REST, "base", 1e7)
    np.testing.assert_allclose(told.apart[0], -bent.of("right_end"), rtol=1e-3, atol=1e-9)
    assert told.residual == pytest.approx(np.abs(bent.of("right_end")).max(), rel=1e-3)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"frames": ["nose"]}, UnknownNameError, "nose"),
        ({"frames": ["right_foot"]}, InputError, "right_foot is a support, which stands still by itself"),
        ({"frames": []}, InputError, "name one that shall settle as asked"),
        ({"frames": ["base", "base"]}, InputError, "each once"),
        ({"frames": ["base"], "points": ["left_hand"]}, InputError, "points names left_hand, none of"),
    ],
)
def test_bad_questions_are_refused(options, error, message) -> None:
    robot = sk.load_robot("bioloid")
    with pytest.raises(error, match=message):
        sk.elastic_commands(robot, sk.home(robot), "right_foot", **{"stiffness": 20.0, **options})


def test_a_command_beyond_a_limit_is_refused() -> None:
    """The joint that goes farthest beyond its place at home may not."""
    robot = sk.load_robot("bioloid")
    home = sk.home(robot)
    told = sk.elastic_commands(robot, home, "right_foot", ["base"], 20.0).state.q
    beyond = np.abs(told) - np.abs(home.q)
    k = int(np.where(np.abs(home.q) > 0.1, beyond, 0).argmax())
    least, most = sorted((0.0, float(home.q[k]) + 1e-3 * np.sign(home.q[k])))
    joints = list(robot.joints)
    joints[k] = replace(joints[k], lower=least, upper=most)
    narrow = replace(robot, joints=tuple(joints), text="", path="")
    with pytest.raises(LimitError, match=f"{joints[k].name} would be commanded to .*, beyond its limits"):
        sk.elastic_commands(narrow, home, "right_foot", ["base"], 20.0)


def test_what_moves_freely_is_refused() -> None:
    with pytest.raises(SingularError, match="moves freely in some direction"):
        sk.elastic_commands(
            arm(free=True), at(0.1, 0.2), "base", ["hand"], {"elbow": 5.0}, gravity=0, loads={"elbow": 0.1}
        )


def test_a_loaded_crank_is_commanded_by_what_davies_method_says_it_bears() -> None:
    """10 mN m on the rocker of a four-bar: 2.4088 mN m at the crank, undone by so much over its stiffness."""
    robot = sk.load_robot("linkages/four-bar")
    home, load = sk.home(robot), {"rocker": 0.01}
    told = sk.elastic_commands(robot, home, "base", ["rocker"], 50.0, 0.0, loads=load)
    bent = sk.static_deflection(robot, told.state, "base", 50.0, gravity=0, loads=load)
    np.testing.assert_allclose(bent.state.q, home.q, rtol=0, atol=1e-12)
    crank = robot.joint_names.index("crank")
    forces = sk.static_forces(sk.closed_mechanism(robot), home, load)
    assert told.state.q[crank] - home.q[crank] == pytest.approx(float(forces["crank"]) / 50, rel=1e-9)
