"""Elastic joints against energy, Newton-Euler, the paper's two chains, a textbook pendulum and PyBullet."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.algebra.se3 import as_array, pose_from_array, unstack
from screwkin.compliance.cartesian import cartesian_compliance, cartesian_stiffness
from screwkin.compliance.springs import joint_stiffness
from screwkin.compliance.stiffness import static_deflection
from screwkin.compliance.supported import Supported
from screwkin.errors import InputError, NoSolutionError, ShapeError, SingularError, UnknownNameError
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot
from tests.kinematics.machines import random_tree

PENDULUM = """
[robot]
name = "pendulum"
base_link = "wall"
base = "fixed"
[[link]]
name = "wall"
mass = 0
[[link]]
name = "bob"
mass = 2
com = [{com}]
inertia = {{ box = [0.1, 0.1, 0.1] }}
[[joint]]
name = "hinge"
parent = "wall"
child = "bob"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, 0]
"""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("poppy12")


@pytest.fixture(scope="module")
def stepping(robot) -> sk.State:
    """Home with the left leg lifted, spread and turned: all joints carry something."""
    q = sk.home(robot).q + np.radians([8, 15, -20, 30, -5, 6, -4, 3, 2, -3, 2, 5])
    return sk.State(sk.home(robot).T_world_base, q)


def energy(robot: Robot, support: str, stand, q_commanded, theta, k) -> float:
    """Of springs and weight, the support held; told by whole-body positions alone."""
    q = q_commanded + theta
    free = sk.State(np.eye(4), q)
    T = stand @ np.linalg.inv(sk.frame_pose(robot, free, support))
    height = sk.center_of_mass(robot, sk.State(T, q))[2]
    return float(0.5 * (k * theta**2).sum() + robot.mass * GRAVITY * height)


def gradient(function, x, step=1e-5):
    """By central differences of fourth order."""
    slopes = []
    for e in np.eye(len(x)) * step:
        near, far = function(x + e) - function(x - e), function(x + 2 * e) - function(x - 2 * e)
        slopes.append((8 * near - far) / (12 * step))
    return np.array(slopes)


def test_the_linear_torques_are_those_of_newton_euler_with_the_ground_under_one_foot(robot, stepping):
    T = stepping.T_world_base
    for foot in robot.tip_names:
        wrench_and_torque = sk.inverse_dynamics(robot, stepping, np.zeros(12), np.zeros(12))
        J = sk.jacobian(robot, stepping, foot, point=T[:3, 3])
        carried = wrench_and_torque[6:] - J[:, 6:].T @ wrench_and_torque[:6]
        yielded = static_deflection(robot, stepping, foot, 60.0, "linear")
        np.testing.assert_allclose(yielded.torque, carried, rtol=0, atol=1e-14)
        np.testing.assert_allclose(yielded.theta, -carried / 60, rtol=0, atol=1e-16)


@pytest.mark.parametrize("method", ["linear", "nonlinear"])
def test_the_support_stands_still_and_the_deflected_state_is_where_change_says(robot, stepping, method):
    yielded = static_deflection(robot, stepping, "right_foot", 4000.0, method)
    before = sk.frame_pose(robot, stepping, "right_foot")
    np.testing.assert_allclose(sk.frame_pose(robot, yielded.state, "right_foot"), before, rtol=0, atol=1e-14)
    np.testing.assert_allclose(yielded.of("right_foot"), 0, rtol=0, atol=1e-14)
    for frame in ("base", "left_foot"):
        A, B = sk.frame_pose(robot, stepping, frame), sk.frame_pose(robot, yielded.state, frame)
        moved = [*Rotation.from_matrix(B[:3, :3] @ A[:3, :3].T).as_rotvec(), *(B[:3, 3] - A[:3, 3])]
        exact = 1e-13 if method == "nonlinear" else 1e-7
        np.testing.assert_allclose(yielded.of(frame), moved, rtol=0, atol=exact)
        assert np.abs(moved).max() > 1e-5


@pytest.mark.parametrize("seed", range(6))
def test_equilibrium_is_where_the_energy_of_springs_and_weight_is_stationary(seed):
    """Random trees with prismatic and helical joints, turned bases, any link as support."""
    tree = replace(random_tree(seed), closures=())
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    state = sk.State(T, rng.uniform(-1, 1, len(tree.joints)))
    k = rng.uniform(300, 600, len(tree.joints))
    support = str(rng.choice(tree.link_names))
    by_name = dict(zip(tree.joint_names, k, strict=True))
    yielded = static_deflection(tree, state, support, by_name)
    assert yielded.converged
    assert np.abs(yielded.theta).max() > 1e-4
    stand = sk.frame_pose(tree, state, support)
    slope = gradient(lambda theta: energy(tree, support, stand, state.q, theta, k), yielded.theta)
    np.testing.assert_allclose(slope, 0, rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_the_stiffness_of_gravity_is_the_slope_of_its_torques(seed):
    tree = random_tree(seed)
    rng = np.random.default_rng(seed)
    stand = pose_from_array(sk.link_poses(tree, sk.State(np.eye(4), np.zeros(len(tree.joints))))[-1])
    support = tree.link_names[-1]

    def torques(q):
        return np.array(Supported.of(tree, support, stand, unstack(q)).gravity_torques(9.81), dtype=float)

    q = rng.uniform(-1, 1, len(tree.joints))
    told = Supported.of(tree, support, stand, unstack(q)).gravity_stiffness(9.81)
    hessian = np.zeros((len(q), len(q)))
    for (i, j), value in told.items():
        hessian[i, j] = hessian[j, i] = value
    np.testing.assert_allclose(hessian, gradient(torques, q), rtol=0, atol=1e-8)


def test_linear_and_nonlinear_meet_as_one_over_the_square_of_the_stiffness(robot, stepping):
    def gap(k):
        linear, full = (
            static_deflection(robot, stepping, "right_foot", k, m) for m in ("linear", "nonlinear")
        )
        return np.abs(linear.of("left_foot") - full.of("left_foot")).max()

    gaps = np.array([gap(k) for k in (250.0, 500.0, 1000.0, 2000.0)])
    np.testing.assert_allclose(gaps[:-1] / gaps[1:], 4, rtol=0.05)


def test_the_papers_two_chains_give_the_same_deflection_only_with_the_swing_legs_moment(robot, stepping):
    """Stance chain loaded at the pelvis by pelvis and swing leg; swing chain by its links; combined."""
    k, tip = 60.0, "left_foot"
    T, poses = stepping.T_world_base, sk.link_poses(robot, stepping)
    J_stance = sk.jacobian(robot, stepping, "right_foot", point=T[:3, 3])[:, 6:]
    weights = {
        link.name: (sk.frame_pose(robot, stepping, link.name), link) for link in robot.links if link.mass
    }

    def load(names, with_moment=True):
        """Wrench of some links' weights, told at the waist."""
        m, f = np.zeros(3), np.zeros(3)
        for name in names:
            link = weights[name][1]
            A = poses[robot.link_names.index(name)] @ np.linalg.inv(as_array(link.frame))
            c = A[:3, :3] @ as_array(link.com) + A[:3, 3]
            down = np.array([0, 0, -link.mass * GRAVITY])
            f += down
            m += np.cross(c - T[:3, 3], down) if with_moment or name == "pelvis" else 0
        return np.r_[m, f]

    def node_torques(prefix):
        """Power of a leg's weights on its own joints."""
        bare = replace(
            robot, links=tuple(x if x.name.startswith(prefix) else weightless(x) for x in robot.links)
        )
        return -sk.inverse_dynamics(bare, stepping, np.zeros(12), np.zeros(12))[6:]

    def weightless(link):
        return replace(link, mass=0 if link.name != "pelvis" else 1e-12)

    swing = ["left_thigh", "left_shin", "left_foot_link", "pelvis"]
    stance = ["right_thigh", "right_shin", "right_foot_link"]
    right = np.array([name.startswith("right") for name in robot.joint_names])

    def deflection(with_moment):
        # The pelvis moves by -J_stance theta, so a load F on it turns the stance joints by -J_stance^T F.
        # The stance leg's own links move with the pelvis and against it.
        own = node_torques("right") - J_stance.T @ load(stance)
        theta = np.where(right, own - J_stance.T @ load(swing, with_moment), node_torques("left")) / k
        pelvis = -J_stance @ np.where(right, theta, 0)
        out = sk.frame_pose(robot, stepping, tip)[:3, 3] - T[:3, 3]
        carried = np.r_[pelvis[:3], pelvis[3:] + np.cross(pelvis[:3], out)]
        return carried + sk.jacobian(robot, stepping, tip)[:, 6:] @ np.where(right, 0, theta)

    ours = static_deflection(robot, stepping, "right_foot", k, "linear").of(tip)
    np.testing.assert_allclose(ours, deflection(with_moment=True), rtol=0, atol=1e-9)
    assert np.abs(ours - deflection(with_moment=False)).max() > 1e-3


