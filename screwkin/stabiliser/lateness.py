"""How late joints follow, by what was wanted of them and what was measured; and positions that wait for it.

Joints that follow at different times bend a robot out of its posture as it moves: feet land early, late or
tilted, and drag. Joints that follow late together only walk a little later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array

LONGEST = 0.03
"""Time for which a joint waits, at most [s]."""
SLACK = 0.005
"""Time that a joint may follow sooner than the latest without waiting: loads let joints seem so late [s]."""
KNOWN = 20.0
"""Sum of squared speeds over cycles from which a joint's own figure outweighs that of all [rad^2/s^2]."""
KEPT = 0.998
"""Share of the sums that is left after a cycle: the last five seconds count."""
LASTING = 0.02
"""Share of the newest in the residual that lasts, as of a servo that gives way under its load."""


@dataclass(frozen=True, eq=False)
class Lateness:
    """What is known of joints that follow late.

    offset (n,): of wanted from measured positions, what lasts of it [rad]; moved (n,): sum over the cycles of
    squared speeds, behind (n,): of speeds times the offset beyond what lasts.
    """

    offset: Array
    moved: Array
    behind: Array

    @classmethod
    def unknown(cls, joints: int) -> Lateness:
        """Of joints that have not moved yet."""
        return cls(np.zeros(joints), np.zeros(joints), np.zeros(joints))

    def measured(self, wanted: Array, q: Array, dt: float) -> Lateness:
        """After another reading.

        Args:
            wanted: positions (3, n) of the last three cycles, of which the newest is due now.
            q: measured positions (n,).
            dt: duration of a cycle [s].
        """
        if not np.isfinite(q).all():
            return self
        speed, off = (wanted[-1] - wanted[-3]) / (2.0 * dt), wanted[-1] - q
        offset = self.offset + LASTING * (off - self.offset)
        return Lateness(offset, KEPT * self.moved + speed**2, KEPT * self.behind + speed * (off - offset))

    @property
    def times(self) -> Array:
        """By how much each joint follows late (n,) [s]; near that of all where it has hardly moved."""
        of_all = self.behind.sum() / (self.moved.sum() + KNOWN)
        return np.asarray((self.behind + KNOWN * of_all) / (self.moved + KNOWN))


def waiting(wanted: Array, times: Array, dt: float) -> Array:
    """Positions (n,) of which each is as old as its joint follows sooner than the latest one, but ``SLACK``.

    Args:
        wanted: positions (K, n) by cycle, the newest last; what came before the first is alike.
        times: by how much each joint follows late (n,) [s].
        dt: duration of a cycle [s].
    """
    ago = np.clip(times.max() - times - SLACK, 0.0, LONGEST) / dt
    whole = np.floor(ago).astype(int)
    joints, newest = np.arange(len(times)), len(wanted) - 1
    young, old = (wanted[np.maximum(newest - whole - k, 0), joints] for k in (0, 1))
    return np.asarray(young + (ago - whole) * (old - young))
