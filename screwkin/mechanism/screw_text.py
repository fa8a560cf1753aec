"""Twists and wrenches in words: the line, the point on it that is nearest to the origin, and the pitch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array

ROUND = 1e-9
"""A component smaller than this share of the whole is rounding, in words."""


@dataclass(frozen=True, eq=False)
class ScrewLine:
    """A twist or wrench as a screw.

    Attributes:
        axis: unit vector (3,).
        point: of the axis, the one nearest to a given place (3,) [m].
        pitch: of a twist advance per turn of one radian, of a wrench moment per force [m]; infinite for a
            pure translation or a pure moment, which have no place.
    """

    axis: Array
    point: Array
    pitch: float


def screw_line(line: Array, free: Array, near: Array, size: float = 1.0) -> ScrewLine:
    """The screw whose vector along the line is ``line`` and whose moment about the origin is ``free``.

    Args:
        line: (3,) omega of a twist, f of a wrench.
        free: (3,) v of a twist at the origin, m of a wrench about it.
        near: (3,) the place that the point shall be near to, such as the middle of a robot [m].
        size: length by which the two are compared [m].
    """
    n = float(np.linalg.norm(line))
    here = free - np.cross(near, line)
    if n * size < 1e-6 * float(np.linalg.norm(here)):
        return ScrewLine(_sign(here / np.linalg.norm(here)), np.array(near, dtype=float), np.inf)
    axis = _sign(line / n)
    pitch = float(line @ free) / n**2
    return ScrewLine(axis, near + np.cross(line, here) / n**2, 0.0 if abs(pitch) < ROUND * size else pitch)


def _sign(axis: Array) -> Array:
    """The direction or its opposite: that whose largest component is positive; rounding is zero."""
    axis = np.where(np.abs(axis) < ROUND, 0.0, axis)
    return axis if axis[np.abs(axis).argmax()] > 0 else -axis + 0.0


def triple(values: Array, digits: int = 4) -> str:
    """Three numbers in brackets, to some digits after the point."""
    return f"({', '.join(f'{round(float(x), digits) + 0.0:g}' for x in values)})"


def twist_text(twist: Array, near: Array, size: float = 1.0) -> str:
    """A motion [omega; v] in words."""
    screw = screw_line(twist[:3], twist[3:], near, size)
    if np.isinf(screw.pitch):
        return f"translation along {triple(screw.axis)}"
    line = f"the axis {triple(screw.axis)} through {triple(screw.point)} m"
    if screw.pitch == 0:
        return f"rotation about {line}"
    return f"screwing about {line} with pitch {1e3 * screw.pitch:.4g} mm/rad"


def wrench_text(wrench: Array, near: Array | None = None, size: float = 1.0) -> str:
    """A wrench [m; f] in words."""
    screw = screw_line(wrench[3:], wrench[:3], np.zeros(3) if near is None else near, size)
    if np.isinf(screw.pitch):
        return f"moment about {triple(screw.axis)}"
    line = f"along {triple(screw.axis)} through {triple(screw.point)} m"
    if screw.pitch == 0:
        return f"force {line}"
    return f"force {line} with a moment of {1e3 * screw.pitch:.4g} mm per unit about it"
