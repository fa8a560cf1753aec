"""Loads, free joints, loops and laws of springs, by hand calculation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import screwkin as sk
from screwkin.compliance.cartesian import cartesian_compliance, cartesian_stiffness
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import (
    InputError,
    LimitError,
    NoSolutionError,
    ShapeError,
    SingularError,
    UnknownNameError,
)
from tests.held import on_both_feet

ARM = """
[robot]
name = "arm"
base_link = "wall"
base = "fixed"
[[link]]
name = "wall"
mass = 0
[[link]]
name = "upper"
mass = 0
[[link]]
name = "lower"
mass = 0
[[joint]]
name = "shoulder"
parent = "wall"
child = "upper"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, 0]
FREE
[[joint]]
name = "elbow"
parent = "upper"
child = "lower"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, 0.4]
[[limb]]
name = "arm"
kind = "arm"
link = "lower"
tip = "hand"
frame = { xyz = [0, 0, 0.7] }
"""


def arm(free: bool = False) -> sk.Robot:
    """Two bars of 0.4 and 0.3 m, upwards along z."""
    return sk.robot_from_text(ARM.replace("FREE", "passive = true" if free else ""))


def at(*q: float) -> sk.State:
    return sk.State(np.eye(4), np.array(q))


def yielding(robot, state, **options):
    deflection = static_deflection(robot, state, "base", **options)
    deflection.raise_on_failure()
    return deflection


def test_a_column_under_a_weight_is_softer_by_its_moment_and_falls_where_that_is_all():
    """Euler's column on a hinge: k - f L; the elbow is so stiff that the arm is one bar."""
    k = {"shoulder": 70.0, "elbow": 1e9}
    for f in (0.0, 40.0, 90.0):
        C = cartesian_compliance(arm(), at(0, 0), "base", "hand", k, loads={"hand": [0, 0, -f]})
        assert C[3, 3] == pytest.approx(0.7**2 / (70 - 0.7 * f) + 0.3**2 / 1e9, rel=1e-6)
    with pytest.raises(SingularError, match="unstable"):
        cartesian_compliance(arm(), at(0, 0), "base", "hand", k, loads={"hand": [0, 0, -101.0]})
    fallen = static_deflection(arm(), at(0, 0), "base", k, loads={"hand": [0, 0, -101.0]})
    assert fallen.converged
    assert not fallen.stable
    with pytest.raises(NoSolutionError, match="weight and loads"):
        fallen.raise_on_failure()


def test_a_sideways_force_turns_the_bar_by_the_textbooks_equation():
    """k a = f L cos(a), pushed along x."""
    k = {"shoulder": 20.0, "elbow": 1e9}
    bent = yielding(arm(), at(0, 0), stiffness=k, loads={"hand": [30.0, 0, 0]})
    assert bent.theta[0] == pytest.approx(brentq(lambda a: 20 * a - 21 * math.cos(a), 0, 1.5), abs=1e-7)
    np.testing.assert_allclose(bent.wrenches[0, 3:], [-30, 0, 0], rtol=0, atol=1e-12)


def test_a_moment_and_an_effort_turn_their_joints_by_themselves():
    """A moment about the axis has no arm: theta = m / k at every joint below it."""
    k = {"shoulder": 20.0, "elbow": 50.0}
    bent = yielding(arm(), at(0.3, 0.4), stiffness=k, loads={"hand": [0, 2.0, 0, 0, 0, 0]})
    np.testing.assert_allclose(bent.theta, [0.1, 0.04], rtol=0, atol=1e-12)
    bent = yielding(arm(), at(0.3, 0.4), stiffness=k, loads={"elbow": 2.0})
    np.testing.assert_allclose(bent.theta, [0, 0.04], rtol=0, atol=1e-12)
    np.testing.assert_allclose(bent.torque, [0, -2.0], rtol=0, atol=1e-12)


def test_a_free_joint_swings_until_its_bar_points_along_the_force():
    """Passive shoulder, no spring: pulled along x, hand and shoulder are in line with it."""
    bent = yielding(arm(free=True), at(1.0, 0.6), stiffness=30.0, loads={"hand": [5.0, 0, 0]})
    hand = sk.frame_pose(arm(), bent.state, "hand")[:3, 3]
    np.testing.assert_allclose(hand[[1, 2]], 0, rtol=0, atol=1e-10)
    assert hand[0] > 0.5
    loose = static_deflection(
        arm(free=True), at(1.0, 0.6), "base", 30.0, gravity=0, loads={"upper": [0, 0, 0]}
    )
    assert loose.converged
    assert not loose.stable


