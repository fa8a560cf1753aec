"""The sliders of a viewer as data, and what moving one does: joints that loops tie, gaits planned anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.gait.lengths import fitted
from screwkin.gait.record import Gait
from screwkin.mechanism.closure import nearest_closed
from screwkin.model.robot import Robot

TURN = np.pi
"""Range of a slider of a joint without limits, either way [rad]."""
SLIDE = 0.5
"""The same of a sliding joint [m]."""
STEERED = ("stride", "Tc", "lift", "sway", "waist_height")
"""Keys of a gait that have sliders."""
_UNITS = {"stride": "m", "Tc": "s", "lift": "m", "sway": "1", "waist_height": "m"}


@dataclass(frozen=True)
class Slider:
    """A number to be dragged: its name, unit, range, step and value."""

    name: str
    unit: str
    lower: float
    upper: float
    step: float
    value: float

    @property
    def label(self) -> str:
        """What stands beside it."""
        return f"{self.name} [{self.unit}]"


def joint_sliders(robot: Robot, q: Array) -> list[Slider]:
    """One for every joint that has a coordinate, over its limits.

    Args:
        robot: of n joints.
        q: (n,) where they are [rad or m].
    """
    sliders = []
    for joint, value in zip(robot.joints, np.asarray(q, dtype=float).tolist(), strict=True):
        turns = joint.type != "prismatic"
        reach = TURN if turns else SLIDE
        lower, upper = (
            float(limit) if np.isfinite(limit) else side * reach
            for limit, side in ((joint.lower, -1), (joint.upper, 1))
        )
        lower, upper = min(lower, value), max(upper, value, lower + 1e-6)
        step = _round_step(upper - lower, 1000)
        sliders.append(Slider(joint.name, "rad" if turns else "m", lower, upper, step, value))
    return sliders


def dragged(robot: Robot, q: Array, joint: str, value: float) -> Array:
    """Joint positions (n,) with one joint set and the loops of the table closed again.

    Args:
        robot: of n joints.
        q: (n,) before, with loops closed [rad or m].
        joint: its name.
        value: where it is to be [rad or m].

    Raises:
        NoSolutionError: the loops cannot close there.
    """
    moved = np.array(q, dtype=float)
    moved[robot.joint_names.index(joint)] = value
    return nearest_closed(robot, moved, (joint,)) if robot.closures else moved


def gait_sliders(robot: Robot, gait: Gait) -> list[Slider]:
    """Sliders of a gait on a robot: from half to one and a half of what it asks for.

    The waist is lowered by a tenth and raised by a thirtieth at most: legs do not get longer.

    Args:
        robot: that walks.
        gait: perhaps with lengths that depend on the robot.
    """
    values = fitted(gait, robot).numbers
    sliders = []
    for key in STEERED:
        value = float(values[key])
        low, high = (0.9, 1.03) if key == "waist_height" else (0.5, 1.5)
        lower, upper = sorted((low * value, high * value)) if value else (-0.5, 0.5)
        step = _round_step(upper - lower, 200)
        sliders.append(Slider(key, _UNITS[key], lower, upper, step, value))
    return sliders


def _round_step(span: float, parts: int) -> float:
    """The power of ten that divides a range into so many parts or somewhat more: few digits are shown."""
    return float(10.0 ** np.floor(np.log10(span / parts)))
