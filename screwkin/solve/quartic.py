"""Roots of  a0 + a1 cos x + b1 sin x + a2 cos 2x + b2 sin 2x: a quartic in tan(x/2), for a batch at once."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = Any

_LOOKS = np.arange(16) * (np.pi / 8)


def circle_roots(a0: Array, a1: Array, b1: Array, a2: Array, b2: Array) -> Array:
    """Angles (4, B) of the four roots, each of which may be double.

    Complex roots are told by the real part of their half-angle's tangent: for a pair close to the real axis
    (a double root that rounding has split) that is the root, for others the caller finds that it is none.

    The half-angle is counted from the place opposite to where the function is largest, so that the leading
    coefficient of the quartic is that largest value: no root, x = pi included, is ever at infinity. Where the
    function vanishes everywhere the angles are arbitrary.

    Args:
        a0: coefficients (B,).
        a1: of cos x.
        b1: of sin x.
        a2: of cos 2x.
        b2: of sin 2x.
    """
    x = _LOOKS[:, None]
    values = a0 + a1 * np.cos(x) + b1 * np.sin(x) + a2 * np.cos(2 * x) + b2 * np.sin(2 * x)
    start = _LOOKS[np.abs(values).argmax(axis=0)] - np.pi
    c, s, c2, s2 = np.cos(start), np.sin(start), np.cos(2 * start), np.sin(2 * start)
    a1, b1 = a1 * c + b1 * s, b1 * c - a1 * s
    a2, b2 = a2 * c2 + b2 * s2, b2 * c2 - a2 * s2
    leading = a0 - a1 + a2
    leading = np.where(leading == 0, 1.0, leading)
    companion = np.zeros((len(leading), 4, 4))
    companion[:, 0] = -np.stack([2 * b1 - 4 * b2, 2 * a0 - 6 * a2, 2 * b1 + 4 * b2, a0 + a1 + a2], axis=-1)
    companion[:, 0] /= leading[:, None]
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    return (start[:, None] + 2 * np.arctan(np.linalg.eigvals(companion).real)).T
