"""Cubic Hermite interpolation between samples of values and rates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array


def places(knots: Array, times: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """For every time: index of the knot before it, how far it is towards the next (0 to 1), and their gap."""
    inside = np.clip(times, knots[0], knots[-1])
    i = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
    gap = knots[i + 1] - knots[i]
    return i, (inside - knots[i]) / gap, gap


def hermite(knots: Array, values: Array, rates: Array, times: Array) -> tuple[Array, Array]:
    """Cubic Hermite spline and its derivative; at rest before the first knot and after the last."""
    i, u, gap = places(knots, times)
    u, h = u[..., None], gap[..., None]
    a, b, rise = h * rates[i], h * rates[i + 1], values[i + 1] - values[i]
    square, cube = 3 * rise - 2 * a - b, a + b - 2 * rise
    value = values[i] + u * (a + u * (square + u * cube))
    rate = (a + u * (2 * square + 3 * u * cube)) / h
    moving = (times >= knots[0]) & (times <= knots[-1])
    return value, np.where(moving[..., None], rate, 0.0)
