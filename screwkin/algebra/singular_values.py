"""Largest and smallest singular value of a small square matrix, as a formula on any scalar.

Reflections bring the matrix to two diagonals; the squares of these give the characteristic polynomial of
A^T A by sums of products without a subtraction, so that it keeps its digits however near to singular A is;
Laguerre's iteration finds the outermost roots from outside. No branches on values: where the
formula is not certified (two singular values that nearly fall together at an end) its error bound says so.

Source: Golub and Kahan (1965) for the two diagonals; Parlett (1964) for Laguerre's iteration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from screwkin.algebra.linear import product
from screwkin.algebra.pattern import components
from screwkin.algebra.scalar import Scalar, abs_, larger, least, minus, plus, root, sqrt, times, where

STEPS = 4
"""Steps of Laguerre's iteration after the one from infinity or zero; each triples the number of digits."""
ROUNDING = 1e-15
"""Relative error of the polynomial's coefficients and of its value, in what all terms add up to."""
TRUSTED = 5e-13
"""Error bound up to which the formula is taken; beyond it, an algorithm that iterates to the end."""


@dataclass(frozen=True)
class Extremes:
    """Smallest and largest singular value.

    Attributes:
        least: the smallest.
        largest: the largest.
        error: estimated bound of both relative errors; rounding of the matrix itself, which moves the
            smallest by the machine's precision times the largest, comes on top. May be infinite or NaN:
            ask for ``error <= TRUSTED``.
    """

    least: Scalar
    largest: Scalar
    error: Scalar


def extreme_singular_values(columns: Sequence[Sequence[Scalar]]) -> Extremes:
    """Smallest and largest singular value of a square matrix with entries of order one.

    Args:
        columns: n columns of n scalars. Exact zeros save work, and rows and columns that share no entries
            with the others are matrices of their own.
    """
    parts = []
    for block in _blocks(columns):
        sums = symmetric_functions(*two_diagonals(block))
        (low, low_error), (high, high_error) = _outermost(sums, 1), _outermost(sums, -1)
        parts.append(Extremes(root(low), root(high), plus(low_error, high_error)))
    return reduce(_joined, parts)


def least_singular_value(columns: Sequence[Sequence[Scalar]]) -> tuple[Scalar, Scalar]:
    """Smallest singular value alone, and its error (see ``Extremes``): for about two thirds of the work."""
    roots = [_outermost(symmetric_functions(*two_diagonals(block)), 1) for block in _blocks(columns)]
    return reduce(least, (root(low) for low, _ in roots)), reduce(plus, (error for _, error in roots))


def _joined(a: Extremes, b: Extremes) -> Extremes:
    return Extremes(least(a.least, b.least), larger(a.largest, b.largest), plus(a.error, b.error))


def _blocks(columns: Sequence[Sequence[Scalar]]) -> list[list[list[Scalar]]]:
    """Columns of the square parts into which exact zeros divide a matrix; all of it if not all are square."""
    support = [_support(column) for column in columns]
    pattern = np.array([[row in rows for rows in support] for row in range(len(columns))], dtype=np.int64)
    parts = components(pattern)
    if any(len(rows) != len(own) for rows, own in parts):
        return [[list(column) for column in columns]]
    return [[[columns[c][r] for r in rows] for c in own] for rows, own in parts]


def two_diagonals(columns: Sequence[Sequence[Scalar]]) -> tuple[list[Scalar], list[Scalar]]:
    """Squares of diagonal (n) and superdiagonal (n - 1) that reflections from both sides leave of a matrix.

    The reflections mix only what is not an exact 0, and begin at the column with the fewest other entries.
    """
    left = sorted((list(column) for column in columns), key=lambda column: len(_support(column)))
    diagonal: list[Scalar] = []
    above: list[Scalar] = []
    while len(left) > 2:
        square, row, left = _reflected(left[0], left[1:])
        diagonal.append(square)
        square, column, rows = _reflected(row, _transposed(left))
        above.append(square)
        left = [column, *_transposed(rows)]
    if len(left) == 1:
        return [times(left[0][0], left[0][0])], []
    a, b = left  # of the last two columns the squares need no reflection
    size, along, area = product(a, a), product(a, b), minus(times(a[0], b[1]), times(a[1], b[0]))
    some = size > 0
    inverse = 1 / where(some, size, 1.0)
    last = times(times(area, area), inverse)
    beside = where(some, times(times(along, along), inverse), product(b, b))
    return [*diagonal, size, last], [*above, beside]


