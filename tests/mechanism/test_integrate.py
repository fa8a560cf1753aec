"""Integration without closing the loops: of the order that the method promises, and it drifts."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.mechanism.closure import close_loops
from screwkin.mechanism.integrate import integrate_rates
from screwkin.mechanism.rates import solve_rates
from screwkin.model.table import load_robot


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("rk4", 4)])
def test_the_error_shrinks_by_the_order_of_the_method(method, order):
    errors = []
    for steps in (20, 40):
        time = np.linspace(0, 1, steps + 1)
        q = integrate_rates(lambda t, q: np.array([q[1], -q[0]]) + t * 0, time, np.array([1.0, 0.0]), method)
        errors.append(np.abs(q[-1] - [np.cos(1), -np.sin(1)]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


def test_uneven_samples_and_explicit_time_are_followed():
    time = np.sort(np.random.default_rng(0).uniform(0, 2, 60))
    q = integrate_rates(lambda t, q: np.array([np.cos(t)]), time, np.array([np.sin(time[0])]))
    np.testing.assert_allclose(q[:, 0], np.sin(time), atol=1e-6)


def test_the_first_sample_is_the_start():
    q = integrate_rates(lambda t, q: q, np.array([0.0, 0.1]), np.array([1.0, 2.0]))
    np.testing.assert_array_equal(q[0], [1.0, 2.0])


@pytest.fixture(scope="module")
def drift():
    """Loop closure of a four-bar after one turn of its crank, by method."""
    robot = load_robot("linkages/four-bar")
    mechanism = sk.closed_mechanism(robot)
    names = list(robot.joint_names)

    def rates(t, q):
        qd = np.zeros(4)
        found = solve_rates(mechanism, np.eye(4), q, np.array([2 * np.pi])).values
        qd[names.index("crank")] = 2 * np.pi
        for name, value in zip(mechanism.secondary, found, strict=True):
            qd[names.index(name)] = value
        return qd

    time = np.linspace(0, 1, 101)
    start = sk.home(robot).q
    ends = {m: integrate_rates(rates, time, start, m)[-1] for m in ("euler", "rk4")}
    closed = close_loops(mechanism, sk.home(robot), {"crank": start[0] + 2 * np.pi})
    gap = {m: np.linalg.norm(tips(robot, q)) for m, q in ends.items()}
    return gap, ends["rk4"], closed.state.q


def tips(robot, q):
    """The gap between coupler and rocker, by plane trigonometry."""
    p, (crank, pin, _, rocker) = robot.parameters, q
    coupler = crank + pin
    x = (
        p["crank"] * np.cos(crank)
        + p["coupler"] * np.cos(coupler)
        - p["ground"]
        - p["rocker"] * np.cos(rocker)
    )
    y = p["crank"] * np.sin(crank) + p["coupler"] * np.sin(coupler) - p["rocker"] * np.sin(rocker)
    return x, y


def test_euler_opens_the_loop_by_millimetres_and_runge_kutta_by_nothing(drift):
    gap, _, _ = drift
    assert gap["euler"] > 1e-3
    assert gap["rk4"] < 1e-7


def test_runge_kutta_comes_back_to_where_newton_closes_the_loop(drift):
    _, integrated, closed = drift
    np.testing.assert_allclose(np.exp(1j * integrated), np.exp(1j * closed), atol=1e-6)
