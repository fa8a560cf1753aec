"""Least squares within limits, against scipy's and against the conditions of a minimum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from screwkin.algebra.bounded import bounded_least_squares
from screwkin.algebra.newton import Residual

LOW, HIGH = np.array([-1.0, -0.5, -2.0, -0.3]), np.array([0.4, 0.5, 1.0, 2.0])


def linear(A: Any, b: Any) -> Residual:
    """The residual b - A x of every sample."""
    return lambda x, samples: (b[samples] - (A[samples] @ x[..., None])[..., 0], A[samples])


@pytest.mark.parametrize("rows", [4, 6])
def test_solutions_of_linear_equations_are_scipys_at_limits_and_inside(rows: int) -> None:
    rng = np.random.default_rng(rows)
    A = rng.normal(size=(50, rows, 4)) + 2 * np.eye(rows, 4)
    b = (A @ rng.uniform(LOW, HIGH, (50, 4))[..., None])[..., 0]
    result = bounded_least_squares(linear(A, b), np.zeros((50, 4)), LOW, HIGH, 1e-12)
    arrived = result.residual < 1e-12
    assert arrived.mean() > 0.95
    for k in np.flatnonzero(arrived):
        expected = lsq_linear(A[k], b[k], (LOW, HIGH), tol=1e-14).x
        np.testing.assert_allclose(result.x[k], expected, atol=1e-6)


def test_no_coordinate_ever_leaves_its_limits() -> None:
    rng = np.random.default_rng(1)
    A, b = rng.normal(size=(30, 3, 4)), 5 * rng.normal(size=(30, 3))
    seen = []

    def residual(x: Any, samples: Any) -> tuple[Any, Any]:
        seen.append(x)
        return linear(A, b)(x, samples)

    bounded_least_squares(residual, 9 * rng.normal(size=(30, 4)), LOW, HIGH, 1e-12)
    every = np.concatenate(seen)
    assert ((every >= LOW) & (every <= HIGH)).all()


def test_a_circle_is_reached_quadratically_and_redundancy_is_no_matter() -> None:
    def residual(x: Any, samples: Any) -> tuple[Any, Any]:
        return 4.0 - (x**2).sum(axis=1, keepdims=True), 2 * x[:, None]

    x0 = np.random.default_rng(2).uniform(0.5, 1.0, (20, 3))
    result = bounded_least_squares(residual, x0, np.full(3, -9.0), np.full(3, 9.0), 1e-12)
    assert result.residual.max() < 1e-12
    assert result.iterations.max() < 12


def test_a_sample_is_computed_alike_alone_and_beside_others_to_the_last_bit() -> None:
    rng = np.random.default_rng(3)
    A, b, x0 = rng.normal(size=(40, 3, 4)), rng.normal(size=(40, 3)), rng.normal(size=(40, 4))
    whole = bounded_least_squares(linear(A, b), x0, LOW, HIGH, 1e-12)
    for k in range(40):
        alone = bounded_least_squares(linear(A[k, None], b[k, None]), x0[k, None], LOW, HIGH, 1e-12)
        np.testing.assert_array_equal(alone.x[0], whole.x[k])
        assert alone.iterations[0] == whole.iterations[k]
