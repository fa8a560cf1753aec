"""What a planned motion asks of virtual servos: the torque of every joint as a function of time.

Virtual servos do not simulate the robot. Whoever does, or has planned it, says with what its weight and
motion turn each output, and how far the motion is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.servo import VirtualServo


class PlannedLoad:
    """Loads of virtual servos that hold a robot along a plan; before it begins, at its first sample."""

    def __init__(self, time: Array, torque: Array, names: Sequence[str], now: Callable[[], float]) -> None:
        """Nothing moves yet.

        Args:
            time: (T,) of the plan [s].
            torque: (T, n) of the joints [N m], which their servos must give.
            names: of the joints, n.
            now: the time of the servos [s].
        """
        self._time, self._now = time - time[0], now
        self._torque = dict(zip(names, np.ascontiguousarray(torque.T), strict=True))
        self._seen = self._played = self._step = 0.0

    def put_on(self, servos: Sequence[VirtualServo], mounted: ServoMap) -> None:
        """Load servos, which are those of a map in its order."""
        for servo, joint in zip(servos, mounted.joints, strict=True):
            servo.body.load_at = self._on(-joint.direction * self._torque[joint.joint])

    def follow(self, share: float) -> None:
        """The plan has come to a share of its time; it goes on as far as it came since the last call."""
        played = share * float(self._time[-1])
        self._seen, self._step, self._played = self._now(), played - self._played, played

    def _on(self, load: Array) -> Callable[[float], float]:
        def at(time: float) -> float:
            since = min(max(time - self._seen, 0.0), self._step)
            return float(np.interp(self._played + since, self._time, load))

        return at
