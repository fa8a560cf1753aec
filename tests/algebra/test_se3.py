"""Poses: group axioms, exponential and logarithm against independent oracles, their Jacobians, records."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError

import mpmath as mp
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation as ScipyRotation

from screwkin.algebra import se3
from screwkin.algebra.scalar import sqrt
from screwkin.algebra.se3 import Pose, Rotation, Twist, Vector, as_array
from tests.strategies import (
    EPS,
    angles,
    assert_close,
    numbers_of,
    poses,
    turns,
    twists,
    unit_vectors,
    vectors,
)

AXES = [
    *(Vector(*(sign * float(i == k) for i in range(3))) for k in range(3) for sign in (1, -1)),
    *(
        Vector(*np.array(v) / np.linalg.norm(v))
        for v in [(1, 1, 0), (0, 1, -1), (1, 1, 1), (-3, 2, 6), (1e-9, 1, 0)]
    ),
]
THETAS = [
    0.0,
    1e-300,
    1e-16,
    1e-9,
    1e-8,
    1e-5,
    1e-3,
    0.25,
    0.5,
    0.999999,
    1.0,
    1.000001,
    2.0,
    2.2,
    3.0,
    3.1622,
    3.2,
    6.0,
]
"""Both sides of every threshold of the entire functions (in theta: 0.25, 1, 2, 3, sqrt 10)."""


def hat(twist: Twist) -> np.ndarray:
    """The twist as a 4 x 4 matrix."""
    (x, y, z), (a, b, c) = twist.omega, twist.v
    return np.array([[0, -z, y, a], [z, 0, -x, b], [-y, x, 0, c], [0, 0, 0, 0]], dtype=float)


def skew(v: Vector) -> np.ndarray:
    return hat(Twist(v, se3.ZERO))[:3, :3]


def ad(twist: Twist) -> np.ndarray:
    """Matrix of the bracket: ad(a) b = [a, b]."""
    w, v = skew(twist.omega), skew(twist.v)
    return np.block([[w, np.zeros((3, 3))], [v, w]])


def exact_exp(twist: Twist) -> np.ndarray:
    with mp.workdps(40):
        return np.array(mp.expm(mp.matrix(hat(twist).tolist())).tolist(), dtype=float)


# --- vectors and records ---


@given(vectors, vectors)
def test_vector_algebra_is_that_of_arrays(a, b):
    x, y = as_array(a), as_array(b)
    assert_close(a + b, x + y)
    assert_close(a - b, x - y)
    assert_close(-a * 2.5 + 0.5 * b, -x * 2.5 + 0.5 * y)
    assert_close(a / 3, x / 3)
    assert_close(se3.dot(a, b), np.dot(x, y))
    assert_close(se3.cross(a, b), np.cross(x, y))
    assert_close(se3.norm(a), np.linalg.norm(x))


@given(twists, twists)
def test_twists_form_a_vector_space(a, b):
    x, y = as_array(a), as_array(b)
    assert_close(a + b, x + y)
    assert_close(a - b, x - y)
    assert_close(-a, -x)
    assert_close(a * 2.5, x * 2.5)
    assert_close(2.5 * a, x * 2.5)
    assert_close(a / 3, x / 3)


def test_records_are_frozen_and_numpy_leaves_them_whole():
    v = Vector(1.0, 2.0, 3.0)
    with pytest.raises(FrozenInstanceError):
        v.x = 2.0
    batch = np.array([1.0, 10.0])
    for product in (batch * v, v * batch, np.float64(2.0) * v):
        assert isinstance(product, Vector)
    np.testing.assert_array_equal(as_array(batch * v), [[1, 2, 3], [10, 20, 30]])


def test_a_twist_is_omega_first_and_v_second():
    """Pinned, because prose alone drifts: [omega; v] everywhere, in arrays as in records."""
    twist = Twist(omega=Vector(1.0, 2.0, 3.0), v=Vector(4.0, 5.0, 6.0))
    np.testing.assert_array_equal(as_array(twist), [1, 2, 3, 4, 5, 6])
    assert numbers_of(se3.twist_from_array(np.arange(6.0)).omega) == [0, 1, 2]
    quarter = se3.exp(se3.twist_from_array(np.array([0, 0, math.pi / 2, 0, 0, 0])))
    assert_close(quarter @ se3.X, se3.Y)
    assert_close(se3.exp(se3.twist_from_array(np.array([0, 0, 0, 1.0, 2.0, 3.0]))).p, [1, 2, 3], 0)


def test_a_pose_takes_the_second_frame_to_the_first():
    """T_a_b @ p_b = p_a, and inner names cancel."""
    T_a_b = Pose(se3.rotate(se3.Z, math.pi / 2), Vector(1.0, 0.0, 0.0))
    T_b_c = Pose(se3.UNTURNED, Vector(0.0, 2.0, 0.0))
    assert_close(T_a_b @ Vector(1.0, 0.0, 0.0), [1, 1, 0])
    assert_close((T_a_b @ T_b_c).p, [-1, 0, 0])


@given(twists, twists, twists)
def test_the_bracket_is_the_commutator_and_satisfies_jacobi(a, b, c):
    assert_close(hat(se3.bracket(a, b)), hat(a) @ hat(b) - hat(b) @ hat(a))
    bracket = se3.bracket
    total = bracket(a, bracket(b, c)) + bracket(b, bracket(c, a)) + bracket(c, bracket(a, b))
    assert_close(total, np.zeros(6), 1e-12)
    assert_close(as_array(bracket(a, b)), ad(a) @ as_array(b), 1e-13)


# --- group ---


@given(poses, poses, poses, vectors)
def test_poses_form_a_group_that_acts_on_points(a, b, c, p):
    assert_close((a @ b) @ c, a @ (b @ c))
    assert_close(a @ se3.IDENTITY, a, 0)
    assert_close(se3.IDENTITY @ a, a, 0)
    assert_close(a @ a.inverse, se3.IDENTITY)
    assert_close(a.inverse @ a, se3.IDENTITY)
    assert_close((a @ b) @ p, a @ (b @ p))
    assert_close((a @ b).inverse, b.inverse @ a.inverse)
    assert_close(as_array(a @ b), as_array(a) @ as_array(b))


@given(unit_vectors, angles)
def test_rodrigues_formula_agrees_with_scipy_and_with_the_exponential(s, theta):
    turned = se3.rotate(s, theta)
    assert_close(turned, ScipyRotation.from_rotvec(as_array(s) * theta).as_matrix())
    assert_close(turned, se3.rotation_exp(s * theta))
    assert_close(turned.T @ turned, np.eye(3))
    assert np.linalg.det(as_array(turned)) == pytest.approx(1)
    assert_close(turned @ s, s)


# --- exponential and logarithm ---


@pytest.mark.parametrize("theta", THETAS)
def test_exp_is_exact_at_every_angle_with_a_translation_of_order_one(theta):
    """A small rotation with a small translation would hide a wrong coefficient; this one does not."""
    for axis in AXES:
        twist = Twist(axis * theta, Vector(0.3, -1.0, 0.7))
        np.testing.assert_allclose(as_array(se3.exp(twist)), exact_exp(twist), rtol=0, atol=4 * EPS)


@given(twists)
def test_exp_agrees_with_the_matrix_exponential_of_scipy(twist):
    assert_close(se3.exp(twist), scipy.linalg.expm(hat(twist)), 1e-13)


@given(st.builds(Twist, st.builds(lambda s, t: s * t, unit_vectors, st.floats(1e-3, 3.0)), vectors))
def test_log_agrees_with_the_matrix_logarithm_of_scipy(twist):
    pose = se3.exp(twist)
    assert_close(hat(se3.log(pose)), np.real(scipy.linalg.logm(as_array(pose))), 1e-9)


@given(poses)
def test_exp_of_log_is_the_pose_and_no_angle_exceeds_a_half_turn(pose):
    twist = se3.log(pose)
    assert_close(se3.exp(twist), pose, 2e-14)
    assert se3.norm(twist.omega) <= math.pi * (1 + EPS)


@pytest.mark.parametrize("theta", [t for t in THETAS if t < math.pi])
def test_log_of_exp_is_the_twist_below_a_half_turn(theta):
    for axis in AXES:
        twist = Twist(axis * theta, Vector(0.3, -1.0, 0.7))
        assert_close(se3.log(se3.exp(twist)), twist, 4e-15)


def test_log_without_rotation_is_the_translation_exactly():
    pose = Pose(se3.rotation_from_array(np.eye(3)), Vector(0.3, -1.0, 0.7))
    assert numbers_of(se3.log(pose)) == [0, 0, 0, 0.3, -1.0, 0.7]
    assert numbers_of(se3.log(Pose(se3.UNTURNED, Vector(1, 0, 2.5)))) == [0, 0, 0, 1, 0, 2.5]
    assert numbers_of(se3.log(se3.IDENTITY)) == [0] * 6


def test_log_of_a_tiny_rotation_keeps_all_its_digits():
    for theta in (1e-5, 1e-9, 1e-20, 1e-150):
        w = Vector(0.6 * theta, -0.8 * theta, 0.0)
        np.testing.assert_allclose(
            numbers_of(se3.rotation_log(se3.rotation_exp(w))), numbers_of(w), rtol=4 * EPS
        )


SHORT = [0.0, 1e-16, 1e-15, 1e-12, 1e-9, 1e-8, 1e-6, 1e-4, 1e-2, 0.5]


@pytest.mark.parametrize("short", SHORT)
def test_log_near_a_half_turn_is_exact_about_every_axis(short):
    """At a half turn both axes are right; just below it, only the axis itself."""
    theta = math.pi - short
    for axis in AXES:
        pose = Pose(se3.rotate(axis, theta), Vector(0.3, -1.0, 0.7))
        twist = se3.log(pose)
        assert_close(se3.exp(twist), pose, 3e-15)
        assert se3.norm(twist.omega) == pytest.approx(theta, rel=2 * EPS)
        sign = math.copysign(1, se3.dot(twist.omega, axis))
        assert sign > 0 or short < 1e-15
        assert_close(twist.omega * sign, axis * theta, 1e-15)


def test_log_of_exact_half_turns_is_pi_along_the_axis():
    for x, y, z in ((1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        w = se3.rotation_log(se3.rotation_from_array(np.diag([x, y, z]).astype(float)))
        assert np.abs(numbers_of(w)).tolist() == [math.pi * (c > 0) for c in (x, y, z)]


def test_log_is_continuous_where_it_changes_its_formula():
    """The logarithm switches from series to arctangent where sin^2(theta / 2) = 0.05."""
    middle = 2 * math.asin(math.sqrt(0.05))
    for axis in AXES:
        for theta in np.linspace(middle - 1e-12, middle + 1e-12, 21).tolist():
            assert_close(se3.rotation_log(se3.rotate(axis, theta)), axis * theta, 2e-15)


@given(turns)
def test_log_forgives_a_rotation_matrix_with_the_rounding_of_a_file(w):
    rounded = se3.rotation_from_array(np.round(as_array(se3.rotation_exp(w)), 9))
    assert_close(se3.rotation_exp(se3.rotation_log(rounded)), rounded, 5e-9)


# --- arrays ---


def test_records_and_arrays_convert_both_ways_in_every_batch_shape():
    rng = np.random.default_rng(7)
    for batch in ((), (5,), (2, 3), (0,)):
        assert_close(
            se3.exp(se3.twist_from_array(np.zeros((*batch, 6)))), np.broadcast_to(np.eye(4), (*batch, 4, 4))
        )
        for size, convert in ((3, se3.vector_from_array), (6, se3.twist_from_array)):
            array = rng.normal(size=(*batch, size))
            np.testing.assert_array_equal(as_array(convert(array)), array)
        array = as_array(se3.exp(se3.twist_from_array(rng.normal(size=(*batch, 6)))))
        assert array.shape == (*batch, 4, 4)
        np.testing.assert_array_equal(as_array(se3.pose_from_array(array)), array)
        np.testing.assert_array_equal(
            as_array(se3.rotation_from_array(array[..., :3, :3])), array[..., :3, :3]
        )
        np.testing.assert_array_equal(array[..., 3, :], np.broadcast_to([0, 0, 0, 1], (*batch, 4)))


def test_a_sequence_of_records_stands_between_batch_and_components():
    batch = np.linspace(0, 1, 7)
    poses = [se3.IDENTITY, Pose(se3.rotate(se3.Z, batch), se3.ZERO)]
    stacked = as_array(poses)
    assert stacked.shape == (7, 2, 4, 4)
    np.testing.assert_array_equal(stacked[:, 0], np.broadcast_to(np.eye(4), (7, 4, 4)))
    np.testing.assert_allclose(stacked[:, 1, 1, 0], np.sin(batch))
    assert as_array([se3.X, se3.Y]).tolist() == [[1, 0, 0], [0, 1, 0]]
    assert as_array(se3.X, batch=(2, 5)).shape == (2, 5, 3)


def test_conversion_copies_so_that_nobody_writes_into_anybodys_array():
    array = np.arange(12.0).reshape(2, 6)
    twist = se3.twist_from_array(array)
    copy = as_array(twist)
    array[:] = -1.0
    np.testing.assert_array_equal(as_array(twist), copy)


def test_structure_stays_structure_through_products_of_poses():
    """What keeps symbols free of factors 1.0, and formulas half as long."""
    turned = Pose(se3.rotate(se3.Y, 0.3), Vector(0, 0, -0.1))
    product = turned @ turned
    kinds = [type(x) for x in (*product.R.x, *product.R.y, *product.R.z, *product.p)]
    assert kinds == [float, int, float, int, int, int, float, int, float, float, int, float]
    assert type(sqrt(se3.norm(se3.X))) is int
    assert isinstance(se3.map_scalars(lambda x: x, product).R, Rotation)