@pytest.mark.parametrize("k", [5.0, 25.0, 1000.0])
def test_a_beam_on_a_spring_sags_as_the_textbook_says(k):
    """k theta = m g l cos(theta), with the bob at (l, 0, 0); positive pitch is downwards."""
    beam = parse_robot(PENDULUM.format(com="0.5, 0, 0"))
    yielded = static_deflection(beam, sk.State(np.eye(4), np.zeros(1)), "base", k)
    expected = brentq(lambda x: k * x - 2 * GRAVITY * 0.5 * math.cos(x), 0, math.pi, xtol=1e-15)
    assert yielded.theta[0] == pytest.approx(expected, abs=1e-12)
    assert yielded.stable
    yielded.raise_on_failure()


def test_an_upright_pendulum_stands_only_on_a_spring_stiffer_than_its_weight():
    """Stable where k > m g l = 9.81 N m/rad; upright is an equilibrium of either."""
    upright = parse_robot(PENDULUM.format(com="0, 0, 0.5"))
    state = sk.State(np.eye(4), np.zeros(1))
    stiff, soft = (static_deflection(upright, state, "base", k) for k in (9.82, 9.80))
    assert stiff.converged
    assert soft.converged
    assert stiff.stable
    assert not soft.stable
    with pytest.raises(NoSolutionError, match="too soft"):
        soft.raise_on_failure()


