"""Roots of  a0 + a1 cos x + b1 sin x + a2 cos 2x + b2 sin 2x: a quartic in tan(x/2).

``circle_roots`` finds them for a batch by eigenvalues, whatever their multiplicity; ``circle_points`` is a
formula on any scalar for roots that are apart, and says where they are not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, abs_, atan2, cos, least, root, sqrt, where

_LOOKS = np.arange(16) * (np.pi / 8)


def circle_roots(a0: Array, a1: Array, b1: Array, a2: Array, b2: Array) -> Array:
    """Angles (4, B) of the four roots, each of which may be double.

    Complex roots are given by the real part of their half-angle's tangent: for a pair close to the real axis
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


@dataclass(frozen=True)
class CirclePoint:
    """A root as a point of the unit circle; slack: negative if it is none, near 0 if nearly double."""

    c: Scalar
    s: Scalar
    slack: Scalar


def circle_points(coefficients: Sequence[Scalar]) -> list[CirclePoint]:
    """The four roots as points of the unit circle; a pair of complex roots gives the point between them.

    Ferrari's factors in the half-angle's tangent, then two Newton steps on the circle itself. The half-angle
    is counted from the place opposite to where the function is largest (see ``circle_roots``).

    Args:
        coefficients: of 1, cos x, sin x, cos 2x, sin 2x.
    """
    start_c, start_s, (a0, a1, b1, a2, b2) = _from_largest(coefficients)
    leading = 1 / (a0 - a1 + a2)
    b, c = (2 * b1 - 4 * b2) * leading, (2 * a0 - 6 * a2) * leading
    d, e = (2 * b1 + 4 * b2) * leading, (a0 + a1 + a2) * leading
    points = []
    for t, discriminant in _ferrari(b, c, d, e):
        inverse = 1 / (1 + t * t)
        cosine, sine = (1 - t * t) * inverse, 2 * t * inverse
        turned = start_c * cosine - start_s * sine, start_s * cosine + start_c * sine
        points.append(CirclePoint(*_polished(coefficients, *turned), discriminant))
    return points


def _from_largest(coefficients: Sequence[Scalar]) -> tuple[Scalar, Scalar, list[Scalar]]:
    """Cosine and sine of the start, half a turn from the largest of eight values; coefficients from there."""
    a0, a1, b1, a2, b2 = coefficients
    best: list[Scalar] = []
    for k in range(8):
        c, s = _eighth(k), _eighth(k - 2)
        c2, s2 = _eighth(2 * k), _eighth(2 * k - 2)
        value = a0 + a1 * c + b1 * s + a2 * c2 + b2 * s2
        square = value * value
        here = [square, -c, -s, c2, s2]
        larger = square > best[0] if best else True
        best = [where(larger, new, old) for new, old in zip(here, best or here, strict=True)]
    _, c, s, c2, s2 = best
    return c, s, [a0, a1 * c + b1 * s, b1 * c - a1 * s, a2 * c2 + b2 * s2, b2 * c2 - a2 * s2]


def _eighth(k: int) -> Scalar:
    """Cosine of k eighths of a turn, exact where it is 0, 1 or -1."""
    return (1, math.sqrt(0.5), 0, -math.sqrt(0.5), -1, -math.sqrt(0.5), 0, math.sqrt(0.5))[k % 8]


def _ferrari(b: Scalar, c: Scalar, d: Scalar, e: Scalar) -> list[tuple[Scalar, Scalar]]:
    """Roots (real parts) of t^4 + b t^3 + c t^2 + d t + e, each with its pair's relative discriminant."""
    p = c - 0.375 * (b * b)
    q = d - 0.5 * (b * c) + 0.125 * (b * b * b)
    r = e - 0.25 * (b * d) + 0.0625 * (b * b * c) - (3 / 256) * (b * b * (b * b))
    u = _largest_root(2 * p, p * p - 4 * r, -(q * q))
    size = u + abs_(p) + sqrt(abs_(r) + 1e-300)
    alpha = root(u)
    ratio = where(alpha > 0, q / where(alpha > 0, alpha, 1.0), 0.0)
    roots = []
    for sign in (1, -1):
        discriminant = u - 2 * (p + u - sign * ratio)
        half = root(discriminant) * 0.5
        middle = -0.25 * b - sign * 0.5 * alpha
        slack = least(discriminant, u) / size
        roots += [(middle + half, slack), (middle - half, slack)]
    return roots


def _largest_root(a: Scalar, b: Scalar, c: Scalar) -> Scalar:
    """The largest root of u^3 + a u^2 + b u + c: Cardano's or Vieta's form, then two Newton steps."""
    third = a / 3
    P, Q = b - a * third, (2 * third * third - b) * third + c
    disc = 0.25 * (Q * Q) + P * P * P / 27
    one = disc > 0
    w = cube_root(0.5 * abs_(Q) + sqrt(where(one, disc, 0.0)) + 1e-300)
    w = where(Q > 0, -w, w)
    angle = atan2(sqrt(where(one, 0.0, -disc)), -0.5 * Q) / 3
    spread = 2 * root(-P / 3)
    u = where(one, w - P / (3 * w), spread * cos(angle)) - third
    for _ in range(2):
        value, slope = ((u + a) * u + b) * u + c, (3 * u + 2 * a) * u + b
        u = u - where(slope > 0, value, 0.0) / where(slope > 0, slope, 1.0)
    return u


def cube_root(x: Scalar) -> Scalar:
    """Cube root of a positive number: a guess by square roots, then Halley's method on w^3 = x."""
    quarter = sqrt(sqrt(x))
    sixteenth = sqrt(sqrt(quarter))
    w = quarter * sixteenth * sqrt(sqrt(sixteenth))
    for _ in range(3):
        cube = w * w * w
        w = w * (cube + 2 * x) / (2 * cube + x)
    return w


def _polished(coefficients: Sequence[Scalar], c: Scalar, s: Scalar) -> tuple[Scalar, Scalar]:
    """Two Newton steps, each only where it helps: at a double root value and slope may both be rounding."""
    value, slope = _value_and_slope(coefficients, c, s)
    for _ in range(2):
        step = -value / where(slope * slope > 0, slope, 1.0)
        turned = c - s * step, s + c * step
        inverse = 1 / sqrt(turned[0] * turned[0] + turned[1] * turned[1])
        here = turned[0] * inverse, turned[1] * inverse
        new = _value_and_slope(coefficients, *here)
        better = abs_(new[0]) < abs_(value)
        pairs = zip((*here, *new), (c, s, value, slope), strict=True)
        c, s, value, slope = (where(better, a, b) for a, b in pairs)
    return c, s


def _value_and_slope(coefficients: Sequence[Scalar], c: Scalar, s: Scalar) -> tuple[Scalar, Scalar]:
    """Of the function at a point of the circle."""
    a0, a1, b1, a2, b2 = coefficients
    c2, s2 = c * c - s * s, 2 * c * s
    return a0 + a1 * c + b1 * s + a2 * c2 + b2 * s2, b1 * c - a1 * s + 2 * (b2 * c2 - a2 * s2)
