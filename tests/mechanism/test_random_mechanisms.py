"""Random closed mechanisms: closed positions, their rates and their accelerations agree by differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings

import screwkin as sk
from screwkin.algebra.se3 import IDENTITY, as_array, pose_from_array, unstack
from screwkin.errors import InputError, UnknownNameError
from screwkin.kinematics.status import Status
from screwkin.mechanism.closure import close_loops, closure_errors
from screwkin.mechanism.least_values import least_values
from screwkin.mechanism.network import coupling_twists, network_of_twists, twist_rates
from screwkin.mechanism.rates import secondary_accelerations, solve_rates
from tests.kinematics.machines import random_mechanism, seeds

STEP = 2e-3
STEPS = STEP * np.arange(-2, 3)


def moved(mechanism, speed, acceleration, steps=STEPS):
    """Coordinates (5, couplings) along x = x0 + v t + a t^2 / 2 of the primary couplings."""
    home = sk.home(mechanism.robot)
    start = close_loops(mechanism, home, {}).coordinates[mechanism.primary_columns]
    path = start + speed * steps[:, None] + acceleration * steps[:, None] ** 2 / 2
    solution = close_loops(mechanism, home, dict(zip(mechanism.primary, path.T, strict=True)))
    assert (solution.status == Status.CONVERGED).all()
    return solution


def healthy(mechanism):
    """Away from singular postures, where derivatives of positions are unbounded."""
    home = sk.home(mechanism.robot)
    return least_values(mechanism, home.T_world_base, home.q).min() > 0.03


@given(seed=seeds)
@settings(max_examples=25, derandomize=True)
def test_differences_of_closed_positions_are_the_rates_and_accelerations(seed):
    mechanism = sk.closed_mechanism(random_mechanism(seed))
    assume(healthy(mechanism))
    rng = np.random.default_rng(seed)
    speed, acceleration = rng.uniform(-0.5, 0.5, (2, len(mechanism.primary)))
    fastest = np.abs(sk.secondary_rates(mechanism, sk.home(mechanism.robot), speed)).max()
    speed, acceleration = speed / max(1.0, fastest), acceleration / max(1.0, fastest)
    solution = moved(mechanism, speed, acceleration)
    x = solution.coordinates
    rates = (x[0] - 8 * x[1] + 8 * x[3] - x[4]) / (12 * STEP)
    second = (-x[0] + 16 * x[1] - 30 * x[2] + 16 * x[3] - x[4]) / (12 * STEP**2)

    T, q = solution.state.T_world_base[2], solution.state.q[2]
    N = network_of_twists(mechanism, coupling_twists(mechanism, pose_from_array(T), q))
    assert np.abs(N @ rates).max() < 1e-6
    found = solve_rates(mechanism, T, q, speed)
    assert not found.singular.any()
    np.testing.assert_allclose(found.values, rates[mechanism.secondary_columns], atol=1e-6)

    everything = np.empty(len(mechanism.couplings))
    everything[mechanism.primary_columns], everything[mechanism.secondary_columns] = speed, found.values
    bent = secondary_accelerations(mechanism, T, q, everything, acceleration)
    scale = 1 + np.abs(second).max()
    np.testing.assert_allclose(bent.values, second[mechanism.secondary_columns], atol=2e-5 * scale)


@given(seed=seeds)
@settings(max_examples=15, derandomize=True)
def test_the_rates_of_the_screws_are_their_differences(seed):
    """N' from brackets against N along a motion; told at the world's origin, which does not move."""
    mechanism = sk.closed_mechanism(random_mechanism(seed))
    robot = mechanism.robot
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    x0 = close_loops(mechanism, home, {}).coordinates
    N = sk.network_matrix(mechanism, home)
    kernel = np.linalg.svd(N)[2][np.linalg.matrix_rank(N) :]
    rates = rng.uniform(-1, 1, len(kernel)) @ kernel
    twists = coupling_twists(mechanism, IDENTITY, list(home.q))
    derivative = as_array(twist_rates(mechanism, twists, list(rates)))

    def screws(t):
        from screwkin.algebra.se3 import ZERO
        from screwkin.mechanism.closure import base_pose

        x = x0 + t * rates
        base = base_pose(mechanism, list(x), pose_from_array(np.eye(4)))
        q = [x[mechanism.position[name]] for name in robot.joint_names]
        return as_array(coupling_twists(mechanism, base, q, ZERO - base.p))

    h = 1e-5
    found = (screws(h) - screws(-h)) / (2 * h)
    np.testing.assert_allclose(derivative, found, atol=1e-7)


@given(seed=seeds)
@settings(max_examples=10, derandomize=True)
def test_the_closure_error_of_an_open_loop_shrinks_to_first_order_by_the_closings(seed):
    """missing(x + dx) = missing(x) - C S dx: the sign that makes Newton's step a step towards closure."""
    mechanism = sk.closed_mechanism(random_mechanism(seed))
    rng = np.random.default_rng(seed)
    x = close_loops(mechanism, sk.home(mechanism.robot), {}).coordinates
    dx = 1e-6 * rng.uniform(-1, 1, len(x))
    fixed = pose_from_array(np.eye(4))
    q = [x[mechanism.position[name]] for name in mechanism.robot.joint_names]
    twists = coupling_twists(mechanism, IDENTITY, q)
    C = network_of_twists(mechanism, twists, circuits=mechanism.closing_matrix)
    missing = as_array(closure_errors(mechanism, unstack(x + dx), fixed)).reshape(-1)
    np.testing.assert_allclose(missing, -C @ dx, atol=2e-11)


