"""Twists and wrenches as screws, and in words: axis, the point of it nearest to a place, and pitch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array

ROUND = 1e-9
"""Share of the whole below which a component of a screw is rounding."""
COUPLE = 1e-6
"""Share of the whole below which the vector along the line vanishes: a translation, or a moment alone."""

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ScrewLine:
    """A twist or a wrench as a screw.

    Attributes:
        text: what it is, in words.
        axis: unit vector; that direction whose largest component is positive.
        point: of the axis, the one nearest to a given place [m]; of a translation or moment the place.
        pitch: of a twist advance per turn of one radian, of a wrench moment per force [m]; infinite for a
            translation or a moment, which have no place.
    """

    text: str
    axis: Triple
    point: Triple
    pitch: float


def twist_screw(twist: Array, near: Array, size: float) -> ScrewLine:
    """A motion [omega; v] about the point nearest to ``near``; ``size`` compares lengths with angles [m]."""
    axis, point, pitch = _screw(twist[:3], twist[3:], near, size)
    line = f"the axis {_three(axis)} through {_three(point)} m"
    if math.isinf(pitch):
        text = f"translation along {_three(axis)}"
    elif pitch == 0:
        text = f"rotation about {line}"
    else:
        text = f"screw motion about {line} with pitch {1e3 * pitch:.4g} mm/rad"
    return ScrewLine(text, axis, point, pitch)


def wrench_screw(wrench: Array, near: Array, size: float) -> ScrewLine:
    """A wrench [m; f], likewise."""
    axis, point, pitch = _screw(wrench[3:], wrench[:3], near, size)
    line = f"along {_three(axis)} through {_three(point)} m"
    if math.isinf(pitch):
        text = f"moment about {_three(axis)}"
    elif pitch == 0:
        text = f"force {line}"
    else:
        text = f"force {line} with a moment of {1e3 * pitch:.4g} N mm per N about it"
    return ScrewLine(text, axis, point, pitch)


def _screw(line: Array, free: Array, near: Array, size: float) -> tuple[Triple, Triple, float]:
    n, here = float(np.linalg.norm(line)), free - np.cross(near, line)
    if n * size < COUPLE * float(np.linalg.norm(here)):
        return _upward(here), _triple(near), math.inf
    pitch = float(line @ free) / n**2
    point = near + np.cross(line, here) / n**2
    return _upward(line), _triple(point), 0.0 if abs(pitch) < COUPLE * size else pitch


def _upward(vector: Array) -> Triple:
    axis = vector / np.linalg.norm(vector)
    axis = np.where(np.abs(axis) < ROUND, 0.0, axis)
    return _triple(axis if axis[np.abs(axis).argmax()] > 0 else -axis)


def _triple(values: Array) -> Triple:
    x, y, z = (float(value) + 0.0 for value in values)
    return x, y, z


def _three(values: Triple) -> str:
    return f"({', '.join(f'{round(x, 4) + 0.0:g}' for x in values)})"
