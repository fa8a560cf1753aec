"""The path of a walk on the floor: a line, an arc or a spin, described by the displacement of one step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Twist, Vector, exp
from screwkin.gait.motion import Motion
from screwkin.gait.record import Gait


@dataclass(frozen=True)
class Path:
    """P(s) = Trans(start, 0) exp(s [forward, side, turn]) in SE(2), s in steps; m and rad per step."""

    start: float
    forward: float
    side: float
    turn: float

    def place(self, s: Array, offset: Array | float = 0.0) -> Array:
        """x, y, yaw (..., 3) of P(s), or of the point ``offset`` [m] to its left; yaw is not wrapped."""
        s = np.asarray(s, dtype=float)
        yaw = self.turn * s
        p = exp(Twist(Vector(0, 0, yaw), Vector(self.forward * s, self.side * s, 0))).p
        x, y = self.start + p.x - np.sin(yaw) * offset, p.y + np.cos(yaw) * offset
        return np.stack([x, y, yaw], axis=-1)

    def follow(self, progress: Motion, offset: Motion, height: float) -> Motion:
        """x, y, z, yaw (T, 4) of a level body that goes along the path, ``offset`` [m] to its left."""
        x, y, yaw = np.moveaxis(self.place(progress.value, offset.value), -1, 0)
        rates, bends = progress.rate, progress.acceleration
        spin, alpha = self.turn * rates, self.turn * bends
        # Velocity and acceleration in the body's own axes, which turn with ``spin``.
        u = self.forward * rates - spin * offset.value
        v = self.side * rates + offset.rate
        du = self.forward * bends - alpha * offset.value - spin * offset.rate
        dv = self.side * bends + offset.acceleration
        ax, ay = du - spin * v, dv + spin * u
        c, n, none = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)
        return Motion(
            np.stack([x, y, none + height, yaw], axis=-1),
            np.stack([c * u - n * v, n * u + c * v, none, spin], axis=-1),
            np.stack([c * ax - n * ay, n * ax + c * ay, none, alpha], axis=-1),
        )


def path_of(gait: Gait) -> Path:
    """The path of a gait: half a swing's displacement per step.

    The waist starts over x = stride/4 between the feet (alternate: walking paper, the right foot at 0, the
    left at stride/2) or over 0 (close, parallel: the feet side by side).
    """
    start = 0.25 * gait.stride if gait.footholds == "alternate" and not gait.places else 0.0
    return Path(start, 0.5 * gait.stride, 0.5 * gait.side, 0.5 * gait.turn)
