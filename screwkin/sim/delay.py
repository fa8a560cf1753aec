"""A line in which commands wait: each joint reads what came a lag of its own ago."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array


class DelayLine:
    """Rows that come in at even steps, read a lag later, between two steps where it falls there."""

    def __init__(self, lag: Array, dt: float) -> None:
        """A line for columns with lags (n,) [s], in steps of dt [s]."""
        self._steps = lag / dt
        self._count = int(np.ceil(self._steps.max(initial=0.0))) + 1
        self.reset()

    def reset(self) -> None:
        """Nothing has come yet; what comes first has stood for ever."""
        self._rows: list[Array] = []

    def through(self, newest: Array) -> Array:
        """What is read (..., n) as the newest row (..., n) comes in."""
        if not self._steps.any():
            return newest
        self._rows = [newest, *self._rows[: self._count - 1]]
        past = np.array(self._rows)
        ago = np.minimum(self._steps, len(past) - 1)
        low = np.minimum(ago.astype(int), max(len(past) - 2, 0))
        high, joints = np.minimum(low + 1, len(past) - 1), np.arange(newest.shape[-1])
        early, late = past[low, ..., joints], past[high, ..., joints]  # (n, ...)
        part = (ago - low).reshape(-1, *(1,) * (newest.ndim - 1))
        return np.moveaxis(early + part * (late - early), 0, -1)
