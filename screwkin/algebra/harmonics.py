"""Zeros of trigonometric polynomials over arrays, from values at equally spaced angles.

On the circle such values determine the polynomial as well as rounding allows. Its zeros are sought in the
cells of a grid: where it changes its sign, or dips towards zero and away again. Cells in which it may do both
are divided.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from screwkin.algebra.arrays import Array, Integers
from screwkin.algebra.scalar import Scalar, cos, sin, where

GRID = 48
"""Cells of the grid for every degree: zeros of limbs come in clusters."""
PARTS = 16
"""Into so many parts a cell near zero is divided in which the slope may vanish."""
TOUCH = 1e-7
"""Extremum, over the largest value, at which a polynomial touches zero."""
STEPS = 12
"""Newton steps in every cell."""


def equal_angles(count: int) -> Array:
    """So many angles, equally spaced over the circle."""
    return 2 * np.pi / count * np.arange(count)


class Cells(NamedTuple):
    """Intervals (R,) in which polynomials have zeros.

    Attributes:
        owner: index of the polynomial.
        low: one end [rad].
        high: the other one.
        dips: its values have one sign at both ends, and come near zero between them; else the sign changes.
        negative: its value at the lower end is.
    """

    owner: Integers
    low: Array
    high: Array
    dips: Array
    negative: Array


def cells(terms: Array) -> Cells:
    """Where polynomials have zeros, from their coefficients (B, 2 d + 2), see ``harmonics``."""
    degree = terms.shape[1] // 2 - 1
    count = GRID * degree
    x, width = equal_angles(count + 1), 2 * np.pi / count
    x *= (count + 1) / count
    k = np.arange(degree + 1)[:, None]
    sizes = (1, width, 2 * width**2)
    waves = [size * (1j * k) ** order * np.exp(1j * k * x) for order, size in enumerate(sizes)]
    f, d, c = (terms @ np.concatenate([wave.real, -wave.imag]) for wave in waves)
    negative, downward = f < 0, d < 0
    change, dips = _kinds(negative, downward)
    divided, cell = _true(_hiding(f, d, c))
    change[divided, cell] = dips[divided, cell] = False
    parts = width / PARTS * np.arange(PARTS + 1)
    here = (terms[divided, : degree + 1] + 1j * terms[divided, degree + 1 :]) * waves[0].T[cell]
    fine = [((1j * k) ** order * np.exp(1j * k * parts)).conj().T.copy().view(float) for order in (0, 1)]
    fine_f, fine_d = (here.view(float) @ wave.T for wave in fine)
    parts = x[cell, None] + parts
    fine_negative = fine_f < 0
    fine_change, fine_dips = _kinds(fine_negative, fine_d < 0)
    owner, cell = _true(change | dips)
    row, part = _true(fine_change | fine_dips)
    return Cells(
        np.concatenate([owner, divided[row]]),
        np.concatenate([x[cell], parts[row, part]]),
        np.concatenate([x[cell + 1], parts[row, part + 1]]),
        np.concatenate([dips[owner, cell], fine_dips[row, part]]),
        np.concatenate([negative[owner, cell], fine_negative[row, part]]),
    )


def _hiding(f: Array, d: Array, c: Array) -> Array:
    """Cells (B, n) in which slopes may vanish, even more than once, and values near zero with them.

    Args:
        f: values (B, n + 1); all are given by size in place.
        d: slopes, times a cell.
        c: slopes of these, times twice a cell's square: so much the slopes change in it, seldom more.
    """
    for part in (f, d, c):
        np.abs(part, out=part)
    flat, near = d < c, f < d + c
    return (flat[:, 1:] | flat[:, :-1]) & near[:, 1:] & near[:, :-1]


def _kinds(negative: Array, downward: Array) -> tuple[Array, Array]:
    """Between neighbouring columns (B, n + 1), whether values change their sign, or dip, by their slopes."""
    change = negative[:, 1:] != negative[:, :-1]
    nearing = negative != downward
    return change, nearing[:, :-1] & ~nearing[:, 1:] & ~change


def _true(marks: Array) -> tuple[Integers, Integers]:
    """Rows and columns of what is True: sought in one row, as few are."""
    row, column = np.divmod(np.flatnonzero(marks), marks.shape[1])
    return row, column


def harmonics(values: Array) -> Array:
    """Coefficients (B, 2 d + 2) of polynomials of degree d from their values (B, 2 d + 1).

    Real parts of c_0 to c_d, then their imaginary parts: the polynomial is the real part of the sum of
    c_k exp(i k x). Values are those at ``equal_angles``, over the largest.
    """
    count = values.shape[1]
    waves = np.exp(-1j * np.arange(count // 2 + 1) * equal_angles(count)[:, None]) * (2 / count)
    waves[:, 0] /= 2
    scale = np.abs(values).max(axis=1, keepdims=True)
    unit = values / np.where(scale > 0, scale, 1.0)
    return np.asarray(unit @ np.concatenate([waves.real, waves.imag], axis=1))


def crossing(terms: Sequence[Scalar], low: Scalar, high: Scalar, order: int) -> Scalar:
    """Where a polynomial (``order`` 0) or its slope (1) changes its sign between two angles.

    Newton steps, each kept in what is left of the interval.

    Args:
        terms: its coefficients, see ``harmonics``.
        low: one end [rad].
        high: the other one.
        order: of the derivative.
    """
    start = _sign(derivatives(terms, low, (order,))[0])
    x = (low + high) * 0.5
    for _ in range(STEPS):
        value, slope = derivatives(terms, x, (order, order + 1))
        left = _sign(value) * start < 0
        low, high = where(left, low, x), where(left, x, high)
        flat = slope * slope <= 0
        new = x - where(flat, 0.0, value / where(flat, 1.0, slope))
        x = where((new >= low) & (new <= high) & ~flat, new, (low + high) * 0.5)
    return x


def _sign(x: Scalar) -> Scalar:
    return where(x < 0, -1.0, 1.0)


def derivatives(terms: Sequence[Scalar], x: Scalar, orders: Sequence[int]) -> list[Scalar]:
    """Derivatives of some orders of a polynomial, given as for ``crossing``, at an angle."""
    c, s, sums = cos(x), sin(x), []
    count = len(terms) // 2
    for order in orders:
        re: Scalar = 0
        im: Scalar = 0
        for k in range(count - 1, -1, -1):
            a, b = terms[k], terms[count + k]
            for _ in range(order):
                a, b = -k * b, k * a
            re, im = re * c - im * s + a, re * s + im * c + b
        sums.append(re)
    return sums
