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
        self._joints = np.arange(len(lag))
        self.reset()

    def reset(self) -> None:
        """Nothing has come yet; what comes first has stood for ever."""
        self._rows: Array | None = (
            None  # (count, ..., n), the newest at _head, older ones behind it in a ring
        )
        self._head = self._filled = 0

    def through(self, newest: Array) -> Array:
        """What is read (..., n) as the newest row (..., n) comes in."""
        if self._count == 1:
            return newest
        if self._rows is None:
            self._rows = np.zeros((self._count, *newest.shape))
        self._head = (self._head - 1) % self._count
        self._rows[self._head] = newest
        if self._filled < self._count:  # what is read of a full ring is the same from then on
            self._filled += 1
            ago = np.minimum(self._steps, self._filled - 1)
            self._low = np.minimum(ago.astype(int), max(self._filled - 2, 0))
            self._high, self._part = np.minimum(self._low + 1, self._filled - 1), ago - self._low
        past = self._rows.reshape(self._count, -1, newest.shape[-1])
        early, late = (
            past[(self._head + k) % self._count, :, self._joints].T for k in (self._low, self._high)
        )
        return np.asarray(early + self._part * (late - early)).reshape(newest.shape)