def _reflected(
    x: Sequence[Scalar], others: Sequence[Sequence[Scalar]]
) -> tuple[Scalar, list[Scalar], list[list[Scalar]]]:
    """The reflection that takes x to one axis: |x|^2, then of the others their part there, and the rest.

    Source: Householder (1958); the sign is the one that does not cancel.
    """
    support = _support(x) or [0]
    pivot, square = support[0], product(x, x)
    moved = [list(other) for other in others]
    if len(support) > 1:
        size = sqrt(square)
        top = plus(x[pivot], where(x[pivot] < 0, -size, size))
        normal = {i: top if i == pivot else x[i] for i in support}
        some = square > 0
        half = plus(square, times(size, where(x[pivot] < 0, -x[pivot], x[pivot])))
        scale = 1 / where(some, half, 1.0)
        for other in moved:
            share = times(scale, product(list(normal.values()), [other[i] for i in support]))
            for i, component in normal.items():
                other[i] = minus(other[i], times(share, component))
    at = [other.pop(pivot) for other in moved]
    return square, at, moved


def symmetric_functions(diagonal: Sequence[Scalar], above: Sequence[Scalar]) -> list[Scalar]:
    """Elementary symmetric functions of the squared singular values of two diagonals, of degree 0 to n.

    Args:
        diagonal: squares of the diagonal (n).
        above: squares of the superdiagonal (n - 1).

    The characteristic polynomial P of the leading k rows and columns of B^T B and what it has beyond the
    k-th diagonal square times its predecessor, S, follow from each other by sums of positive terms only.
    """
    P: list[Scalar] = [diagonal[0], 1]  # in -lambda, lowest power first
    S: list[Scalar] = [0, 1]
    for q, e in zip(diagonal[1:], above, strict=True):
        S = [plus(a, times(e, b)) for a, b in zip([0, *P], [*S, 0], strict=True)]
        P = [plus(a, times(q, b)) for a, b in zip(S, [*P, 0], strict=True)]
    return P[::-1]


def _outermost(sums: Sequence[Scalar], side: int) -> tuple[Scalar, Scalar]:
    """Least (side 1) or largest (side -1) root of the polynomial with these functions, and its error.

    In y = -lambda all coefficients are positive. A value is rounded in what P(|y|) adds up, the product of
    all |y| + lambda_i, and moves the root by that over the slope. The iteration's own error is the cube of
    the last relative step, over the square of the gap to the next root.
    """
    n, powers = len(sums) - 1, list(reversed(sums))
    if n == 1:
        return sums[1], 0.0
    if side > 0:
        y, sign = -_laguerre(powers[0], powers[1], powers[2], n, 1), 1
    else:  # the step from infinity
        spread = root((n - 1) ** 2 * (sums[1] * sums[1]) - 2 * n * (n - 1) * sums[2])
        y, sign = -(sums[1] + spread) / n, 1 if n % 2 else -1
    for _ in range(STEPS):
        last, (value, slope, bend) = y, _taylor(powers, y)
        step = _laguerre(value, slope, bend, n, sign)
        y = last - step
    size = _taylor(powers, abs_(last))[0]
    scale = last * slope
    inverse = 1 / where(abs_(scale) > 0, scale, 1.0)  # a root that is exactly 0 has no error
    gap, change = abs_(size * inverse), abs_(step * slope * inverse)
    near = change * gap
    return -y, plus(change * least(near * near, 1.0), gap * ROUNDING)


def _taylor(powers: Sequence[Scalar], y: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Value, first and half the second derivative of a polynomial, lowest power first (Horner's scheme)."""
    value: Scalar = powers[-1]
    slope: Scalar = 0
    bend: Scalar = 0
    for coefficient in powers[-2::-1]:
        bend = plus(times(bend, y), slope)
        slope = plus(times(slope, y), value)
        value = plus(times(value, y), coefficient)
    return value, slope, bend


def _laguerre(value: Scalar, slope: Scalar, bend: Scalar, n: int, sign: int) -> Scalar:
    """Laguerre's step for n real roots, all on the side of y to which ``sign`` of the slope points."""
    under = (n - 1) ** 2 * (slope * slope) - 2 * n * (n - 1) * (value * bend)
    return n * value * _inverse(slope + sign * root(under))


def _inverse(x: Scalar) -> Scalar:
    return 1 / x if not isinstance(x, int | float) or x else math.nan


def _support(x: Sequence[Scalar]) -> list[int]:
    """Where a vector is not an exact 0."""
    return [i for i, a in enumerate(x) if not (isinstance(a, int | float) and a == 0)]


def _transposed(vectors: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    return [list(row) for row in zip(*vectors, strict=True)]
