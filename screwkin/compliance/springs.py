"""The stiffness of elastic joints, from the table or from the caller, checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, UnknownNameError
from screwkin.model.robot import Robot
from screwkin.motors.library import motor_models, motors_of, names_motors

StiffnessChoice = float | Mapping[str, float] | None


def joint_stiffness(robot: Robot, stiffness: StiffnessChoice = None) -> Array:
    """Stiffness (n,) of every joint [N m/rad; N/m for prismatic joints].

    Args:
        robot: n joints.
        stiffness: one number for all; or a number by joint name, ``default`` for those not named; or None for
            ``stiffness`` of the table's ``[servos]``, which may be either; where the table gives none, that
            of its servo models in the steady state.

    Raises:
        InputError: there is none, a joint has none, or one is not a positive finite number.
        UnknownNameError: no such joint.
    """
    chosen: Any = robot.servos.get("stiffness") if stiffness is None else stiffness
    if chosen is None and names_motors(robot):
        return np.array([motor.stiffness for motor in motors_of(robot)], dtype=float)
    if chosen is None:
        raise InputError(
            f"{robot.name} has no joint stiffness; give one in N m/rad, or write stiffness under [servos] "
            f"of its table, or a model of servo that is known: {', '.join(motor_models())}"
        )
    by_name = chosen if isinstance(chosen, Mapping) else {"default": chosen}
    for name in by_name:
        if name != "default" and name not in robot.joint_names:
            raise UnknownNameError("joint", name, robot.joint_names)
    for name, k in by_name.items():
        number = isinstance(k, int | float | np.number) and not isinstance(k, bool)
        if not (number and np.isfinite(k) and k > 0):
            where = "" if name == "default" else f" of {name}"
            raise InputError(f"stiffness{where} is {k!r}; it must be a positive number in N m/rad")
    missing = [name for name in robot.joint_names if name not in by_name and "default" not in by_name]
    if missing:
        raise InputError(f"no stiffness for {', '.join(missing)}; name them, or give a default")
    every = {**dict.fromkeys(robot.joint_names, by_name.get("default")), **by_name}
    return np.array([every[name] for name in robot.joint_names], dtype=float)
