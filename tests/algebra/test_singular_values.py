"""Extreme singular values by formula against LAPACK: any matrices, and those that are hard."""

from __future__ import annotations

import math

import numpy as np
import pytest

from screwkin.algebra.singular_values import (
    TRUSTED,
    extreme_singular_values,
    least_singular_value,
    symmetric_functions,
    two_diagonals,
)
from screwkin.compiler.program import Recorder
from screwkin.compiler.run import run


def columns_of(A):
    """Columns of scalars of a batch of matrices (B, n, n)."""
    return [list(np.moveaxis(A, 0, -1)[:, k]) for k in range(A.shape[-1])]


def compared(A):
    """Asserts both values where they are sure; the share of samples that are."""
    with np.errstate(all="ignore"):
        found = extreme_singular_values(columns_of(A))
    expected = np.linalg.svd(A, compute_uv=False)
    sure = np.broadcast_to(found.error, len(A)) <= TRUSTED
    for value, true in ((found.least, expected[:, -1]), (found.largest, expected[:, 0])):
        value = np.broadcast_to(value, len(A))[sure]
        assert np.isfinite(value).all()
        assert (np.abs(value - true[sure]) <= 1e-12 * expected[sure, 0]).all()
    return sure.mean()


@pytest.mark.parametrize("n", range(1, 8))
def test_random_matrices(n):
    assert compared(np.random.default_rng(n).normal(size=(2000, n, n))) > 0.94


def test_ill_conditioned_matrices_keep_the_digits_that_lapack_keeps():
    rng = np.random.default_rng(0)
    U, s, V = np.linalg.svd(rng.normal(size=(2000, 6, 6)))
    s[:, -1] *= 10 ** rng.uniform(-14, 0, 2000)
    assert compared(U @ (s[:, :, None] * V)) > 0.85
    with np.errstate(all="ignore"):
        singular = least_singular_value(columns_of(np.ones((1, 4, 4))))
    assert singular[0] < 1e-15


@pytest.mark.parametrize("gap", [0.0, 1e-14, 1e-8, 1e-4, 1e-2])
@pytest.mark.parametrize("places", [(0, 1), (4, 5), (0, 1, 2), (3, 4, 5), (0, 1, 2, 3, 4, 5)])
def test_singular_values_that_fall_together_are_right_or_marked(gap, places):
    rng = np.random.default_rng(1)
    U, s, V = np.linalg.svd(rng.normal(size=(300, 6, 6)))
    for k, i in enumerate(places):
        s[:, i] = s[:, places[0]] * (1 - k * gap)
    compared(U @ (s[:, :, None] * V))


def test_zeros_found_only_at_run_time_are_right_or_marked():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(3000, 5, 5)) * (rng.random((3000, 5, 5)) < 0.4)
    compared(A)
    compared(np.eye(6)[[[3, 1, 5, 0, 2, 4], list(range(6))]])
    compared(np.zeros((1, 3, 3)))


def test_structural_zeros_divide_a_matrix_into_exact_parts():
    for A in (np.eye(6), np.eye(6)[[3, 1, 5, 0, 2, 4]], np.diag([3.0, -2.0, 0.5])):
        found = extreme_singular_values(A.astype(object).T.tolist())
        expected = np.linalg.svd(A, compute_uv=False)
        assert (found.least, found.largest, found.error) == (expected[-1], expected[0], 0.0)
    a, b, c, d = np.random.default_rng(3).normal(size=(4, 50))
    found = extreme_singular_values([[a, 0, b], [0, 0.25, 0], [c, 0, d]])
    A = np.zeros((50, 3, 3))
    A[:, 0, 0], A[:, 2, 0], A[:, 1, 1], A[:, 0, 2], A[:, 2, 2] = a, b, 0.25, c, d
    expected = np.linalg.svd(A, compute_uv=False)
    np.testing.assert_allclose(found.least, expected[:, -1], atol=1e-13)
    np.testing.assert_allclose(found.largest, expected[:, 0], rtol=1e-13)


def test_singular_matrices_of_plain_numbers():
    for columns in ([[1.0, 0, 0], [1.0, 1.0, 0], [0, 0, 0]], [[0.0] * 3] * 3, [[1.0] * 4] * 4):
        found = extreme_singular_values(columns)
        assert found.least == pytest.approx(0.0, abs=1e-15)
        assert not found.error <= TRUSTED or found.largest == pytest.approx(np.linalg.norm(columns, 2))


def test_symmetric_functions_are_the_coefficients_of_the_characteristic_polynomial():
    A = np.random.default_rng(4).normal(size=(5, 5))
    sums = symmetric_functions(*two_diagonals(A.T.tolist()))
    signs = (-1.0) ** np.arange(6)
    np.testing.assert_allclose(sums * signs, np.poly(A.T @ A), rtol=1e-12)


def test_the_least_value_alone_is_the_same_formula():
    A = np.random.default_rng(5).normal(size=(100, 4, 4))
    both, (value, error) = extreme_singular_values(columns_of(A)), least_singular_value(columns_of(A))
    np.testing.assert_array_equal(value, both.least)
    assert (error <= both.error).all()


def test_as_a_program_it_is_short_and_the_same():
    recorder = Recorder("values", "")
    A = recorder.input("A", 6, 6)
    found = extreme_singular_values([A[k::6] for k in range(6)])
    recorder.output("values", [found.least, found.largest])
    program = recorder.program()
    assert program.operations < 1200
    assert program.counts["rcp"] + program.counts["sqrt"] <= 40
    sample = np.random.default_rng(6).normal(size=(3, 6, 6))
    told = run(program, {"A": sample}, path="python")["values"]
    np.testing.assert_allclose(told, np.linalg.svd(sample, compute_uv=False)[:, [-1, 0]], atol=1e-13)
    assert not math.isnan(told.sum())
