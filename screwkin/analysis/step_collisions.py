"""Links that enter each other along a plan, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from screwkin.errors import MissingDependencyError
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

if TYPE_CHECKING:  # it brings the simulator, which other accounts do without
    from screwkin.sim.self_collision import SelfCollision


@dataclass(frozen=True)
class StepCollision:
    """Two links that enter each other in a step: its number from 1; 0 before all, None without steps."""

    step: int | None
    collision: SelfCollision

    def __str__(self) -> str:
        a, b = self.collision.links
        when = "" if self.step is None else f"step {self.step}: " if self.step else "before step 1: "
        return f"{when}{a} enters {b} by {self.collision.depth_mm:.1f} mm at {self.collision.time:.2f} s"

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return {"step": self.step, **self.collision.to_dict()}


def step_collisions(
    robot: Robot, motion: Trajectory, boundaries: Sequence[float]
) -> tuple[StepCollision, ...] | None:
    """The deepest collision of every pair of links in every step; None where nothing can be looked at.

    Args:
        robot: with boxes on its links.
        motion: T samples of that robot.
        boundaries: times at which steps begin, and the last ends [s]; what follows belongs to it.

    Returns:
        In the order of the steps, deepest first in each; None if MuJoCo is not installed.
    """
    from screwkin.sim.self_collision import self_collisions

    try:
        if not self_collisions(robot, motion.time, motion.q):
            return ()
    except MissingDependencyError:
        return None
    if not len(boundaries):
        return tuple(StepCollision(None, one) for one in self_collisions(robot, motion.time, motion.q))
    step = np.searchsorted(boundaries, motion.time + 1e-9).clip(0, max(len(boundaries) - 1, 1))
    return tuple(
        StepCollision(int(n), one)
        for n in np.unique(step)
        for one in self_collisions(robot, motion.time[step == n], motion.q[step == n])
    )
