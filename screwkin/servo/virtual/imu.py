"""A virtual IMU: frames as the real one writes them, in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable

from screwkin.algebra.arrays import Array
from screwkin.servo.imu import imu_frame
from screwkin.servo.virtual.bus import Now

PERIOD = 0.01
"""From frame to frame [s]."""


class VirtualImu:
    """A line on which an IMU writes.

    Args:
        clock: what time goes by.
        attitude: of the base (3, 3) when it is asked; None: it says nothing.
    """

    def __init__(self, clock: Now, attitude: Callable[[], Array | None]) -> None:
        self._clock, self._attitude, self._written, self._waiting = clock, attitude, -1, b""

    def read(self, size: int) -> bytes:
        """At most so many of the bytes that have arrived: the newest frame, where others were not fetched."""
        now = math.floor(self._clock.now() / PERIOD + 1e-9)
        if now > self._written:
            self._written, R = now, self._attitude()
            if R is not None:
                yaw, pitch = math.atan2(R[1, 0], R[0, 0]), math.asin(max(-1.0, min(1.0, -R[2, 0])))
                self._waiting += imu_frame(now, yaw, pitch, math.atan2(R[2, 1], R[2, 2]))
        data, self._waiting = self._waiting[:size], self._waiting[size:]
        return data

    def write(self, data: bytes) -> int:
        """It hears nothing."""
        return len(data)

    def reset_input_buffer(self) -> None:
        """Forget what has arrived."""
        self._waiting = b""

    def close(self) -> None:
        """Nothing is held."""
