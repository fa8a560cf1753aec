"""Deflections by programs, against the certified fallback, which takes its arrays and eigenvalues."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler import native
from screwkin.compiler.run import run
from screwkin.compliance import deflection, equilibrium
from screwkin.compliance.balance import Loaded
from screwkin.compliance.equilibrium import first_order
from screwkin.compliance.stiffness import static_deflection
from screwkin.kinematics.mass import GRAVITY
from tests.kinematics.machines import random_state, random_tree

PATHS = ["python", "numpy", *(["C"] if native.compiler() else [])]
METHODS = ("linear", "nonlinear")


def standing(robot, count=60, seed=0, spread=0.3):
    """States near home on tilted ground."""
    rng = np.random.default_rng(seed)
    home = sk.home(robot)
    q = home.q + spread * rng.uniform(-1, 1, (count, len(home.q)))
    return sk.State(random_state(robot, seed, (count,)).T_world_base, q)


def solved(robot, state, support, k, method):
    """Deflections, and which samples are certified."""
    loaded = Loaded(robot, support, state.T_world_base, state.q, k, GRAVITY)
    if method == "linear":
        certified = run(deflection.linear(robot, support), equilibrium._inputs(loaded))["certified"][:, 0] > 0
        return first_order(loaded), certified
    return equilibrium.equilibrium(loaded), equilibrium._steps(loaded)[3]


def by_fallback(monkeypatch, *arguments):
    """The same if no sample were certified."""
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium, "_blocks", lambda which: [np.arange(len(which))])
        return solved(*arguments)[0]


def agree(found, expected, rows, condition=1.0):
    """theta, base, change and residual to rounding; stability exactly."""
    for mine, other in zip(found[:4], expected[:4], strict=True):
        np.testing.assert_allclose(mine[rows], other[rows], rtol=0, atol=1e-14 * condition)
    np.testing.assert_array_equal(found[5][rows], expected[5][rows])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_programs_bend_a_robot_as_the_formulas_do(monkeypatch, name, method):
    robot = sk.load_robot(name)
    home = sk.home(robot)
    state = replace(standing(robot), T_world_base=np.broadcast_to(home.T_world_base, (60, 4, 4)))
    k = np.random.default_rng(1).uniform(30, 90, len(home.q))
    for support in (*robot.tip_names[:2], robot.link_names[3], "base"):
        expected = by_fallback(monkeypatch, robot, state, support, k, method)
        found, certified = solved(robot, state, support, k, method)
        assert certified.all()
        assert np.abs(expected[0]).max() > 1e-3
        agree(found, expected, certified)
        np.testing.assert_array_equal(found[4], expected[4])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(5))
def test_random_trees_in_any_place_of_the_world(monkeypatch, seed, method):
    """Turning, sliding and helical joints; any link as support; springs stiff and soft."""
    tree = replace(random_tree(seed), closures=())
    state = random_state(tree, seed, (40,))
    rng = np.random.default_rng(seed)
    k = rng.uniform(100, 900, len(tree.joints)) * rng.choice([1.0, 0.2])
    support = str(rng.choice(tree.link_names))
    expected = by_fallback(monkeypatch, tree, state, support, k, method)
    found, certified = solved(tree, state, support, k, method)
    assert certified.mean() > 0.5
    agree(found, expected, certified, condition=10)


@pytest.mark.parametrize("k", [3.0, 1.6, 0.8])
def test_what_is_certified_of_soft_joints_is_so(monkeypatch, k):
    """Springs about as stiff as the weight: pivots decide stability as eigenvalues do."""
    robot = sk.load_robot("poppy12")
    state, k = standing(robot, 200), np.full(12, k)
    state = replace(state, T_world_base=np.eye(4)[None].repeat(200, axis=0))
    expected = by_fallback(monkeypatch, robot, state, "left_foot", k, "linear")
    found, certified = solved(robot, state, "left_foot", k, "linear")
    assert certified.mean() > 0.95
    agree(found, expected, certified, condition=100)


def test_what_is_not_certified_is_decided_alike_in_any_batch():
    """Collapsing robots and such that need damped steps, among others, in one large batch."""
    robot = sk.load_robot("poppy12")
    state = standing(robot, 1000, spread=0.5)
    few = sk.State(state.T_world_base[:150], state.q[:150])
    k = 2.8
    _, certified = solved(robot, few, "left_foot", np.full(12, k), "nonlinear")
    assert 0 < certified.sum() < len(certified)
    small = static_deflection(robot, few, "left_foot", k)
    rows = np.arange(1000) % 150
    large = static_deflection(robot, sk.State(few.T_world_base[rows], few.q[rows]), "left_foot", k)
    for name in ("converged", "stable", "iterations"):
        np.testing.assert_array_equal(getattr(large, name), getattr(small, name)[rows])
    # Two walks of damped steps agree to rounding only where they end in an equilibrium.
    held = small.converged & small.stable
    for name in ("theta", "torque", "change"):
        mine, other = getattr(large, name), getattr(small, name)[rows]
        np.testing.assert_allclose(mine[held[rows]], other[held[rows]], rtol=0, atol=1e-11)
    assert (~held).any()


@pytest.mark.parametrize("method", METHODS)
def test_large_batches_have_the_shapes_of_small_ones(method):
    robot = sk.load_robot("bioloid")
    state = standing(robot, 1000, spread=0.1)
    grid = sk.State(sk.home(robot).T_world_base, state.q.reshape(2, 1000 // 2, -1))
    large = static_deflection(robot, grid, "right_foot", 60.0, method)
    part = static_deflection(robot, sk.State(grid.T_world_base, grid.q[1, :20]), "right_foot", 60.0, method)
    for name in ("theta", "torque", "change", "residual"):
        mine, other = getattr(large, name)[1, :20], getattr(part, name)
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-14)
    np.testing.assert_allclose(large.state.q[1, :20], part.state.q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(large.state.T_world_base[1, :20], part.state.T_world_base, atol=1e-14)
    assert large.iterations.shape == large.stable.shape == (2, 1000 // 2)
    assert large.converged.all()


@pytest.mark.parametrize("path", PATHS)
def test_every_path_gives_the_same_numbers(path):
    tree = replace(random_tree(4), closures=())
    state, n = random_state(tree, 4, (20,)), len(tree.joints)
    told = {**vars(state), "stiffness": np.full(n, 300.0), "gravity": [GRAVITY], "theta": 0.01 * state.q}
    makers = (deflection.linear, deflection.newton_step, deflection.moved)
    for make in makers[1:2] if path == "C" else makers:  # compiling takes seconds
        program = make(tree, tree.link_names[-1])
        expected, found = run(program, told, path="numpy"), run(program, told, path=path)
        for name, value in expected.items():
            np.testing.assert_allclose(found[name], value, rtol=0, atol=1e-13, err_msg=name)
