"""Order of branches, and the path through them, against plain dynamic programming."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from screwkin.errors import InputError
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.ik.solutions import BEYOND, LimbSolutions, ordered
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.kinematics.status import Status
from screwkin.model.table import load_robot
from tests.ik.legs import Floats, Leg, apart, offset_leg, spherical_leg


def solutions(q: Floats, valid: Floats, inside: Floats) -> LimbSolutions:
    shape = q.shape[:-1]
    return LimbSolutions(
        "leg", ("a",) * q.shape[-1], "closed", q, valid, inside, np.zeros(shape), np.ones(shape)
    )


def cheapest(q: Floats, toll: Floats) -> float:
    """Least cost over all sequences of branches, by trying them all."""
    T, k, _ = q.shape
    costs = []
    for way in product(range(k), repeat=T):
        steps = sum(((q[t + 1, way[t + 1]] - q[t, way[t]]) ** 2).sum() for t in range(T - 1))
        costs.append(steps + sum(toll[t, way[t]] for t in range(T)))
    return float(min(costs))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("T", [1, 2, 5, 7])
def test_the_path_costs_no_more_than_any_other(seed: int, T: int) -> None:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(T, 3, 2))
    inside = rng.random((T, 3)) < 0.7
    found = solutions(q, np.ones((T, 3), dtype=bool), inside).path()
    taken = [int(np.abs(q[t] - found[t]).sum(axis=1).argmin()) for t in range(T)]
    toll = np.where(inside, 0.0, BEYOND)
    cost = (np.diff(found, axis=0) ** 2).sum() + sum(toll[t, taken[t]] for t in range(T))
    assert cost == pytest.approx(cheapest(q, toll))


def test_a_path_begins_near_its_start_and_keeps_leading_dimensions() -> None:
    q = np.broadcast_to(np.array([[0.0], [1.0]]), (2, 4, 2, 1))
    both = np.ones((2, 4, 2), dtype=bool)
    path = solutions(q, both, both).path(start=np.array([[0.1], [0.8]]))
    assert path.shape == (2, 4, 1)
    assert (path[0] == 0.0).all()
    assert (path[1] == 1.0).all()


def test_a_path_needs_time() -> None:
    with pytest.raises(InputError, match="axis of time"):
        solutions(np.zeros((8, 6)), np.ones(8, dtype=bool), np.ones(8, dtype=bool)).path()


@pytest.mark.parametrize("leg", [offset_leg(), spherical_leg()], ids=["offset", "spherical"])
def test_a_smooth_motion_is_found_again_from_its_tip_poses(leg: Leg) -> None:
    """A thousand samples through sign changes of every joint but the knee; branches come in any order."""
    t = np.linspace(0.0, 1.0, 1000)[:, None]
    q = 0.5 * np.sin(2 * np.pi * (t + np.arange(6) / 6)) + [0, 0, -0.4, 0.9, -0.4, 0]
    found = solve_limb(leg.chain(), leg.reach(q), "closed", np.zeros_like(q), IkSettings(), (1000,))
    path = found.path(start=q[0])
    assert apart(path, q).max() < 1e-6
    assert apart(path[1:], path[:-1]).max() < 0.01


def test_a_path_passes_the_least_squares_answers_where_there_is_no_solution() -> None:
    leg = spherical_leg()
    t = np.linspace(0.0, np.pi, 200)
    target = leg.reach(np.tile([0.0, 0.0, -0.5, 1.0, -0.5, 0.0], (200, 1)))
    target[:, 2, 3] -= 0.03 * np.sin(t)
    found = solve_limb(leg.chain(), target, "closed", np.zeros((200, 6)), IkSettings(), (200,))
    assert (found.status == Status.UNREACHABLE).sum() > 20
    path = found.path()
    assert np.isfinite(path).all()
    assert apart(path[1:], path[:-1]).max() < 0.2


def test_branches_inside_the_limits_come_first_then_the_nearest_to_the_guess() -> None:
    chain = SerialChain.of(load_robot("poppy12"), "left_leg")
    rng = np.random.default_rng(4)
    q = rng.uniform(-3, 3, (50, 8, 6))
    q[:, 5] = rng.uniform(chain.lower, chain.upper, (50, 6))
    valid = rng.random((50, 8)) < 0.6
    valid[:, 5] = True
    valid[7] = False
    residual = rng.random((50, 8))
    guess = np.zeros((50, 6))
    found = ordered(chain, "closed", q, valid, residual, np.ones((50, 8)), guess, (50,))
    rest = np.arange(50) != 7
    np.testing.assert_array_equal(found.q[rest, 0], q[rest, 5])
    assert (found.valid.sum(axis=1) == valid.sum(axis=1)).all()
    for k in np.flatnonzero(rest):
        count = valid[k].sum()
        assert found.valid[k, :count].all()
        assert np.isnan(found.q[k, count:]).all()
        assert np.isinf(found.residual[k, count:]).all()
        distance = np.linalg.norm(np.sin(found.q[k, :count] / 2), axis=1)
        outside = distance[~found.in_limits[k, :count]]
        assert (np.diff(outside) >= 0).all()
    np.testing.assert_array_equal(found.q[7, 0], q[7, 0])
    assert found.residual[7, 0] == residual[7, 0]
    assert found.status[7] == Status.UNREACHABLE
    assert (found.status[rest] == Status.CONVERGED).all()


def test_an_angle_is_given_by_the_turn_that_its_limits_ask_for() -> None:
    chain = offset_leg().chain()
    chain.lower[:] = 0.0
    chain.upper[:] = 2 * np.pi
    q = chain.wrapped(np.array([[-1.0, 4.0, 7.0, -7.0, np.pi, -np.pi]]))
    turn = 2 * np.pi
    np.testing.assert_allclose(q, [[turn - 1.0, 4.0, 7.0 - turn, 2 * turn - 7.0, np.pi, np.pi]])
    assert chain.within(q).all()


@pytest.mark.parametrize("start", [None, 0.0])
def test_a_path_unwraps_joints_that_may_turn_beyond_half_a_turn(start: float | None) -> None:
    """A hip yaw that turns once and a half: its angles jump, the path does not, and it keeps its limits."""
    t = np.linspace(0.0, 1.0, 400)
    q = np.tile([0.0, 0.1, -0.5, 1.0, -0.4, 0.1], (400, 1))
    q[:, 0] = 3.0 * np.pi * t - 1.0
    leg, chain = spherical_leg(), spherical_leg().chain(10.0)
    found = solve_limb(chain, leg.reach(q), "closed", np.zeros_like(q), IkSettings(), (400,))
    path = found.path(None if start is None else q[0])
    assert np.abs(np.diff(path, axis=0)).max() < 0.1
    np.testing.assert_allclose(path[:, 0] - path[0, 0], q[:, 0] - q[0, 0], atol=1e-6)
    assert (np.abs(path) <= 10.0).all()


def test_a_path_turns_back_where_the_limits_end() -> None:
    """Within 200 degrees a yaw of one turn and a half cannot be followed smoothly: it turns back once."""
    q = np.tile([0.0, 0.1, -0.5, 1.0, -0.4, 0.1], (400, 1))
    q[:, 0] = np.linspace(-1.0, 3.0 * np.pi - 1.0, 400)
    leg, limit = spherical_leg(), np.radians(200)
    found = solve_limb(leg.chain(limit), leg.reach(q), "closed", np.zeros_like(q), IkSettings(), (400,))
    path = found.path(q[0])
    assert (np.abs(path[:, 0]) <= limit + 1e-9).all()
    assert (np.abs(np.diff(path[:, 0])) > 1.0).sum() <= 2
