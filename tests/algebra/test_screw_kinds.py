"""One formula, any scalar: floats, batches, jit(vmap), derivatives and symbols give the same mathematics."""

from __future__ import annotations

import math
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import sympy
from hypothesis import given, settings

from screwkin.algebra import se3
from screwkin.algebra.screws import (
    INFINITE,
    Screw,
    Wrench,
    carry,
    displacement,
    power,
    reciprocal_product,
    screw_from_twist,
    transport,
    transport_wrench,
)
from screwkin.algebra.se3 import (
    Pose,
    Twist,
    Vector,
    as_array,
    pose_from_array,
    twist_from_array,
    vector_from_array,
)
from tests.strategies import EPS, assert_close, screws

pytestmark = pytest.mark.usefixtures("x64")

SCREW = Screw(Vector(0.6, 0, -0.8), Vector(0.1, -0.2, 0.3), 0.05)
RNG = np.random.default_rng(20)


def wrench_from_array(array):
    twist = twist_from_array(array)
    return Wrench(twist.omega, twist.v)


def entry(array, i):
    return se3.unstack(array)[i]


FORMULAS = {
    "exp": lambda x: as_array(se3.exp(twist_from_array(x[..., :6]))),
    "log": lambda x: as_array(se3.log(se3.exp(twist_from_array(x[..., :6] / 2)))),
    "inverse": lambda x: as_array(se3.exp(twist_from_array(x[..., :6])).inverse),
    "displacement": lambda x: as_array(
        displacement(SCREW, entry(x, 0)) @ displacement(Screw(se3.Y, se3.Z), entry(x, 1))
    ),
    "carry": lambda x: as_array(carry(displacement(SCREW, entry(x, 0)), Screw(se3.X, se3.Y, 0.5)).twist),
    "transport": lambda x: as_array(
        transport(displacement(SCREW, entry(x, 0)), twist_from_array(x[..., 6:]))
    ),
    "wrench": lambda x: as_array(
        transport_wrench(displacement(SCREW, entry(x, 0)), wrench_from_array(x[..., 6:]))
    ),
    "reciprocal": lambda x: reciprocal_product(twist_from_array(x[..., :6]), twist_from_array(x[..., 6:])),
    "power": lambda x: power(wrench_from_array(x[..., :6]), twist_from_array(x[..., 6:])),
    "poinsot": lambda x: as_array(screw_from_twist(twist_from_array(x[..., :6]))[0].twist),
}
"""Functions of twelve numbers."""