def test_a_free_joint_leaves_its_frame_no_stiffness_where_it_turns():
    """The compliance is infinite, the stiffness is not: 0 across the line through the free hinge."""
    state, robot, shoulder = at(0.7, 0.9), arm(free=True), {"elbow": 30.0}
    with pytest.raises(SingularError, match="moves freely"):
        cartesian_compliance(robot, state, "base", "hand", shoulder, gravity=0)
    with pytest.raises(SingularError, match="rigid in some direction"):
        cartesian_stiffness(robot, state, "base", "hand", shoulder, gravity=0)
    sprung = cartesian_compliance(robot, state, "base", "hand", {**shoulder, "shoulder": 60.0}, gravity=0)
    assert sprung[4, 4] == 0
    with pytest.raises(InputError, match="stiffness of shoulder is -1"):
        static_deflection(robot, state, "base", {"shoulder": -1, "elbow": 2}, loads={"hand": [1, 0, 0]})
    with pytest.raises(InputError, match="stiffness of elbow is 0"):
        static_deflection(robot, state, "base", {"elbow": 0}, loads={"hand": [1, 0, 0]})


def test_a_spatial_chain_with_a_free_joint_yields_freely_about_it_and_as_the_rest_elsewhere():
    """K S = 0 for the screw S of the free joint; each other joint's screw is resisted by its own spring."""
    robot = sk.load_robot("poppy12")
    free = tuple(replace(j, passive=True) if j.name == "left_hip_pitch" else j for j in robot.joints)
    robot = replace(robot, joints=free)
    home = sk.home(robot)
    state = sk.State(home.T_world_base, home.q + np.linspace(0.1, 0.3, 12))
    K = cartesian_stiffness(robot, state, "base", "left_foot", 60.0, gravity=0)
    i = robot.joint_names.index("left_hip_pitch")
    S = sk.jacobian(robot, state, "left_foot")[:, 6 + i]
    np.testing.assert_allclose(K @ S, 0, rtol=0, atol=1e-7)
    np.testing.assert_allclose(K, K.T, rtol=0, atol=1e-8)
    values = np.linalg.eigvalsh(K)
    assert abs(values[0]) < 1e-9 * values[-1] < values[1]
    J = np.delete(sk.jacobian(robot, state, "left_foot")[:, 6:][:, :6], i % 6, axis=1)
    np.testing.assert_allclose(J.T @ K @ J, 60 * np.eye(5), rtol=0, atol=1e-7)


def test_a_loaded_four_bar_turns_its_spring_by_what_davies_method_says_it_bears():
    """10 N m on the rocker: -2.4088 N m at the crank; its drive yields by so much over its stiffness."""
    robot = sk.load_robot("linkages/four-bar")
    home = sk.home(robot)
    little = 1e-5  # so little that the posture stays
    bent = static_deflection(robot, home, "base", 50.0, loads={"rocker": 10.0 * little}, gravity=0)
    bent.raise_on_failure()
    i = robot.joint_names.index("crank")
    forces = sk.static_forces(sk.closed_mechanism(robot), home, {"rocker": 10.0})
    assert bent.torque[i] / little == pytest.approx(float(forces["crank"]), rel=1e-5)
    assert bent.theta[i] == pytest.approx(2.4088e-5 / 50, rel=1e-4)
    closed = sk.close_loops(sk.closed_mechanism(robot), bent.state, {"crank": float(bent.state.q[i])})
    np.testing.assert_allclose(bent.state.q, closed.state.q, rtol=0, atol=1e-11)


def test_a_far_turned_four_bar_rests_where_its_energy_is_least():
    robot = sk.load_robot("linkages/four-bar")
    mechanism, home, k = sk.closed_mechanism(robot), sk.home(robot), 3.0
    bent = yielding(robot, home, stiffness=k, loads={"rocker": 6.0}, gravity=0)
    i, j = (robot.joint_names.index(name) for name in ("crank", "rocker"))
    assert abs(bent.theta[i]) > 0.1

    def slope(turn):
        q = [
            sk.close_loops(mechanism, bent.state, {"crank": home.q[i] + turn + h}).state.q[j]
            for h in (1e-4, -1e-4)
        ]
        return k * turn - 6.0 * float(q[0] - q[1]) / 2e-4

    assert slope(bent.theta[i]) == pytest.approx(0, abs=1e-6)


