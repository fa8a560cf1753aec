"""Irregular lists of footsteps for any robot, drawn in its own lengths."""

from __future__ import annotations

import numpy as np

import screwkin as sk
from screwkin.gait.stance import LEFT, RIGHT, stance_of

Place = tuple[float, float, float]


def irregular(robot: sk.Robot, count: int, seed: int, turn: float = 0.2, first: str = "right") -> list[Place]:
    """Footholds (x, y, yaw): each ahead of, beside and turned from the foot that stands, by chance."""
    rng, stance = np.random.default_rng(seed), stance_of(robot)
    length = np.ptp(np.array(stance.feet[0].sole)[:, 0])
    side, width = (RIGHT if first == "right" else LEFT), 2 * stance.foot_y
    x, y, yaw = 0.0, -side * stance.foot_y, 0.0  # of the foot that stands
    bend, places = 0.0, []
    for _ in range(count):
        bend = np.clip(bend + rng.uniform(-turn, turn) / 2, -turn, turn)
        # The outer foot leads a turn; the inner one must not step onto it.
        by = bend if np.sign(bend) == side else 0.3 * bend
        ahead = rng.uniform(-0.1, 0.6) * length
        apart = side * (width * rng.uniform(1.0, 1.15))
        c, s = np.cos(yaw), np.sin(yaw)
        x, y, yaw = x + c * ahead - s * apart, y + s * ahead + c * apart, yaw + by
        places.append((float(x), float(y), float(yaw)))
        side = -side
    return places