@pytest.mark.parametrize("name", FORMULAS)
def test_floats_batches_compiled_batches_and_symbols_agree(name):
    formula = FORMULAS[name]
    batch = RNG.uniform(-1, 1, size=(6, 12))
    one_by_one = np.array([formula(x) for x in batch])
    np.testing.assert_allclose(formula(batch), one_by_one, rtol=0, atol=1e-14)
    np.testing.assert_allclose(jax.jit(jax.vmap(formula))(batch), one_by_one, rtol=0, atol=1e-14)

    symbols = np.array(sympy.symbols("x0:12", real=True), dtype=object)
    written = formula(symbols)
    evaluate = sympy.lambdify(
        symbols, written.tolist() if isinstance(written, np.ndarray) else written, "numpy"
    )
    np.testing.assert_allclose(np.array(evaluate(*batch[0]), float), one_by_one[0], rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", FORMULAS)
def test_compiled_gradients_of_a_batch_are_the_differences_of_the_formula(name):
    formula = FORMULAS[name]
    batch = RNG.uniform(-1, 1, size=(4, 12))
    weights = RNG.normal(size=np.shape(formula(batch[0])))

    def total(x):
        return (formula(x) * weights).sum()

    gradients = jax.jit(jax.vmap(jax.grad(total)))(batch)
    h = 1e-6
    for x, gradient in zip(batch, gradients, strict=True):
        steps = np.eye(12) * h
        differences = [(total(x + step) - total(x - step)) / (2 * h) for step in steps]
        np.testing.assert_allclose(gradient, differences, rtol=1e-6, atol=1e-7)


def test_numbers_in_numbers_out():
    """NumPy in, NumPy out; JAX in, JAX out; float64 stays."""
    for name, formula in FORMULAS.items():
        x = RNG.uniform(-1, 1, size=(3, 12))
        assert isinstance(formula(x), np.ndarray), name
        out = formula(jnp.array(x))
        assert isinstance(out, jax.Array), name
        assert out.dtype == np.float64, name


# --- second derivatives at home ---

GENERATORS = np.array([as_array(Twist(Vector(*e[:3]), Vector(*e[3:]))) for e in np.eye(6).tolist()])
HATS = np.zeros((6, 4, 4))
for _k, (_x, _y, _z, _a, _b, _c) in enumerate(GENERATORS):
    HATS[_k] = [[0, -_z, _y, _a], [_z, 0, -_x, _b], [-_y, _x, 0, _c], [0, 0, 0, 0]]
ADS = np.array(
    [as_array(se3.bracket(twist_from_array(g), twist_from_array(np.eye(6)))).T for g in GENERATORS]
)
"""Matrices of the bracket with each generator."""


def symmetric_products(matrices):
    """Second derivatives at 0 of X(x)^2: M_i M_j + M_j M_i in the last two axes (i, j)."""
    products = np.einsum("iab,jbc->acij", matrices, matrices)
    return products + np.swapaxes(products, 2, 3)


def along(f, x, u):
    """Derivative of a function of x (B, n) along u (B, n), sample by sample.

    All samples at once, operation by operation: a Jacobian's many shapes are compiled one by one.
    """
    return jax.jvp(f, (x,), (jnp.asarray(u),))[1]


def twice_along(f, x, u, v):
    """Second derivative of a function of x (B, n) along u and v (B, n), sample by sample."""
    return along(lambda x: along(f, x, u), x, v)


def every_pair(n):
    """Unit vectors (n n, n) and (n n, n): all pairs."""
    return np.repeat(np.eye(n), n, axis=0), np.tile(np.eye(n), (n, 1))


def exponential(x):
    return as_array(se3.exp(twist_from_array(x)))


@cache
def hessian_of_exp_at_zero():
    """(4, 4, 6, 6)."""
    second = twice_along(exponential, jnp.zeros((36, 6)), *every_pair(6))
    return np.moveaxis(np.reshape(second, (6, 6, 4, 4)), (0, 1), (2, 3))


def test_second_derivative_of_exp_at_zero_is_that_of_its_series():
    """exp = 1 + X + X^2 / 2 + ...; libraries are known to be off by a factor of two here."""
    np.testing.assert_allclose(hessian_of_exp_at_zero(), symmetric_products(HATS) / 2, rtol=0, atol=2 * EPS)


def test_log_of_a_product_has_the_mixed_derivative_of_baker_campbell_hausdorff():
    """log(exp a exp b) = a + b + [a, b] / 2 + ...: value, slopes and all second derivatives at 0."""

    def product(x):
        return as_array(
            se3.log(se3.exp(twist_from_array(x[..., :6])) @ se3.exp(twist_from_array(x[..., 6:])))
        )

    zeros, (u, v) = jnp.zeros((144, 12)), every_pair(12)
    slopes = np.array(along(product, zeros, v))[:12].T
    np.testing.assert_allclose(slopes, np.hstack([np.eye(6), np.eye(6)]), rtol=0, atol=2 * EPS)
    hessian = np.reshape(twice_along(product, zeros, u, v), (12, 12, 6)).transpose(2, 0, 1)
    np.testing.assert_allclose(hessian[:, :6, :6], 0, rtol=0, atol=4 * EPS)
    np.testing.assert_allclose(hessian[:, 6:, 6:], 0, rtol=0, atol=4 * EPS)
    np.testing.assert_allclose(hessian[:, :6, 6:], np.transpose(ADS, (1, 0, 2)) / 2, rtol=0, atol=4 * EPS)


def test_second_derivative_of_exp_at_zero_is_what_sympy_finds():
    """An independent limit: the closed form along a ray, expanded in the ray's length."""
    s = sympy.Symbol("s", positive=True)
    ray = [sympy.Rational(k, 7) * s for k in (3, -6, 2, 5, 1, -4)]  # |omega| = s
    symbolic = se3.exp(Twist(Vector(*ray[:3]), Vector(*ray[3:])))
    direction = np.array([float(r / s) for r in ray])
    found = np.einsum("abij,i,j->ab", hessian_of_exp_at_zero(), direction, direction)
    expected = np.zeros((4, 4))
    for (i, j), entry in np.ndenumerate(as_array(symbolic)):
        expected[i, j] = float(sympy.series(sympy.sympify(entry), s, 0, 3).removeO().coeff(s, 2) * 2)
    np.testing.assert_allclose(found, expected, rtol=0, atol=4 * EPS)


def test_gradients_are_finite_at_zero_on_thresholds_and_at_a_half_turn():
    """Reverse, and forward twice along generic directions: one component without a number leaves none."""
    angles = [0.0, 1e-160, 1e-8, 0.2499, 0.25, 0.5, 1.0, 2.0, 3.0, math.sqrt(10), math.pi]
    axes = np.vstack([np.eye(3), -np.eye(3), [[0.6, 0, 0.8]]])
    points = jnp.array([[*(axis * angle), 0.3, -1.0, 0.7] for axis in axes for angle in angles])
    u, v = RNG.normal(size=(2, *points.shape))

    def there_and_back(x):
        pose = se3.exp(twist_from_array(x))
        return jnp.concatenate([as_array(pose).reshape(len(x), 16), as_array(se3.log(pose))], axis=1)

    weights = RNG.normal(size=(len(points), 22))
    assert np.isfinite(jax.grad(lambda x: (there_and_back(x) * weights).sum())(points)).all()
    assert np.isfinite(twice_along(there_and_back, points, u, v)).all()


@given(screws.filter(lambda screw: not screw.is_translation))
@settings(max_examples=20)
def test_the_derivative_of_a_displacement_at_home_is_the_screw_itself(screw):
    def moved(theta):
        return as_array(displacement(screw, theta))

    (x, y, z), (a, b, c) = screw.twist.omega, screw.twist.v
    hat = np.array([[0, -z, y, a], [z, 0, -x, b], [-y, x, 0, c], [0, 0, 0, 0]], float)
    slope, bend = jax.jvp(lambda theta: jax.jvp(moved, (theta,), (1.0,))[1], (0.0,), (1.0,))
    assert_close(slope, hat)
    assert_close(bend, hat @ hat)


# --- single precision ---


def test_a_small_twist_in_single_precision_is_right_to_single_precision():
    """A library is known to be off by 1.5 mm per metre at 0.003 rad."""
    for theta in (0.0, 1e-6, 0.003, 0.1, 1.0, 3.0):
        x = np.array([0.6 * theta, 0.0, -0.8 * theta, 0.3, -1.0, 0.7])
        single = as_array(se3.exp(twist_from_array(jnp.array(x, dtype=np.float32))))
        assert single.dtype == np.float32
        np.testing.assert_allclose(single, as_array(se3.exp(twist_from_array(x))), rtol=0, atol=5e-7)
        back = as_array(se3.log(pose_from_array(single)))
        assert back.dtype == np.float32
        np.testing.assert_allclose(back, x, rtol=0, atol=5e-6)


# --- records and JAX ---


def test_records_cross_jit_and_vmap_and_come_back_as_records():
    batch = RNG.normal(size=(5, 6))
    se3.register_with_jax()
    poses = jax.jit(jax.vmap(se3.exp))(twist_from_array(jnp.array(batch)))
    assert isinstance(poses, Pose)
    np.testing.assert_allclose(as_array(poses), as_array(se3.exp(twist_from_array(batch))), atol=1e-14)
    turned = jax.jit(lambda pose, v: pose @ v)(se3.IDENTITY, se3.X)
    assert_close(turned, [1, 0, 0], 0)
    se3.register_with_jax()  # a second time changes nothing


def test_new_numbers_do_not_compile_again_and_a_joint_kind_does():
    traced = []

    @jax.jit
    def moved(screw, theta):
        traced.append(screw)
        return displacement(screw, theta)

    se3.register_with_jax()
    for theta in (0.1, 0.2):
        for pitch in (0.0, 0.5):
            screw = Screw(Vector(0.0, 0.6, 0.8), Vector(theta, 1.0, 2.0), pitch)
            assert_close(moved(screw, theta), displacement(screw, theta))
    assert len(traced) == 1
    for theta in (0.1, 0.2):
        slider = Screw(Vector(0.0, 0.6, 0.8), Vector(1.0, 1.0, 2.0), INFINITE)
        assert_close(moved(slider, theta), displacement(slider, theta), 0)
    assert len(traced) == 2
    back = jax.jit(lambda screw: screw)(slider)
    assert back.is_translation
    assert [type(x) for x in jax.tree.leaves(Screw(se3.X, se3.ZERO, 2.0))] == [int] * 6 + [float]


def test_one_may_differentiate_by_the_components_of_a_dense_record():
    se3.register_with_jax()
    screw = se3.map_scalars(float, Screw(se3.Z, Vector(1, 0, 0)))
    gradient = jax.grad(lambda screw: (displacement(screw, 0.3) @ Vector(0.0, 1.0, 0.0)).z)(screw)
    assert isinstance(gradient, Screw)
    assert float(gradient.pitch) == pytest.approx(0.3)
    assert np.isfinite([float(x) for x in jax.tree.leaves(gradient)]).all()


def test_structure_mixes_with_compiled_numbers_under_strict_promotion():
    out = jax.jit(lambda a: as_array([se3.IDENTITY, Pose(se3.rotate(se3.Z, a), Vector(0, 1, 0.5))]))(0.3)
    assert out.shape == (2, 4, 4)
    assert out.dtype == np.float64
    np.testing.assert_allclose(out[1], as_array(Pose(se3.rotate(se3.Z, 0.3), Vector(0, 1, 0.5))), atol=1e-16)
    batch = jnp.linspace(0.0, 1.0, 4)
    assert as_array(se3.rotate(se3.X, batch)).shape == (4, 3, 3)
    assert as_array(vector_from_array(jnp.ones(3)), batch=(4,)).shape == (4, 3)


# --- symbols ---

Q, H, L = sympy.symbols("q h L", real=True)


def floats_in(record):
    return set().union(*(sympy.sympify(x).atoms(sympy.Float) for x in se3.leaves(record)))


def test_a_symbolic_displacement_is_what_a_student_would_write():
    """Structure has been folded: no factor 1.0, no sum with 0."""
    T = displacement(Screw(se3.Y, Vector(0, 0, L), H), Q)
    c, s = sympy.cos(Q), sympy.sin(Q)
    rotation = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    assert as_array(T.R).tolist() == rotation
    assert [sympy.expand(x - y) for x, y in zip(T.p, (-L * s, H * Q, L - L * c), strict=True)] == [0, 0, 0]
    assert sympy.count_ops(list(se3.leaves(T))) <= 12
    assert not floats_in(T)


def test_chains_jacobians_logarithms_and_screws_of_symbols_hold_no_floats():
    a = displacement(Screw(se3.Y, Vector(0, 0, L)), Q)
    b = displacement(Screw(Vector(0, 0, -1), Vector(L, 0, 0), sympy.Rational(1, 3)), H)
    assert not floats_in(a @ b)
    assert not floats_in((a @ b).inverse)
    assert not floats_in(transport(a @ b, Screw(se3.X, Vector(0, L, 0), INFINITE).twist))
    assert not floats_in(se3.log(a @ b))
    twist = Twist(Vector(0, 0, Q), Vector(L, H, 0))
    assert not floats_in(se3.exp(twist))
    found, rate = screw_from_twist(Twist(se3.Z, Vector(L, H, Q)))
    assert (found.pitch, rate) == (Q, 1)
    assert list(found.s0) == [-H, L, 0]
    assert not floats_in(found.s0)


def test_symbols_prove_what_numbers_can_only_suggest():
    """T(q) T(-q) = 1 and the Jacobian is the derivative, identically in q, the pitch and the place."""
    screw = Screw(se3.Z, Vector(L, 0, 0), H)
    T = as_array(displacement(screw, Q))
    product = T @ as_array(displacement(screw, -Q))
    assert sympy.simplify(sympy.Matrix(product)) == sympy.eye(4)
    spatial = sympy.Matrix(T).diff(Q) * sympy.Matrix(as_array(displacement(screw, Q).inverse))
    w, v = screw.twist.omega, screw.twist.v
    expected = [[0, -w.z, w.y, v.x], [w.z, 0, -w.x, v.y], [-w.y, w.x, 0, v.z], [0, 0, 0, 0]]
    assert sympy.simplify(spatial) == sympy.Matrix(expected)
