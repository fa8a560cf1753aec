"""A robot as lines in a tree, in the zero pose: what anatomy is read from.

A line is an axis without its sense, and without a point of its own: how a file happens to write them does not
enter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.errors import InputError
from screwkin.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The lines of n joints, and which joint hangs below which.

    Attributes:
        robot: with all joints at 0; joints are counted as in ``Robot.tree``, coupled ones among them.
        s: (n, 3) unit vectors of the axes, base axes.
        s0: (n, 3) a point of each axis [m].
        turns: (n,) bool, False for a prismatic joint, which has a direction but no line.
    """

    robot: Robot
    s: Array
    s0: Array
    turns: Array

    @classmethod
    def of(cls, robot: Robot) -> Skeleton:
        """The skeleton of a robot of numbers.

        Raises:
            InputError: the robot holds symbols.
        """
        if robot.is_symbolic:
            raise InputError(f"{robot.name} holds symbols; anatomy is read from numbers")
        screws = [joint.screw for joint in robot.tree]
        s, s0 = (
            np.array([as_array(v) for v in column], dtype=float).reshape(-1, 3)
            for column in ([screw.s for screw in screws], [screw.s0 for screw in screws])
        )
        return cls(robot, s, s0, np.array([not screw.is_translation for screw in screws], dtype=bool))

    @cached_property
    def children(self) -> dict[str, tuple[int, ...]]:
        """For every link: the joints that stand on it."""
        below: dict[str, list[int]] = {name: [] for name in self.robot.link_names}
        for i, joint in enumerate(self.robot.tree):
            below[joint.parent].append(i)
        return {name: tuple(joints) for name, joints in below.items()}

    def next(self, joint: int) -> tuple[int, ...]:
        """The joints that stand on the link that a joint carries."""
        return self.children[self.robot.tree[joint].child]

    def carried(self, joint: int) -> Iterator[int]:
        """A joint, and all joints beyond it."""
        yield joint
        for further in self.next(joint):
            yield from self.carried(further)

    def links_beyond(self, joint: int) -> tuple[str, ...]:
        """Names of the links that a joint moves."""
        return tuple(self.robot.tree[i].child for i in self.carried(joint))

    def place(self, links: tuple[str, ...]) -> Array:
        """Common CoM of links (3,) [m]; of massless ones the middle of their frames."""
        rows = np.array([self._bodies[name] for name in links])
        mass = rows[:, 0]
        if mass.sum() > 0:
            return np.asarray(mass @ rows[:, 1:4] / mass.sum())
        return np.asarray(rows[:, 4:].mean(axis=0))

    @cached_property
    def _bodies(self) -> dict[str, tuple[float, ...]]:
        """For every link: mass, CoM, origin of its frame."""
        return {
            link.name: tuple(map(float, (link.mass, *link.com, *link.frame.p))) for link in self.robot.links
        }

    @cached_property
    def size(self) -> float:
        """Greatest distance of a link's CoM, or of an axis, from the robot's CoM [m]."""
        middle = self.place(self.robot.link_names)
        coms = np.array([as_array(link.com) for link in self.robot.links if link.mass], float).reshape(-1, 3)
        away = np.linalg.norm(np.cross(self.s, middle - self.s0), axis=1)[self.turns]
        return float(max([*np.linalg.norm(coms - middle, axis=1), *away, 1e-3]))
