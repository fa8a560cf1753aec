"""Splines through key points: clamped cubic, minimum-jerk, even, cyclic cubic without and with rests.

All are functions f(x, order) of the phase in steps, for the value (order 0) and its derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array


def clamped_cubic(at: Array, value: Array) -> Any:
    """Cubic C2 spline through key points, at rest at the first and the last; a scipy PPoly.

    Args:
        at: key times (k,), increasing.
        value: (k,).
    """
    from scipy.interpolate import CubicSpline

    return CubicSpline(at, value, bc_type="clamped")


def minimum_jerk(at: Array, value: Array) -> Any:
    """Quintic blends with rest (no velocity, no acceleration) at ends and extremal key points; a scipy PPoly.

    A key point that is merely passed on the way, its value strictly between its neighbours' ones, is left
    out: to rest there would cost jerk, and to pass through it a dive below the floor.

    Args:
        at: key times (k,), increasing.
        value: (k,).

    Source: Flash and Hogan (1985), the motion of least integrated squared jerk between two rests.
    """
    from scipy.interpolate import PPoly

    x, y = _rests(at, value)
    h, rise = np.diff(x), np.diff(y)
    none = np.zeros_like(h)
    return PPoly(np.stack([6 * rise / h**5, -15 * rise / h**4, 10 * rise / h**3, none, none, y[:-1]]), x)


def even_speed(at: Array, value: Array, ease: float) -> Any:
    """From rest to rest at even speed, which comes and goes by cubics without a jump of accelerations.

    Its greatest rate is 1 / (1 - ease) of the mean one; that of a minimum-jerk blend is 15/8. It rests where
    that one does. A scipy PPoly.

    Args:
        at: key times (k,), increasing.
        value: (k,).
        ease: share of the time between two rests in which speed comes, and again in which it goes, above 0
            and up to 1/2.
    """
    from scipy.interpolate import PPoly

    x, y = _rests(at, value)
    h, rise = np.diff(x), np.diff(y)
    ramp, fast = ease * h, rise / ((1.0 - ease) * h)  # rates 3 u^2 - 2 u^3 of the fast one on the ramps
    none = np.zeros_like(h)
    bent, cubed = fast / (2 * ramp**3), fast / ramp**2
    c = np.stack(
        [
            np.stack([-bent, cubed, none, none, y[:-1]]),
            np.stack([none, none, none, fast, y[:-1] + fast * ramp / 2]),
            np.stack([bent, -cubed, none, fast, y[1:] - fast * ramp / 2]),
        ],
        axis=-1,
    )
    begins = np.stack([x[:-1], x[:-1] + ramp, x[1:] - ramp], axis=-1).ravel()
    c, begins = c.reshape(5, -1), np.append(begins, x[-1])
    whole = np.diff(begins) > 0.0  # no even part is left where ease is 1/2
    return PPoly(c[:, whole], np.append(begins[:-1][whole], x[-1]))


def _rests(at: Array, value: Array) -> tuple[Array, Array]:
    """Key points (j,) that are no mere passages, their value strictly between their neighbours' ones."""
    step = np.diff(value)
    resting = np.concatenate([[True], step[:-1] * step[1:] <= 0, [True]])
    return at[resting], value[resting]


def held_constant(spline: Any) -> Any:
    """The spline of a swing, constant before its first and after its last key point, on [0, 1]."""
    from scipy.interpolate import PPoly

    x, c = spline.x, spline.c
    first, last = np.zeros((len(c), 1)), np.zeros((len(c), 1))
    first[-1], last[-1] = c[-1, 0], spline(x[-1])
    if x[0] > 0:
        x, c = np.r_[0.0, x], np.hstack([first, c])
    if x[-1] < 1:
        x, c = np.r_[x, 1.0], np.hstack([c, last])
    return PPoly(c, x)


def extremes(spline: Any) -> tuple[Array, Array]:
    """Places and values (k,) among which the spline's smallest and largest values are."""
    inner = spline.derivative().roots(discontinuity=False, extrapolate=False)
    at = np.concatenate([spline.x, inner[np.isfinite(inner)]])
    return at, np.asarray(spline(at))


@dataclass(frozen=True, eq=False)
class Cyclic:
    """A function over all steps: a spline of period two, plus ``slope`` per step."""

    spline: Any
    slope: float = 0.0

    def __call__(self, phase: Array, order: int = 0) -> Array:
        """Value or derivative (T,) at phases (T,)."""
        value = np.asarray(self.spline(phase, order))
        if order == 0:
            return value + self.slope * phase
        return value + self.slope if order == 1 else value


def cyclic_cubic(at: Array, value: Array, kind: str) -> Cyclic:
    """Periodic C2 cubic spline through a channel's key points.

    Args:
        at: key times from 0 to 1 (a step) or to 2 (a cycle of two), in steps.
        value: at those times.
        kind: ``advance``, ``alternate`` or ``repeat``: how one step follows the other (see ``keypoints``).
    """
    from scipy.interpolate import CubicSpline

    slope = 1.0 if kind == "advance" else 0.0
    x, y = _cycle(at, value - slope * at, kind)
    return Cyclic(CubicSpline(x, y, bc_type="periodic"), slope)


def resting_cubic(at: Array, value: Array, kind: str) -> Cyclic:
    """Constant between neighbouring key points of equal value, clamped cubics between such rests.

    Velocities are continuous, accelerations jump where a rest begins or ends. Without such key points it is
    the ``cyclic_cubic``.

    Args:
        at: key times from 0 to 1 (a step) or to 2 (a cycle of two), in steps.
        value: at those times.
        kind: ``alternate`` or ``repeat``: how one step follows the other (see ``keypoints``).
    """
    from scipy.interpolate import PPoly

    x, y = _cycle(at, value, kind)
    resting = np.abs(np.diff(y)) <= 1e-12 * np.abs(y).max()
    if not resting.any():
        return cyclic_cubic(at, value, kind)
    first = int(resting.argmax())  # the cycle is cut in a rest
    x, y = np.r_[x[first:-1], x[: first + 1] + 2.0], np.r_[y[first:-1], y[: first + 1]]
    resting = np.roll(resting, -first)
    pieces, i = [], 0
    while i < len(resting):
        moving = int(np.argmax(np.r_[resting[i:], True]))  # number of intervals up to the next rest
        if moving:
            pieces.append(clamped_cubic(x[i : i + moving + 1], y[i : i + moving + 1]).c)
        else:
            pieces.append(np.array([[0.0], [0.0], [0.0], [y[i]]]))
        i += max(moving, 1)
    return Cyclic(PPoly(np.hstack(pieces), x, extrapolate="periodic"))


def _cycle(at: Array, value: Array, kind: str) -> tuple[Array, Array]:
    """Key points of two steps, the last one with the value of the first."""
    x, y = at.copy(), value.copy()
    if at[-1] < 1.5:
        x = np.concatenate([at, 1 + at[1:]])
        y = np.concatenate([y, (-1 if kind == "alternate" else 1) * y[1:]])
    x[-1], y[-1] = 2.0, y[0]  # equal up to rounding, as checked; scipy wants it exactly
    return x, y
