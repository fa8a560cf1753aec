"""Plain integration of secondary rates: what positions drift to when the loops are not closed again.

Kept to show the drift (Euler at 10 ms: millimetres of loop closure in a few steps); positions of a walk come
from ``ik.pose``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from screwkin.algebra.arrays import Array

Rates = Callable[[float, Array], Array]


def integrate_rates(rates: Rates, time: Array, q0: Array, method: Literal["euler", "rk4"] = "rk4") -> Array:
    """Joint positions (T, n) from rates(t, q), by one step from each sample to the next.

    Args:
        rates: q' (n,) at time t [s] and positions q (n,).
        time: samples (T,) [s].
        q0: positions at the first sample (n,).
        method: explicit Euler, or the classical Runge-Kutta method of order four.
    """
    q = np.empty((len(time), len(q0)))
    q[0] = q0
    for k, (t, h) in enumerate(zip(time[:-1], np.diff(time), strict=True)):
        x = q[k]
        first = rates(t, x)
        if method == "euler":
            q[k + 1] = x + h * first
            continue
        second = rates(t + h / 2, x + h / 2 * first)
        third = rates(t + h / 2, x + h / 2 * second)
        fourth = rates(t + h, x + h * third)
        q[k + 1] = x + h / 6 * (first + 2 * second + 2 * third + fourth)
    return q
