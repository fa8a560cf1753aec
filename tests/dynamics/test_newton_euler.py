"""Newton-Euler dynamics against Lagrange by sympy, momentum and energy by differences, and themselves."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from scipy.linalg import expm

import screwkin as sk
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import IDENTITY, NO_TWIST, UNTURNED, Vector
from screwkin.dynamics.newton_euler import Bodies, composite_mass_matrix, wrench_and_efforts
from screwkin.errors import ShapeError
from screwkin.model.robot import Inertia, Joint, Link
from tests.kinematics.machines import machine, random_state, random_tree, seeds
from tests.kinematics.test_positions import bracketed

G = 9.81


def pendulum():
    """Two bars in the xz plane, hanging; masses, lengths, centres and inertias are symbols."""
    m1, m2, l1, a1, a2, i1, i2 = sympy.symbols("m1 m2 l1 a1 a2 I1 I2", positive=True)
    links = [
        Link("base", 0, Vector(0, 0, 0), Inertia(0, 0, 0), IDENTITY),
        Link("one", m1, Vector(0, 0, -a1), Inertia(0, i1, 0), IDENTITY),
        Link("two", m2, Vector(0, 0, -l1 - a2), Inertia(0, i2, 0), IDENTITY),
    ]
    y = Vector(0, 1, 0)
    joints = [
        Joint("shoulder", "base", "one", "revolute", Screw(y, Vector(0, 0, 0)), -9.0, 9.0, 9.0, 9.0),
        Joint("elbow", "one", "two", "revolute", Screw(y, Vector(0, 0, -l1)), -9.0, 9.0, 9.0, 9.0),
    ]
    return machine(links, joints), (m1, m2, l1, a1, a2, i1, i2)


@pytest.fixture(scope="module")
def lagrange():
    """Torques and mass matrix of the double pendulum by Lagrange's equations, in symbols."""
    robot, (m1, m2, l1, a1, a2, i1, i2) = pendulum()
    t, g = sympy.Symbol("t"), sympy.Symbol("g")
    q = [sympy.Function("q1")(t), sympy.Function("q2")(t)]
    c1 = sympy.Matrix([-a1 * sympy.sin(q[0]), -a1 * sympy.cos(q[0])])
    elbow = sympy.Matrix([-l1 * sympy.sin(q[0]), -l1 * sympy.cos(q[0])])
    c2 = elbow + sympy.Matrix([-a2 * sympy.sin(q[0] + q[1]), -a2 * sympy.cos(q[0] + q[1])])
    w1, w2 = q[0].diff(t), (q[0] + q[1]).diff(t)
    speed = [c.diff(t).dot(c.diff(t)) for c in (c1, c2)]
    kinetic = (m1 * speed[0] + m2 * speed[1] + i1 * w1**2 + i2 * w2**2) / 2
    L = kinetic - g * (m1 * c1[1] + m2 * c2[1])
    torques = [L.diff(x.diff(t)).diff(t) - L.diff(x) for x in q]
    plain = sympy.symbols("q1 q2 v1 v2 b1 b2")
    names = [q[0].diff(t, 2), q[1].diff(t, 2), q[0].diff(t), q[1].diff(t), *q]
    swap = dict(zip(names, [*plain[4:], *plain[2:4], *plain[:2]], strict=True))
    return robot, plain, g, [tau.subs(swap) for tau in torques]


def test_the_double_pendulums_torques_are_lagranges(lagrange):
    robot, (q1, q2, v1, v2, b1, b2), g, wanted = lagrange
    bodies = Bodies.of(robot, UNTURNED, [q1, q2])
    _, torques = wrench_and_efforts(bodies, [v1, v2], [b1, b2], NO_TWIST, NO_TWIST, g)
    for found, tau in zip(torques, wanted, strict=True):
        assert sympy.simplify(sympy.expand_trig(found - tau)) == 0


def test_the_double_pendulums_mass_matrix_is_the_accelerations_share(lagrange):
    robot, (q1, q2, *_, b1, b2), _, wanted = lagrange
    M = composite_mass_matrix(Bodies.of(robot, UNTURNED, [q1, q2]))
    for row, tau in enumerate(wanted):
        for column, b in enumerate((b1, b2)):
            assert sympy.simplify(sympy.expand_trig(M[6 + row][6 + column] - tau.diff(b))) == 0


