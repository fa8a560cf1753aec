"""Steps along a path: where the feet go, one after the other, so that the robot follows it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.support import convex_hull
from screwkin.errors import NoSolutionError
from screwkin.gait.motion import Motion
from screwkin.gait.record import Side
from screwkin.gait.soles import outlines, sole_distance
from screwkin.gait.stance import LEFT, RIGHT, Stance

GAP = 0.004
"""Least distance between the soles that steps leave [m]."""
MOST_STEPS = 1_000
_PARTS = 24  # of the largest step: how finely paths are divided
_WINDOW = 2 * _PARTS  # points ahead that a step may reach


@dataclass(frozen=True)
class StepLimits:
    """How far the robot goes with one step: ahead, to the side [m] and about the vertical [rad].

    In a step that does several at once their shares of these add up to 1 at most.
    """

    ahead: float
    side: float
    turn: float

    def shares(self, places: Array) -> Array:
        """Sums (n,) of the shares that it takes from the first of places (n, 3) to each."""
        x, y, yaw = (places - places[0]).T
        c, s = np.cos(places[0, 2]), np.sin(places[0, 2])
        return np.asarray(
            np.abs(c * x + s * y) / self.ahead + np.abs(c * y - s * x) / self.side + np.abs(yaw) / self.turn
        )


@dataclass(frozen=True, eq=False)
class Walker:
    """A robot that has taken steps and stands with its feet side by side.

    stance, limits: of the robot; across: of each foot from the middle [m]; place: x, y, yaw (3,) of the
    middle between its feet; swing: side of the foot that swings next; steps: where they ended, x, y, yaw.
    """

    stance: Stance
    limits: StepLimits
    across: float
    place: Array
    swing: int
    steps: tuple[tuple[float, float, float], ...] = ()

    def fewest(self, paths: Iterable[Array]) -> Walker:
        """The walker that has followed one of several paths, that of the fewest steps."""
        return min((self.along(path) for path in paths), key=lambda walker: len(walker.steps))

    def along(self, path: Array) -> Walker:
        """The walker at the end of a path, x, y, yaw (n, 3), from its place on, its feet side by side again.

        A foot lands where the middle between the feet goes with that step, as far along the path as limits
        and the other foot allow: the inner foot of a turn or a side step may only close up.

        Raises:
            NoSolutionError: more than ``MOST_STEPS`` steps, or a path that it cannot follow.
        """
        dense = self._divided(path)
        at, swing, steps = {LEFT: 0, RIGHT: 0}, self.swing, list(self.steps)
        last = len(dense) - 1
        while min(at.values()) < last:
            standing = at[-swing]
            landing = self._landing(dense, standing, swing)
            if landing == at[swing] == standing and self._landing(dense, standing, -swing) == standing:
                x, y, _ = dense[standing]
                raise NoSolutionError(f"no step leads on from x {x:.3g}, y {y:.3g} m: the feet would overlap")
            at[swing] = landing
            x, y, yaw = map(float, self._foothold(dense[landing], swing))
            steps.append((x, y, yaw))
            swing = -swing
            if len(steps) > MOST_STEPS:
                raise NoSolutionError(
                    f"more than {MOST_STEPS:,} steps; give a nearer goal, or a longer stride"
                )
        return replace(self, place=dense[-1], swing=swing, steps=tuple(steps))

    def _landing(self, dense: Array, standing: int, swing: int) -> int:
        """Index of the farthest place where the swinging foot can land while the other stands."""
        ahead = dense[standing : standing + _WINDOW]
        within = self.limits.shares(ahead) <= 1.0 + 1e-9
        count = len(ahead) if within.all() else int(np.argmin(within))
        own, other = (self._sole(side) for side in (swing, -swing))
        moved = outlines(own, self._motion(ahead[:count], swing))
        still = np.broadcast_to(outlines(other, self._motion(ahead[:1], -swing)), (count, *other.shape))
        clear = np.flatnonzero(sole_distance(moved, still) >= GAP)
        return standing + int(clear.max(initial=0))

    def _sole(self, side: int) -> Array:
        foot = self.stance.foot(side)
        return convex_hull(np.asarray(foot.sole + foot.body, dtype=float))

    def _motion(self, places: Array, side: int) -> Motion:
        x, y, yaw = self._foothold(places.T, side)
        value = np.column_stack([x, y, np.zeros(len(places)), yaw])
        return Motion(value, np.zeros_like(value), np.zeros_like(value))

    def _foothold(self, place: Array, side: int) -> tuple[Array, Array, Array]:
        """x, y, yaw of a foot where the middle between the feet is at a place (3, ...)."""
        x, y, yaw = place
        return x - np.sin(yaw) * side * self.across, y + np.cos(yaw) * side * self.across, yaw

    def _divided(self, path: Array) -> Array:
        """The path, from the walker's place on, so finely that a step covers many of its points."""
        turned = np.array(path, dtype=float)
        turned[:, 2] += 2 * np.pi * np.round((self.place[2] - turned[0, 2]) / (2 * np.pi))
        points, parts = [self.place], [self.place, *turned]
        for start, end in pairwise(parts):
            count = int(np.ceil(_PARTS * self.limits.shares(np.array([start, end]))[1]))
            points += [start + (end - start) * k / count for k in range(1, count + 1)]
        return np.array(points)


def walker_at_start(stance: Stance, limits: StepLimits, spread: float, first: Side) -> Walker:
    """The robot at the start, over the origin and facing along x.

    Args:
        stance: of the robot.
        limits: of its steps.
        spread: added to each foot's distance from the middle [m].
        first: the foot that swings first.
    """
    return Walker(stance, limits, stance.foot_y + spread, np.zeros(3), RIGHT if first == "right" else LEFT)
