"""Polynomials for sine, cosine and arc tangent that backends share: exact to rounding, without branches."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def _interpolated(series: Sequence[float], top: float, count: int) -> list[float]:
    """A power series on [0, top] as a polynomial of ``count`` coefficients: Chebyshev interpolation."""
    nodes = top / 2 * (1 + np.cos(np.pi * (np.arange(count) + 0.5) / count))
    values = [math.fsum(c * u**k for k, c in enumerate(series)) for u in nodes]
    fitted = np.polynomial.Chebyshev.fit(nodes, values, count - 1, domain=[0, top])
    return [float(c) for c in fitted.convert(kind=np.polynomial.Polynomial, domain=[-1, 1]).coef]


_QUARTER = (math.pi / 2) ** 2

SINE = _interpolated([(-1) ** k / math.factorial(2 * k + 1) for k in range(1, 16)], _QUARTER, 8)
"""sin(r) = r + r u (S0 + S1 u + ...), u = r^2, for |r| <= pi/2."""
COSINE = _interpolated([(-1) ** k / math.factorial(2 * k) for k in range(2, 16)], _QUARTER, 7)
"""cos(r) = 1 - u/2 + u^2 (C0 + C1 u + ...), u = r^2, for |r| <= pi/2."""
ARC = _interpolated([(-1) ** (k + 1) / (2 * k + 3) for k in range(40)], math.tan(math.pi / 8) ** 2, 12)
"""atan(t) = t + t u (A0 + A1 u + ...), u = t^2, for |t| <= tan(pi/8)."""

HALF_TURN = (float.fromhex("0x1.921fb544p+1"), float.fromhex("0x1.0b4611a626331p-33"))
"""pi in two parts, the first with 33 bits and trailing zeros: k times it is exact for |k| < 2^20 (Cody and
Waite 1980), so that the remainder of an angle keeps its digits for many turns."""

TURNS = 1e5
"""Largest angle [rad] for which sine and cosine keep their digits."""
