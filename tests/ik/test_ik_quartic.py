"""Roots on the circle, and the turns of vectors that the closed forms are made of."""

from __future__ import annotations

import jax
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from screwkin.algebra.quartic import circle_points, circle_roots
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, as_array, cross, dot, rotate
from screwkin.ik.point_turns import point_turns
from screwkin.ik.spherical_hip import spherical_hip_branches
from screwkin.ik.subproblems import level_turns, three_turns, turn_onto, two_turns
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.table import load_robot
from tests.strategies import angles, unit_vectors, vectors


def coefficients(roots: np.ndarray) -> np.ndarray:
    """Those of the product of sin((x - root)/2) over four roots (B, 4), by Fourier sums of its samples."""
    x = np.arange(8) * np.pi / 4
    f = np.sin((x[:, None, None] - roots) / 2).prod(axis=-1)
    terms = [np.ones(8) / 2, np.cos(x), np.sin(x), np.cos(2 * x), np.sin(2 * x)]
    return np.array([(term[:, None] * f).mean(axis=0) * 2 for term in terms])


def worst(found: np.ndarray, roots: np.ndarray) -> float:
    """Largest distance (on the circle) of a root to the nearest found one."""
    gap = np.abs((found.T[:, None] - roots[:, :, None] + np.pi) % (2 * np.pi) - np.pi)
    return float(gap.min(axis=2).max())


def test_random_roots_are_found():
    roots = np.random.default_rng(1).uniform(-np.pi, np.pi, (2000, 4))
    assert worst(circle_roots(*coefficients(roots)), roots) < 1e-6


@pytest.mark.parametrize("angle", [np.pi, -np.pi, 0.0, np.pi / 2, 3.0])
def test_a_root_at_half_a_turn_is_as_good_as_any(angle):
    roots = np.array([[angle, 1.0, -2.0, 0.3]])
    assert worst(circle_roots(*coefficients(roots)), roots) < 1e-12


def test_double_roots_lose_half_of_the_digits_and_no_more():
    roots = np.random.default_rng(2).uniform(-np.pi, np.pi, (500, 2)).repeat(2, axis=1)
    assert worst(circle_roots(*coefficients(roots)), roots) < 1e-5


def test_double_roots_lose_no_more_as_points_on_the_circle():
    """At double roots value and slope are rounding: a Newton step by their ratio leads anywhere."""
    rng = np.random.default_rng(3)
    pairs = rng.uniform(-np.pi, np.pi, (5000, 2))
    pairs[:2500, 1] = pairs[:2500, 0] + np.pi
    roots = pairs.repeat(2, axis=1)
    points = circle_points(list(coefficients(roots)))
    assert worst(np.array([np.arctan2(point.s, point.c) for point in points]), roots) < 1e-4


def test_a_function_of_first_degree_has_its_two_roots():
    found = circle_roots(np.zeros(1), np.ones(1), np.zeros(1), np.zeros(1), np.zeros(1))
    assert worst(found, np.array([[np.pi / 2, -np.pi / 2]])) < 1e-12


def test_a_function_that_vanishes_everywhere_gives_finite_angles():
    assert np.isfinite(circle_roots(*np.zeros((5, 3)))).all()


def test_complex_roots_give_finite_angles():
    assert np.isfinite(circle_roots(*np.array([[3.0], [1.0], [0.2], [0.1], [0.4]]))).all()


@given(unit_vectors, vectors, angles)
def test_a_turn_onto_a_turned_vector_is_that_turn(s, a, theta):
    found = turn_onto(s, a, rotate(s, theta) @ a)
    if abs(float(dot(cross(s, a), cross(s, a)))) > 1e-6:
        assert abs(np.sin((found - theta) / 2)) < 1e-6


@given(unit_vectors, vectors, vectors, angles)
def test_turns_to_a_level_reach_it(s, a, m, theta):
    level = dot(m, rotate(s, theta) @ a)
    for found in level_turns(s, a, m, level)[:2]:
        assert abs(dot(m, rotate(s, found) @ a) - level) < 1e-6


@given(unit_vectors, vectors, vectors, st.floats(1.0, 100.0))
def test_a_level_out_of_reach_gives_the_highest_place(s, a, m, more):
    top = max(dot(m, rotate(s, x) @ a) for x in np.linspace(-np.pi, np.pi, 181))
    for found in level_turns(s, a, m, top + more)[:2]:
        assert dot(m, rotate(s, found) @ a) >= top - 1e-9


@given(unit_vectors, unit_vectors, vectors, angles, angles)
def test_two_turns_bring_a_vector_where_two_turns_brought_it(s1, s2, a, first, second):
    b = rotate(s1, first) @ rotate(s2, second) @ a
    for one, two, _ in two_turns(s1, s2, a, b):
        assert np.abs(as_array(rotate(s1, one) @ rotate(s2, two) @ a - b)).max() < 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_three_turns_make_the_rotation_and_one_triple_is_the_given_one(seed):
    rng = np.random.default_rng(seed)
    s1, s2, s3 = (Vector(*map(float, v / np.linalg.norm(v))) for v in rng.normal(size=(3, 3)))
    given_angles = rng.uniform(-np.pi, np.pi, 3)
    axes = [as_array(s) for s in (s1, s2, s3)]
    R = np.linalg.multi_dot(
        [Rotation.from_rotvec(x * s).as_matrix() for x, s in zip(given_angles, axes, strict=True)]
    )
    wanted = rotate(s1, given_angles[0]) @ rotate(s2, given_angles[1]) @ rotate(s3, given_angles[2])
    np.testing.assert_allclose(as_array(wanted), R, atol=1e-14)
    found = [triple for *triple, _ in three_turns(s1, s2, s3, wanted)]
    for triple in found:
        made = [Rotation.from_rotvec(x * s).as_matrix() for x, s in zip(triple, axes, strict=True)]
        np.testing.assert_allclose(np.linalg.multi_dot(made), R, atol=1e-12)
    gaps = [np.abs(np.sin((np.array(triple) - given_angles) / 2)).max() for triple in found]
    assert min(gaps) < 1e-12


def knee(x, y, z):
    """First branch of a spherical leg for an upright foot at (x, y, z)."""
    chain = SerialChain.of(load_robot("bioloid"), "left_leg")
    hip = chain.screws[0].s0
    turns = point_turns(chain, (3, 4, 5), hip)
    assert callable(turns)
    D = Pose(UNTURNED, Vector(x, y, z) - chain.tip.p)
    return spherical_hip_branches(chain.screws, hip, turns, D)[0][:6]


def test_one_formula_serves_numbers_batches_symbols_and_gradients(x64):
    place = (0.02, 0.05, -0.16)
    numbers = np.array(knee(*place))
    batch = np.array([np.broadcast_to(a, 3) for a in knee(*(np.full(3, c) for c in place))])
    np.testing.assert_allclose(batch, np.repeat(numbers[:, None], 3, axis=1), atol=1e-14)

    symbols = sympy.symbols("x y z", real=True)
    symbolic = [sympy.sympify(a) for a in knee(*symbols)]
    values = dict(zip(symbols, place, strict=True))
    np.testing.assert_allclose([float(a.subs(values)) for a in symbolic], numbers, atol=1e-12)

    slope = jax.jit(jax.grad(lambda z: knee(place[0], place[1], z)[3]))(place[2])
    h = 1e-6
    difference = (knee(*place[:2], place[2] + h)[3] - knee(*place[:2], place[2] - h)[3]) / (2 * h)
    assert float(slope) == pytest.approx(difference, rel=1e-6)