def test_compliance_is_what_moves_when_joints_yield_to_a_wrench(robot, stepping):
    """J by differences of poses, the support held; then J K^-1 J^T."""
    k = np.linspace(40, 80, 12)
    by_name = dict(zip(robot.joint_names, k, strict=True))
    stand = sk.frame_pose(robot, stepping, "right_foot")

    def pose(q):
        free = sk.State(np.eye(4), q)
        return (
            stand
            @ np.linalg.inv(sk.frame_pose(robot, free, "right_foot"))
            @ sk.frame_pose(robot, free, "left_foot")
        )

    columns, here = [], pose(stepping.q)
    for e in np.eye(12) * 1e-6:
        A, B = pose(stepping.q - e), pose(stepping.q + e)
        turn = (B[:3, :3] - A[:3, :3]) @ here[:3, :3].T / 2e-6
        columns.append([turn[2, 1], turn[0, 2], turn[1, 0], *(B[:3, 3] - A[:3, 3]) / 2e-6])
    J = np.array(columns).T
    C = cartesian_compliance(robot, stepping, "right_foot", "left_foot", by_name, gravity=0)
    np.testing.assert_allclose(C, J @ np.diag(1 / k) @ J.T, rtol=0, atol=1e-9)
    K = cartesian_stiffness(robot, stepping, "right_foot", "left_foot", by_name, gravity=0)
    np.testing.assert_allclose(K @ C, np.eye(6), rtol=0, atol=1e-9)


