"""Where the feet of a walking robot stand, by its joints and its heading, and steps that lead back to a plan.

A foot slips, twists, or lands where a late servo had it and not where it was commanded. Which of it happened
is seen once both feet stand: joints say where one foot is from the other, and the IMU how far the robot has
turned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.kinematics.body import frame_pose
from screwkin.model.robot import Robot
from screwkin.model.state import State

BACK = np.array([0.012, 0.012, 0.06])
"""By how much a step differs from the planned one, forward, left [m] and in its turn [rad], at most."""
SHARE = 0.5
"""Of the way back that a step goes: feet that twist to and fro in turn are not driven on by it."""
_STRAY = np.array([0.03, 0.03, 0.2])  # by how much a foot lies beside its command at most


@dataclass(frozen=True, eq=False)
class Whereabouts:
    """Of two feet on the floor, in the plan's axes: x, y [m], yaw [rad] (3,).

    stance: of the foot that stands, other: of the one that stood before it; north: by how much the IMU's
    heading is ahead of the plan's [rad], None before it was read.
    """

    stance: Array
    other: Array
    north: float | None = None

    def landed(self, stance: Array, other: Array) -> Whereabouts:
        """The other foot has landed, as far beside the one that stood as commanded there: places (3,)."""
        return replace(self, stance=joined_place(self.stance, seen_from(stance, other)), other=self.stance)

    def oriented(self, robot: Robot, attitude: Array, q: Array, tip: str) -> Whereabouts:
        """At rest before the first step: the heading of the foot that stands is the plan's.

        Args:
            robot: of the senses.
            attitude: of its base (3, 3), with the IMU's heading.
            q: measured joint positions (n,).
            tip: of that foot.
        """
        if not _read(attitude, q):
            return self
        return replace(self, north=float(_on_floor(attitude, _foot(robot, q, tip))[2] - self.stance[2]))

    def measured(self, robot: Robot, attitude: Array, q: Array, tips: tuple[str, str]) -> Whereabouts:
        """Both feet stand: where the newly landed one is, by what was measured.

        Args:
            robot: of the senses.
            attitude: of its base (3, 3), with the IMU's heading.
            q: measured joint positions (n,).
            tips: of the foot that landed last and of the one that stood before.
        """
        if self.north is None or not _read(attitude, q):
            return self
        new, old = (_on_floor(attitude, _foot(robot, q, tip)) for tip in tips)
        stood = np.array([*self.other[:2], old[2] - self.north])
        step = seen_from(new, old)
        commanded = seen_from(self.stance, self.other)
        off = step - commanded
        off[2] = _arc(float(off[2]))
        return replace(self, stance=joined_place(stood, commanded + np.clip(off, -_STRAY, _STRAY)))


def back_to_plan(place: Array, footholds: Array, steps: Array) -> Array:
    """Displacements (S, 3) of coming steps, each in the axes of the foot that stands in it, towards a plan.

    Args:
        place: x, y, yaw (3,) of the foot that stands.
        footholds: (S, 3) places where the plan lands in turn.
        steps: (S, 3) displacements from foot to foot in the plan; these differ by ``BACK`` at most.
    """
    rows = []
    for goal, step in zip(footholds, steps, strict=True):
        off = seen_from(goal, place) - step
        off[2] = _arc(off[2])
        rows.append(step + np.clip(SHARE * off, -BACK, BACK))
        place = joined_place(place, rows[-1])
    return np.array(rows).reshape(-1, 3)


def seen_from(place: Array, origin: Array) -> Array:
    """A place x, y, yaw (3,) in the axes of another one."""
    x, y = place[:2] - origin[:2]
    c, s = np.cos(origin[2]), np.sin(origin[2])
    return np.array([c * x + s * y, c * y - s * x, place[2] - origin[2]])


def joined_place(origin: Array, step: Array) -> Array:
    """The place (3,) that is a step (3,) beside another one."""
    c, s = np.cos(origin[2]), np.sin(origin[2])
    return origin + np.array([c * step[0] - s * step[1], s * step[0] + c * step[1], step[2]])


def _read(attitude: Array, q: Array) -> bool:
    return bool(np.isfinite(attitude).all() and np.isfinite(q).all())


def _foot(robot: Robot, q: Array, tip: str) -> Array:
    return np.asarray(frame_pose(robot, State(np.eye(4), q), tip))


def _on_floor(attitude: Array, T: Array) -> Array:
    """x, y, yaw (3,) of a frame of the base, seen from above in the IMU's heading."""
    return np.array([*(attitude @ T[:3, 3])[:2], _heading(attitude @ T[:3, :3])])


def _heading(R: Array) -> float:
    return float(np.arctan2(R[1, 0], R[0, 0]))


def _arc(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
