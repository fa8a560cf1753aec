"""One answer of statics: a sample alone is the sample in any batch, after any history, on every path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.analysis.workspace import workspace
from screwkin.compiler import native
from screwkin.compiler.run import compile_program
from screwkin.compliance.balance import Loaded
from screwkin.compliance.deflection import newton_step
from screwkin.compliance.equilibrium import balances
from screwkin.compliance.stiffness import static_deflection
from screwkin.dynamics.margin import support_margin
from screwkin.ik.reach import reach
from screwkin.kinematics.mass import GRAVITY
from tests.kinematics.machines import random_state, random_tree

BATCHES = (7, 999, 5000)
seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, feet=st.integers(1, 3), corners=st.integers(1, 5), grid=st.sampled_from([None, 0.05]))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_a_margin_does_not_depend_on_its_neighbours(seed, feet, corners, grid):
    """Soles of any outline, also on a coarse grid, where corners coincide and lie in one line."""
    rng = np.random.default_rng(seed)
    zmp, soles = rng.uniform(-0.2, 0.2, (5000, 2)), rng.uniform(-0.15, 0.15, (5000, feet, corners, 2))
    if grid:
        zmp, soles = grid * np.round(zmp / grid), grid * np.round(soles / grid)
    contact = rng.random((5000, feet)) > 0.3
    together = support_margin(zmp, soles, contact)
    for count in BATCHES[:-1]:
        np.testing.assert_array_equal(
            support_margin(zmp[:count], soles[:count], contact[:count]), together[:count]
        )
    for k in range(20):
        alone = support_margin(zmp[k : k + 1], soles[k : k + 1], contact[k : k + 1])
        np.testing.assert_array_equal(alone, together[k : k + 1])


def conditions(robot, state, support, k, theta):
    """Condition (B,) of the matrix of springs and weight at deflections theta (B, n)."""
    T = np.broadcast_to(state.T_world_base, (len(theta), 4, 4))
    loaded = Loaded(robot, support, T, state.q, np.full(theta.shape[1], k), GRAVITY)
    return np.concatenate([np.linalg.cond(here.slope) for _, here in balances(loaded, theta)])


def batch_matters_not(robot, state, support, k, method):
    """Parts of a batch, and samples alone, have its status, and its numbers to 1e-12 times the condition."""
    whole = static_deflection(robot, state, support, k, method)
    condition = conditions(robot, state, support, k, whole.theta)
    hard = np.flatnonzero(~(whole.converged & whole.stable))[:3]
    for rows in (*map(slice, BATCHES), *np.arange(5)[:, None], *hard[:, None]):
        some = static_deflection(robot, sk.State(state.T_world_base, state.q[rows]), support, k, method)
        for name in ("converged", "stable", "iterations"):
            np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[rows], err_msg=name)
        for name in ("theta", "change"):
            apart = np.abs(getattr(some, name) - getattr(whole, name)[rows])[some.converged]
            allowed = 1e-12 * condition[rows][some.converged]
            assert (apart.reshape(len(allowed), np.prod(apart.shape[1:])) <= allowed[:, None]).all()
    return whole


@pytest.mark.parametrize("method", ["linear", "nonlinear"])
@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_a_deflection_does_not_depend_on_its_neighbours(name, method):
    robot = sk.load_robot(name)
    home = sk.home(robot)
    q = home.q + np.random.default_rng(0).uniform(-0.5, 0.5, (5000, len(home.q)))
    whole = batch_matters_not(robot, sk.State(home.T_world_base, q), "left_foot", 60.0, method)
    assert (whole.converged & whole.stable).all()


@pytest.mark.skipif(not native.compiler(), reason="there is no C compiler")
def test_nor_on_whether_its_program_was_prepared():
    plain, prepared = (replace(sk.load_robot("poppy12")) for _ in range(2))
    assert compile_program(newton_step(prepared, "left_foot"))
    home = sk.home(plain)
    q = home.q + np.random.default_rng(1).uniform(-0.5, 0.5, (300, len(home.q)))
    state = sk.State(home.T_world_base, q)
    one, other = (static_deflection(robot, state, "left_foot", 10.0) for robot in (plain, prepared))
    for name in ("converged", "stable", "iterations"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    np.testing.assert_allclose(one.theta, other.theta, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("name", "k"), [("bioloid", 3.0), ("poppy12", 2.8)])
def test_nor_does_one_of_joints_that_are_so_soft_that_some_collapse(name, k):
    robot = sk.load_robot(name)
    home = sk.home(robot)
    q = home.q + np.random.default_rng(0).uniform(-0.5, 0.5, (60, len(home.q)))
    whole = batch_matters_not(robot, sk.State(home.T_world_base, q), "left_foot", k, "nonlinear")
    assert 0 < (whole.converged & whole.stable).sum() < 60


@given(seed=st.integers(0, 50), k=st.sampled_from([40.0, 200.0, 600.0]), data=st.data())
@settings(max_examples=8, deadline=None, derandomize=True)
def test_nor_do_deflections_of_random_trees(seed, k, data):
    tree = replace(random_tree(seed), closures=())
    q = np.random.default_rng(seed).uniform(-1, 1, (999, len(tree.joints)))
    state = sk.State(random_state(tree, seed).T_world_base, q)
    support = data.draw(st.sampled_from(tree.link_names))
    batch_matters_not(tree, state, support, k, data.draw(st.sampled_from(["linear", "nonlinear"])))


@pytest.mark.parametrize(("name", "height"), [("bioloid", 0.16), ("poppy12", 0.375)])
def test_a_point_of_a_workspace_does_not_depend_on_its_neighbours(name, height):
    """A grid and one twice as coarse; points alone and in batches, mirror planes and borders among them."""
    robot = sk.load_robot(name)
    fine, coarse = (workspace(robot, "left_leg", [height], step)[0] for step in (0.004, 0.008))
    x, i, k = np.intersect1d(fine.x, coarse.x, return_indices=True)
    y, j, m = np.intersect1d(fine.y, coarse.y, return_indices=True)
    assert len(x) >= len(coarse.x) - 2
    ours, theirs = np.ix_(i, j), np.ix_(k, m)
    np.testing.assert_array_equal(fine.cause[ours], coarse.cause[theirs])
    np.testing.assert_allclose(fine.q[ours], coarse.q[theirs], rtol=0, atol=1e-9)
    np.testing.assert_allclose(fine.inverse_condition[ours], coarse.inverse_condition[theirs], atol=1e-12)
    rows = [robot.joint_names.index(joint) for joint in fine.joint_names]
    guess = np.array(robot.posture("home").q)[rows]
    points = np.array([(a, b, -height) for a in x for b in y])
    whole = reach(robot, "left_leg", points, guess, fine.length)
    np.testing.assert_array_equal(whole.cause.reshape(len(x), len(y)), fine.cause[ours])
    for part in (slice(7), slice(99), *np.arange(0, len(points), len(points) // 40)[:, None]):
        some = reach(robot, "left_leg", points[part], guess, fine.length)
        np.testing.assert_array_equal(some.cause, whole.cause[part])
        allowed = 1e-12 / np.nan_to_num(whole.inverse_condition[part], nan=1.0)
        apart = np.nan_to_num(np.abs(some.q - whole.q[part])).max(axis=1)
        assert (apart <= allowed).all()
        np.testing.assert_allclose(some.inverse_condition, whole.inverse_condition[part], rtol=0, atol=1e-12)