def test_a_straight_leg_has_no_stiffness_matrix_of_its_own(robot):
    zero = sk.home(robot, "zero")
    with pytest.raises(SingularError, match="rigid in some direction"):
        cartesian_stiffness(robot, zero, "right_foot", "base", 60.0)


def test_a_batch_gives_what_its_samples_give_wherever_the_robot_stands(robot, stepping):
    rng = np.random.default_rng(4)
    q = stepping.q + rng.uniform(-0.3, 0.3, (2, 3, 12))
    away = stepping.T_world_base.copy()
    away[:2, 3] = [50, -20]
    batch = static_deflection(robot, sk.State(away, q), "left_foot", 60.0)
    assert batch.theta.shape == (2, 3, 12)
    assert batch.change.shape == (2, 3, 3, 6)
    assert batch.converged.all()
    for index in np.ndindex(2, 3):
        one = static_deflection(robot, sk.State(stepping.T_world_base, q[index]), "left_foot", 60.0)
        np.testing.assert_allclose(batch.theta[index], one.theta, rtol=0, atol=1e-13)
        np.testing.assert_allclose(batch.of("right_foot")[index], one.of("right_foot"), rtol=0, atol=1e-12)


def test_the_table_gives_the_stiffness_unless_the_caller_does(robot):
    np.testing.assert_array_equal(joint_stiffness(robot), np.full(12, 60.0))
    mixed = joint_stiffness(robot, {"default": 50, "left_knee": 80})
    assert mixed[robot.joint_names.index("left_knee")] == 80
    assert sorted(set(mixed)) == [50, 80]


@pytest.mark.parametrize("bad", [0, -60.0, math.nan, math.inf, "60", True, {"default": 60, "left_knee": 0}])
def test_a_stiffness_that_is_no_positive_number_is_refused(robot, bad):
    with pytest.raises(InputError, match="must be a positive number"):
        static_deflection(robot, sk.home(robot), "right_foot", bad)


def test_a_table_that_gives_no_stiffness_has_that_of_its_servo_models(robot):
    """12 V behind 26.67 per rad drive 2 N m/A through 16 ohm: 40 N m/rad."""
    servos = {name: value for name, value in robot.servos.items() if name != "stiffness"}
    of_model = joint_stiffness(replace(robot, servos={**servos, "model": "AX-12A"}))
    np.testing.assert_allclose(of_model, np.full(12, 40.0), rtol=1e-5)


def test_other_wrong_input_is_told(robot):
    home = sk.home(robot)
    with pytest.raises(UnknownNameError, match="left_elbow"):
        static_deflection(robot, home, "right_foot", {"default": 60, "left_elbow": 60})
    with pytest.raises(InputError, match="no stiffness for left_hip_yaw"):
        static_deflection(robot, home, "right_foot", {"left_hip_roll": 60})
    with pytest.raises(InputError, match="no joint stiffness"):
        joint_stiffness(replace(robot, servos={}))
    with pytest.raises(UnknownNameError, match="third_foot"):
        static_deflection(robot, home, "third_foot")
    with pytest.raises(InputError, match="valid: linear, nonlinear"):
        static_deflection(robot, home, "right_foot", method="cubic")
    with pytest.raises(ShapeError, match="NaN"):
        static_deflection(robot, sk.State(home.T_world_base, np.full(12, np.nan)), "right_foot")
    with pytest.raises(ShapeError, match=r"\(\.\.\., 12\)"):
        static_deflection(robot, sk.State(home.T_world_base, np.zeros(11)), "right_foot")
    with pytest.raises(UnknownNameError, match="left_knee"):
        static_deflection(robot, home, "right_foot").of("left_knee")