def test_a_batch_closes_like_its_samples_one_by_one():
    mechanism = sk.closed_mechanism(random_mechanism(6))
    home = sk.home(mechanism.robot)
    name = mechanism.primary[0]
    start = close_loops(mechanism, home, {}).coordinates[mechanism.position[name]]
    values = start + np.linspace(-0.05, 0.05, 6).reshape(2, 3)
    batch = close_loops(mechanism, home, {name: values})
    assert batch.status.shape == (2, 3)
    assert batch.state.q.shape == (2, 3, len(home.q))
    for index in np.ndindex(2, 3):
        one = close_loops(mechanism, home, {name: values[index]})
        np.testing.assert_allclose(batch.state.q[index], one.state.q, atol=1e-12)
        assert batch.iterations[index] == one.iterations


def test_guess_and_imposed_values_broadcast_against_each_other():
    mechanism = sk.closed_mechanism(random_mechanism(0))
    home = sk.home(mechanism.robot)
    guess = sk.State(np.tile(home.T_world_base, (3, 1, 1, 1)), np.tile(home.q, (3, 1, 1)))
    name = mechanism.primary[-1]
    value = close_loops(mechanism, home, {}).coordinates[mechanism.position[name]]
    assert close_loops(mechanism, guess, {name: value + np.zeros(4)}).residual.shape == (3, 4)


def test_imposing_an_unknown_or_a_secondary_coupling_is_refused():
    mechanism = sk.closed_mechanism(random_mechanism(0))
    with pytest.raises(UnknownNameError, match="unknown coupling 'nose'"):
        close_loops(mechanism, sk.home(mechanism.robot), {"nose": 0.0})
    follower = mechanism.secondary[0]
    with pytest.raises(InputError, match=f"{follower} is secondary and follows"):
        close_loops(mechanism, sk.home(mechanism.robot), {follower: 0.0})


def test_a_crank_that_cannot_be_reached_is_told_by_status_and_residual():
    """The rocker of a four-bar beyond its dead centre: no position closes the loop."""
    from screwkin.model.table import load_robot

    robot = load_robot("linkages/four-bar")
    mechanism = sk.closed_mechanism(robot, primary=["rocker"])
    solution = close_loops(mechanism, sk.home(robot), {"rocker": np.array([1.9, 0.3])})
    assert list(solution.status) == [Status.CONVERGED, Status.UNREACHABLE]
    tip = np.array([0.2 + 0.14 * np.cos(0.3), 0.14 * np.sin(0.3)])
    reach = np.linalg.norm(tip) - (0.06 + 0.18)
    assert solution.residual[1] > 0.1 * reach


def test_a_joint_beyond_its_limits_is_told():
    from dataclasses import replace

    from screwkin.model.table import load_robot

    robot = load_robot("linkages/slider-crank")
    joints = tuple(replace(j, upper=0.19) if j.name == "slider" else j for j in robot.joints)
    mechanism = sk.closed_mechanism(replace(robot, joints=joints))
    solution = close_loops(mechanism, sk.home(robot), {"crank": np.array([0.1, 1.0])})
    assert list(solution.status) == [Status.OUT_OF_LIMITS, Status.CONVERGED]