def motion(seed):
    """A robot, a state, and base twist, rates and their derivatives."""
    robot = random_tree(seed, joints=6)
    rng = np.random.default_rng(seed)
    n = len(robot.joints)
    base, rate = rng.uniform(-1, 1, (2, 6))
    qd, qdd = rng.uniform(-1, 1, (2, n))
    return robot, random_state(robot, seed), base, rate, qd, qdd


def along(state, base, rate, qd, qdd, t):
    """State, base twist and rates a small time later, to second order."""
    T = state.T_world_base.copy()
    turn = base[:3] * t + rate[:3] * t * t / 2
    T[:3, :3] = expm(bracketed([*turn, 0, 0, 0])[:3, :3]) @ T[:3, :3]
    T[:3, 3] += base[3:] * t + rate[3:] * t * t / 2
    return sk.State(T, state.q + qd * t + qdd * t * t / 2), base + rate * t, qd + qdd * t


def world_momentum(robot, state, base, qd):
    """[angular about the world's origin; linear]."""
    h = sk.momentum(robot, state, qd, base)
    com = sk.center_of_mass(robot, state)
    return np.r_[h[:3] + np.cross(com, h[3:]), h[3:]]


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_the_rate_of_momentum_is_the_ground_wrench_less_the_weight(seed):
    robot, state, base, rate, qd, qdd = motion(seed)
    h = 1e-5
    ends = []
    for t in (-h, h):
        later, twist, rates = along(state, base, rate, qd, qdd, t)
        ends.append(world_momentum(robot, later, twist, rates))
    weight = np.array([0, 0, -G * robot.mass])
    moment = np.cross(sk.center_of_mass(robot, state), weight)
    wrench = sk.ground_wrench(robot, state, qd, qdd, base, rate)
    np.testing.assert_allclose(wrench + np.r_[moment, weight], (ends[1] - ends[0]) / (2 * h), atol=1e-7)


def energies(robot, state, base, qd):
    """Kinetic energy from the mass matrix, and potential energy."""
    v = np.r_[base, qd]
    kinetic = v @ sk.mass_matrix(robot, state) @ v / 2
    return kinetic + G * robot.mass * sk.center_of_mass(robot, state)[2]


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_forces_times_rates_are_the_rate_of_energy(seed):
    robot, state, base, rate, qd, qdd = motion(seed)
    h = 1e-5
    ends = []
    for t in (-h, h):
        later, twist, rates = along(state, base, rate, qd, qdd, t)
        ends.append(energies(robot, later, twist, rates))
    force = sk.inverse_dynamics(robot, state, qd, qdd, base, rate)
    assert force @ np.r_[base, qd] == pytest.approx((ends[1] - ends[0]) / (2 * h), abs=1e-6)


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_the_mass_matrix_tells_the_kinetic_energy_of_the_moving_bodies(seed):
    """Every link's own energy, with its velocities by differences of its pose."""
    robot, state, base, _, qd, _ = motion(seed)
    h = 1e-5
    before, after = (sk.link_poses(robot, along(state, base, 0 * base, qd, 0 * qd, t)[0]) for t in (-h, h))
    total = 0.0
    for link, A, B in zip(robot.links, before, after, strict=True):
        home = np.eye(4)
        home[:3, :3] = np.array([list(c) for c in (link.frame.R.x, link.frame.R.y, link.frame.R.z)]).T
        home[:3, 3] = list(link.frame.p)
        A, B = A @ np.linalg.inv(home), B @ np.linalg.inv(home)
        v = (B @ [*link.com, 1] - A @ [*link.com, 1])[:3] / (2 * h)
        W = (B - A)[:3, :3] @ ((A + B) / 2)[:3, :3].T / (2 * h)
        R, i = ((A + B) / 2)[:3, :3], link.inertia
        w = R.T @ [W[2, 1], W[0, 2], W[1, 0]]
        J = np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]])
        total += link.mass * v @ v / 2 + w @ J @ w / 2
    velocity = np.r_[base, qd]
    assert velocity @ sk.mass_matrix(robot, state) @ velocity / 2 == pytest.approx(total, abs=1e-7)


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_the_mass_matrix_is_symmetric_and_positive_definite(seed):
    robot, state, *_ = motion(seed)
    M = sk.mass_matrix(robot, state)
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M)[0] > 0
    np.testing.assert_allclose(M[3:6, 3:6], robot.mass * np.eye(3), atol=1e-12)


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_forces_are_linear_in_accelerations_by_the_mass_matrix(seed):
    robot, state, base, rate, qd, qdd = motion(seed)
    still = sk.inverse_dynamics(robot, state, qd, 0 * qdd, base, 0 * rate)
    moving = sk.inverse_dynamics(robot, state, qd, qdd, base, rate)
    M = sk.mass_matrix(robot, state)
    np.testing.assert_allclose(moving - still, M @ np.r_[rate, qdd], atol=1e-11)


