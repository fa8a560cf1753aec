"""Zeros of trigonometric polynomials that were made of them, clusters included."""

from __future__ import annotations

import numpy as np
import pytest

from screwkin.algebra.harmonics import cells, crossing, derivatives, equal_angles, harmonics


def polynomial(zeros: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The product of sin((x - zero) / 2): of degree n / 2 for n zeros."""
    return np.prod(np.sin((x - zeros[:, None]) / 2), axis=0)


def zeros_of(values: np.ndarray) -> np.ndarray:
    """Zeros of one polynomial, ascending."""
    terms = harmonics(values[None])
    found = cells(terms)
    row = list(terms[0])
    bottom = [
        float(crossing(row, low, high, 1))
        for low, high, dips in zip(found.low, found.high, found.dips, strict=True)
        if dips
    ]
    crossed = [
        (x, low, high)
        for x, low, high in zip(bottom, found.low[found.dips], found.high[found.dips], strict=True)
        if derivatives(row, x, (0,))[0] * derivatives(row, low, (0,))[0] < 0
    ]
    ends = [(low, high) for low, high in zip(found.low[~found.dips], found.high[~found.dips], strict=True)]
    ends += [pair for x, low, high in crossed for pair in ((low, x), (x, high))]
    return np.sort([float(crossing(row, low, high, 0)) for low, high in ends])


@pytest.mark.parametrize("gap", [1.0, 0.1, 0.01, 1e-3])
def test_every_real_zero_is_found_to_rounding_also_in_clusters(gap: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        zeros = np.sort(np.r_[rng.uniform(0.5, 5.5, 4), 3.0 + gap * rng.uniform(0, 1, 2)])
        values = polynomial(zeros, equal_angles(7))
        np.testing.assert_allclose(zeros_of(values), zeros, atol=1e-9 / gap)


@pytest.mark.parametrize("count", [3, 4])
def test_zeros_that_share_a_cell_of_the_grid_are_found(count: int) -> None:
    """Of 48 cells a degree each is a thirtieth wide here; the values' signs at its ends do not show them."""
    rng = np.random.default_rng(2)
    for start in np.linspace(2.5, 2.6, 40):
        apart = np.cumsum(rng.uniform(0.004, 0.008, count))
        zeros = np.r_[start + apart, rng.uniform(3.5, 5.5, 6 - count)]
        values = polynomial(zeros, equal_angles(7))
        np.testing.assert_allclose(zeros_of(values), np.sort(zeros), atol=1e-4)


def test_derivatives_are_those_of_finite_differences() -> None:
    terms = list(np.random.default_rng(0).normal(size=10))
    value, slope, curvature = derivatives(terms, 0.7, (0, 1, 2))
    h = 1e-4
    before, after = (derivatives(terms, 0.7 + d, (0,))[0] for d in (-h, h))
    assert slope == pytest.approx((after - before) / (2 * h), abs=1e-6)
    assert curvature == pytest.approx((after - 2 * value + before) / h**2, abs=1e-4)
