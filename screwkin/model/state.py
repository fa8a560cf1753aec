"""The configuration of a robot: base pose and joint positions, with any leading batch dimensions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.pytrees import pytree
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from screwkin.errors import expect
from screwkin.model.robot import Robot

RIGID = 1e-6
"""Largest deviation from a rotation matrix that rounding and other writers may cause."""


@dataclass(frozen=True, eq=False)
@pytree()
class State:
    """The configuration of a robot; a JAX pytree.

    Attributes:
        T_world_base: pose of the base (..., 4, 4), translation in [m].
        q: joint positions (..., n) [rad or m], in table order.

    Example:
        >>> import numpy as np, screwkin as sk
        >>> sk.State(np.eye(4), np.zeros(3))
        State: base at (0, 0, 0) m, q = (0, 0, 0)
        >>> sk.State(np.eye(4), np.zeros((100, 3)))
        State: T_world_base (4, 4), q (100, 3)
    """

    T_world_base: Any
    q: Any

    def __repr__(self) -> str:
        T, q = self.T_world_base, self.q
        if not isinstance(T, np.ndarray) or not isinstance(q, np.ndarray) or T.shape != (4, 4) or q.ndim != 1:
            return f"State: T_world_base {np.shape(T)}, q {np.shape(q)}"
        place, joints = (", ".join(f"{x + 0.0:.4g}" for x in values) for values in (T[:3, 3], q))
        return f"State: base at ({place}) m, q = ({joints})"


def home(robot: Robot, posture: str = "home") -> State:
    """A named posture of the table: base upright over the world origin, at the posture's height.

    Args:
        robot: of n joints.
        posture: name of one of its postures.

    Returns:
        State of one sample: T_world_base (4, 4), translation in [m]; q (n,) [rad or m].

    Raises:
        UnknownNameError: the table has no such posture.
        InputError: not a robot.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot("linkages/four-bar")
        >>> sk.home(robot).q.shape
        (4,)
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    chosen = robot.posture(posture)
    T = np.eye(4)
    T[2, 3] = chosen.base_height
    return State(T, np.array(chosen.q, dtype=float))


def reference_posture(robot: Robot) -> tuple[float, ...]:
    """q at which a robot is examined: posture ``home``, else the first posture, else all zero."""
    named = {posture.name: posture.q for posture in robot.postures}
    return named.get("home") or (robot.postures[0].q if robot.postures else (0.0,) * len(robot.joints))


def reference_base(robot: Robot) -> Pose:
    """Pose of the base there: upright over the world origin, at that posture's height."""
    named = {posture.name: posture.base_height for posture in reversed(robot.postures)}
    height = named.get("home", robot.postures[0].base_height if robot.postures else 0)
    return Pose(UNTURNED, Vector(0, 0, height))
