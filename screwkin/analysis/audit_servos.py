"""Remarks on the servos that a robot's table names."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from screwkin.analysis.remark import Level, Remark
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.model.servo_section import PLACE, is_number
from screwkin.motors.library import names_motors
from screwkin.servo.servo_map import map_faults, profiles_of

_ROUNDED = 1.05
"""Times a figure of a data sheet that rounding may make of it in a table."""


def servo_remarks(robot: Robot) -> Iterator[Remark]:
    """Whatever would keep the servos of the table from being simulated, or from being played to.

    A table without ids names servos for simulations alone: what a bus needs besides is no more than a hint.

    Args:
        robot: any robot.
    """
    if not robot.servos:
        return
    try:
        names_motors(robot)
    except InputError as error:
        yield Remark("error", PLACE, str(error), "Write the path of its file, or a model that is known")
    level: Level = "warning" if "ids" in robot.servos else "info"
    for fault in map_faults(robot):
        place = f"{PLACE} {fault.key}".strip()
        yield Remark(level, place, fault.found, f"{fault.fix}; until then send refuses the table")
    yield from _beyond_sheets(robot)


def _beyond_sheets(robot: Robot) -> Iterator[Remark]:
    """Joints that the table calls faster or stronger than the data sheet of their servo does."""
    supply: Any = robot.servos.get("voltage")
    for name, profile in profiles_of(robot).items():
        joint = robot.joint(name)
        share = float(supply) / profile.voltage if is_number(supply) else 1.0
        pairs = {
            "velocity": (joint.velocity, share * profile.no_load_speed, "rad/s"),
            "effort": (joint.effort, share * profile.stall_torque, "N m"),
        }
        for key, (value, most, unit) in pairs.items():
            if joint.type != "prismatic" and _ROUNDED * most < value < math.inf:
                what = f"its {key} is {value:.4g} {unit}, its {profile.model} has {most:.3g}"
                advice = "Write what the servo can do: walks and verdicts rest on it"
                yield Remark("warning", f"joint {name}", what, advice)