def test_feet_that_a_table_holds_on_the_floor_are_supports():
    """Closures with the floor in place of two names: the same rest, the same wrench of the ground."""
    free = sk.load_robot("bioloid")
    held, home = on_both_feet(), sk.home(free)
    push = {"base": [5.0, 3.0, -10.0]}
    two = static_deflection(free, home, ["right_foot", "left_foot"], 20.0, loads=push)
    by_table = static_deflection(held, home, "right_foot", 20.0, loads=push)
    np.testing.assert_allclose(by_table.theta, two.theta, rtol=0, atol=1e-11)
    np.testing.assert_allclose(by_table.wrenches[0], two.wrenches[0], rtol=0, atol=1e-8)
    assert np.abs(two.wrenches[1]).max() > 1


def test_springs_by_tables_and_functions_yield_alike_and_tables_end():
    """Soft, then hard: f L = 0.6 N m lies on the second line; a cubic by its own equation."""
    table = [(-0.02, -1.1), (-0.01, -0.1), (0, 0), (0.01, 0.1), (0.02, 1.1)]
    k = {"elbow": 1e9}
    push = {"shoulder": 0.6}
    bent = yielding(arm(), at(0, 0), stiffness=k, springs={"shoulder": table}, loads=push)
    assert bent.theta[0] == pytest.approx(0.015, abs=1e-12)
    assert bent.torque[0] == pytest.approx(-0.6, abs=1e-12)
    cubic = yielding(
        arm(),
        at(0, 0),
        stiffness=k,
        loads=push,
        springs={"shoulder": lambda x: (10 * x + x**3, 10 + 3 * x**2)},
    )
    assert cubic.theta[0] == pytest.approx(brentq(lambda x: 10 * x + x**3 - 0.6, 0, 1), abs=1e-11)
    with pytest.raises(
        LimitError, match=r"shoulder yields by .*, and its spring's table ends at -0.02 and 0.02"
    ):
        static_deflection(arm(), at(0, 0), "base", k, springs={"shoulder": table}, loads={"shoulder": 2.0})


def test_a_stiffness_that_changes_with_time_has_a_number_for_each_sample():
    time = np.linspace(0, 1, 5)
    k = {"shoulder": 20 + 10 * time, "elbow": 30.0}
    bent = static_deflection(arm(), at(0, 0), "base", k, loads={"shoulder": 1.0})
    np.testing.assert_allclose(bent.theta[:, 0], 1 / k["shoulder"], rtol=1e-12)
    commands = sk.compensate(arm(), at(0, 0), np.array([1.0, 0]), k)
    np.testing.assert_allclose(commands[:, 0], 1 / k["shoulder"], rtol=1e-12)
    with pytest.raises(ShapeError, match="do not broadcast"):
        static_deflection(arm(), sk.State(np.eye(4), np.zeros((4, 2))), "base", k, loads={"shoulder": 1.0})


def test_commands_undo_what_a_curved_spring_yields_and_leave_free_joints():
    law = {"elbow": lambda x: (10 * x + 500 * x**3, 10 + 1500 * x**2)}
    effort = np.array([[0.0, 2.0], [0.0, -1.0]])
    commands = sk.compensate(arm(free=True), at(0.1, 0.2), effort, springs=law)
    bent = law["elbow"](commands[:, 1] - 0.2)[0]
    np.testing.assert_allclose(bent, effort[:, 1], rtol=0, atol=1e-10)
    np.testing.assert_array_equal(commands[:, 0], 0.1)
    with pytest.raises(
        NoSolutionError, match="elbow carries 3, and its spring's function does not rise to it"
    ):
        sk.compensate(arm(), at(0, 0), [0, 3.0], 5.0, {"elbow": lambda x: (np.tanh(x), 1 / np.cosh(x) ** 2)})


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"loads": {"foot": [1, 0, 0]}}, UnknownNameError, "foot"),
        ({"loads": {"hand": [1, 0]}}, ShapeError, "give a force of three numbers, or a wrench of six"),
        ({"loads": {"hand": [1, 0, np.nan]}}, ShapeError, "NaN"),
        ({"loads": {"shoulder": 1}, "springs": {"wrist": [(0, 0), (1, 1)]}}, UnknownNameError, "wrist"),
        ({"loads": {"shoulder": 1}, "springs": {"elbow": [(0, 0), (1, 0)]}}, InputError, "must increase"),
        ({"loads": {"shoulder": 1}, "support": []}, InputError, "name one frame that stands still"),
        ({"loads": {"shoulder": 1}, "support": ["base", "base"]}, InputError, "each once"),
        ({"loads": {"shoulder": 1}, "support": ["base", "foot"]}, UnknownNameError, "foot"),
        ({}, InputError, "no mass and no loads"),
    ],
)
def test_bad_input_is_refused(options, error, message):
    with pytest.raises(error, match=message):
        static_deflection(arm(), at(0, 0), **{"support": "base", "stiffness": 5.0, **options})