@given(seed=seeds)
@settings(max_examples=10, derandomize=True)
def test_the_wrench_on_the_base_is_the_ground_wrench_told_at_the_base(seed):
    robot, state, base, rate, qd, qdd = motion(seed)
    force = sk.inverse_dynamics(robot, state, qd, qdd, base, rate)[:6]
    ground = sk.ground_wrench(robot, state, qd, qdd, base, rate)
    p = state.T_world_base[:3, 3]
    np.testing.assert_allclose(ground[:3] - np.cross(p, ground[3:]), force[:3], atol=1e-10)
    np.testing.assert_allclose(ground[3:], force[3:], atol=1e-10)


def test_without_gravity_and_motion_nothing_is_needed():
    robot, state, base, rate, qd, qdd = motion(1)
    force = sk.inverse_dynamics(robot, state, 0 * qd, 0 * qdd, 0 * base, 0 * rate, gravity=0.0)
    assert not force.any()


def test_at_rest_torques_are_the_gradient_of_the_potential_energy():
    robot, state, *_ = motion(2)
    n = len(robot.joints)
    torques = sk.inverse_dynamics(robot, state, np.zeros(n), np.zeros(n))[6:]
    for i in range(n):
        step = np.zeros(n)
        step[i] = 1e-6
        z = [sk.center_of_mass(robot, sk.State(state.T_world_base, state.q + s * step))[2] for s in (1, -1)]
        assert torques[i] == pytest.approx(G * robot.mass * (z[0] - z[1]) / 2e-6, abs=1e-7)


def test_the_centroidal_momentum_does_not_depend_on_where_the_robot_stands():
    robot, state, base, _, qd, _ = motion(3)
    T = state.T_world_base.copy()
    T[:3, 3] += [100.0, -50.0, 7.0]
    here, there = sk.momentum(robot, state, qd, base), sk.momentum(robot, sk.State(T, state.q), qd, base)
    np.testing.assert_allclose(there, here, atol=1e-13)


def test_a_batch_of_motions_is_its_motions_one_by_one():
    robot = random_tree(4, joints=5)
    state = random_state(robot, 4, (3,))
    rng = np.random.default_rng(4)
    qd, qdd = rng.uniform(-1, 1, (2, 3, 5))
    base, rate = rng.uniform(-1, 1, (2, 3, 6))
    force = sk.inverse_dynamics(robot, state, qd, qdd, base, rate)
    for k in range(3):
        one = sk.State(state.T_world_base[k], state.q[k])
        single = sk.inverse_dynamics(robot, one, qd[k], qdd[k], base[k], rate[k])
        np.testing.assert_allclose(force[k], single, atol=1e-12)


def test_wrong_shapes_name_the_argument():
    robot, state, base, rate, qd, qdd = motion(1)
    with pytest.raises(ShapeError, match=r"qdd has shape \(5,\), expected \(..., 6\)"):
        sk.inverse_dynamics(robot, state, qd, qdd[:5], base, rate)
    with pytest.raises(ShapeError, match="base_twist has shape"):
        sk.ground_wrench(robot, state, qd, qdd, base[:3], rate)
