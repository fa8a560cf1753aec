"""ZMP: by hand for simple bodies, the cart-table for a point mass, and no tipping moment for any motion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

import screwkin as sk
from screwkin.algebra.screws import Wrench, wrench_at
from screwkin.algebra.se3 import IDENTITY, ZERO, Vector, as_array, vector_from_array
from screwkin.dynamics.zmp import cart_table_zmp, zmp_from_wrench
from screwkin.model.robot import Inertia, Link
from screwkin.model.table import load_robot
from tests.kinematics.machines import machine, random_state, random_tree, seeds

G = 9.81


def zmp_of(wrench, origin=ZERO):
    """ZMP (2,) from [m; f] about an origin."""
    told = Wrench(vector_from_array(wrench[:3]), vector_from_array(wrench[3:]))
    return np.array(as_array(zmp_from_wrench(told, origin)), dtype=float)[:2]


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_at_rest_the_zmp_is_the_com_on_the_floor(seed):
    robot = random_tree(seed, joints=5)
    state = random_state(robot, seed)
    zeros = np.zeros(5)
    wrench = sk.ground_wrench(robot, state, zeros, zeros, np.zeros(6), np.zeros(6))
    np.testing.assert_allclose(zmp_of(wrench), sk.center_of_mass(robot, state)[:2], atol=1e-12)
    assert wrench[5] == pytest.approx(G * robot.mass)


def point_mass(height=0.4):
    link = Link("base", 2.0, Vector(0.1, -0.05, height), Inertia(0, 0, 0), IDENTITY)
    return machine([link], [], base="floating")


def test_for_a_point_mass_the_multibody_zmp_is_the_cart_tables():
    robot = point_mass()
    T = np.eye(4)
    T[:3, 3] = [0.3, 0.2, 0.1]
    state, none = sk.State(T, np.zeros(0)), np.zeros(0)
    a = np.array([1.2, -0.7, 0.5])
    wrench = sk.ground_wrench(robot, state, none, none, np.zeros(6), np.r_[0, 0, 0, a])
    com = sk.center_of_mass(robot, state)
    cart = as_array(cart_table_zmp(vector_from_array(com), vector_from_array(a), G))
    np.testing.assert_allclose(zmp_of(wrench), cart[:2], atol=1e-13)
    by_hand = com[:2] - com[2] * a[:2] / (G + a[2])
    np.testing.assert_allclose(zmp_of(wrench), by_hand, atol=1e-13)


def test_a_spinning_flywheel_moves_the_zmp_but_not_the_cart_tables():
    """A wheel that spins up about y pushes its stand back: moment J alpha over the weight."""
    link = Link("base", 2.0, Vector(0, 0, 0.3), Inertia(0.01, 0.02, 0.01), IDENTITY)
    robot = machine([link], [], base="floating")
    state, none = sk.State(np.eye(4), np.zeros(0)), np.zeros(0)
    alpha = 3.0
    rate = np.array([0, alpha, 0, -alpha * 0.3, 0, 0])  # about the CoM, so that the CoM rests
    wrench = sk.ground_wrench(robot, state, none, none, np.zeros(6), rate)
    np.testing.assert_allclose(zmp_of(wrench), [-0.02 * alpha / (2.0 * G), 0.0], atol=1e-13)
    cart = cart_table_zmp(Vector(0.0, 0.0, 0.3), Vector(0.0, 0.0, 0.0), G)
    assert (cart.x, cart.y) == (0.0, 0.0)


@given(seed=seeds)
@settings(max_examples=20, derandomize=True)
def test_at_the_zmp_the_ground_wrench_does_not_tip(seed):
    rng = np.random.default_rng(seed)
    origin = vector_from_array(rng.uniform(-2, 2, 3))
    wrench = Wrench(vector_from_array(rng.uniform(-5, 5, 3)), Vector(*rng.uniform(-5, 5, 2), 17.0))
    zmp = zmp_from_wrench(wrench, origin)
    there = wrench_at(zmp - origin, wrench)
    assert abs(there.m.x) < 1e-12
    assert abs(there.m.y) < 1e-12
    assert zmp.z == 0.0


def test_the_zmp_of_the_humanoid_does_not_depend_on_where_its_wrench_is_told():
    robot = load_robot("bioloid")
    state = sk.home(robot)
    T = state.T_world_base.copy()
    T[:2, 3] = [3.0, -2.0]
    rng = np.random.default_rng(0)
    qd, qdd = rng.uniform(-1, 1, (2, 18))
    base, rate = rng.uniform(-0.2, 0.2, (2, 6))
    near = sk.ground_wrench(robot, state, qd, qdd, base, rate)
    far = sk.ground_wrench(robot, sk.State(T, state.q), qd, qdd, base, rate)
    np.testing.assert_allclose(zmp_of(far), zmp_of(near) + np.array([3.0, -2.0]), atol=1e-12)


def test_a_whole_trajectory_of_wrenches_is_one_call():
    wrench = np.random.default_rng(1).uniform(1, 2, (7, 6))
    told = Wrench(vector_from_array(wrench[:, :3]), vector_from_array(wrench[:, 3:]))
    zmp = as_array(zmp_from_wrench(told, Vector(0.1, 0.2, 0.3)), (7,))
    assert zmp.shape == (7, 3)
    np.testing.assert_allclose(zmp[4, :2], zmp_of(wrench[4], Vector(0.1, 0.2, 0.3)), atol=1e-14)
