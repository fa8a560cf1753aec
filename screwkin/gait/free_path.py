"""A free path of the waist, by coefficients, as an optimiser leaves it in a gait file's table ``[waist]``.

Two functions of the phase p, progress [steps along the path] and side [m]:

    progress(p) = p + sum_k forward[2k-2] sin(2 pi k p) + forward[2k-1] cos(2 pi k p)          k = 1, 2, ...
    side(p)     =     sum_k side[2k-2] sin((2k-1) pi p) + side[2k-1] cos((2k-1) pi p)

plus cubic B-splines over the first ``span`` steps (``start_forward``, ``start_side``) and, mirrored in time,
over the last ones (``stop_forward``, ``stop_side``), which vanish smoothly towards the middle of the walk.
Side is counted towards the foot that supports: in the harmonics and at the start during the first step, at
the stop during the last one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import Fault, near
from screwkin.gait.motion import Function
from screwkin.model.expression import ExpressionError, evaluate

HARMONICS = ("forward", "side")
BUMPS = ("start_forward", "start_side", "stop_forward", "stop_side")
FREE_WAIST_KEYS = (*HARMONICS, *BUMPS, "span")


def free_path(coefficients: Mapping[str, Sequence[float]], steps: int) -> tuple[Function, Function]:
    """Progress [steps], and side [m] towards the foot that supports in the first step.

    Args:
        coefficients: by the keys of ``FREE_WAIST_KEYS``; absent ones are empty, ``span`` is 1.
        steps: length of the walk.
    """
    c = {key: np.array(coefficients.get(key, ()), dtype=float) for key in FREE_WAIST_KEYS}
    span = float(c["span"][0]) if len(c["span"]) else 1.0
    last = (-1) ** (steps - 1)

    def progress(p: Array, order: int) -> Array:
        linear = (p, np.ones_like(p), np.zeros_like(p))[order]
        bumps = _bumps(c["start_forward"], span, p, order)
        bumps = bumps + (-1) ** order * _bumps(c["stop_forward"], span, steps - p, order)
        return linear + _harmonics(c["forward"], 2.0, 0.0, p, order) + bumps

    def side(p: Array, order: int) -> Array:
        start = _harmonics(c["side"], 2.0, -1.0, p, order) + _bumps(c["start_side"], span, p, order)
        return start + last * (-1) ** order * _bumps(c["stop_side"], span, steps - p, order)

    return progress, side


def _harmonics(coefficients: Array, per: float, shift: float, p: Array, order: int) -> Array:
    """Sum over k of coefficients times sine and cosine of (per k + shift) pi p, differentiated."""
    total = np.zeros_like(p)
    for i, coefficient in enumerate(coefficients):
        frequency = (per * (i // 2 + 1) + shift) * np.pi
        # Each derivative advances the angle by a quarter turn; a cosine is a sine a quarter turn ahead.
        angle = frequency * p + 0.5 * np.pi * (order + i % 2)
        total = total + coefficient * frequency**order * np.sin(angle)
    return total


def _bumps(coefficients: Array, span: float, p: Array, order: int) -> Array:
    """Cubic B-spline over 0 .. span that vanishes with two derivatives at span, and beyond it."""
    if not len(coefficients):
        return np.zeros_like(p)
    from scipy.interpolate import BSpline

    width, count = span / len(coefficients), len(coefficients)
    knots = width * np.arange(-3, count + 4)
    padded = np.concatenate([coefficients, np.zeros(3)])
    inside = np.clip(p, 0.0, span)
    return np.where(p < span, BSpline(knots, padded, 3)(inside, order), 0.0)


def read_free_waist(table: Mapping[str, Any], faults: list[Fault]) -> dict[str, tuple[float, ...]]:
    """Coefficients of the table ``[waist]``, after adding its faults; empty where it is absent."""
    row, path = "[waist]", {}
    for key, raw in table.items():
        if key not in FREE_WAIST_KEYS:
            fix = f"{near(key, FREE_WAIST_KEYS)}Valid: {', '.join(FREE_WAIST_KEYS)}"
            faults.append(Fault(row, key, "unknown key", fix))
            continue
        items = raw if isinstance(raw, Sequence) and not isinstance(raw, str) else [raw]
        values = []
        for i, item in enumerate(items):
            try:
                values.append(float(evaluate(item, {})))
            except ExpressionError as error:
                faults.append(Fault(row, f"{key}.{i}", error.found, error.fix))
        path[key] = tuple(values)
        if key in HARMONICS and len(items) % 2:
            faults.append(Fault(row, key, f"{len(items)} coefficients", "Give sines and cosines in pairs"))
        if key == "span" and (len(items) != 1 or any(value <= 0 for value in values)):
            faults.append(Fault(row, key, f"{raw!r} is no span", "Give one number of steps above 0"))
    return path
