"""Remarks on the servos that a robot's table names."""

from __future__ import annotations

from collections.abc import Iterator

from screwkin.analysis.remark import Level, Remark
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.model.servo_section import PLACE
from screwkin.motors.library import names_motors
from screwkin.servo.servo_map import map_faults


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
