"""The stiffness of elastic joints and what their motors take, from the table or from the caller, checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, UnknownNameError
from screwkin.kinematics.arrays import one_batch
from screwkin.mechanism.linkages import motor_joints
from screwkin.model.robot import Robot
from screwkin.motors.library import motor_models, motors_of, names_motors

StiffnessChoice = float | Mapping[str, float] | None
SpringChoice = float | Mapping[str, float | Array] | None
"""A choice of stiffness whose arrays hold one number for each sample."""


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
    if _of_motors(robot, stiffness):
        return np.array([motor.stiffness for motor in motors_of(robot)], dtype=float)
    expected = "a positive number in N m/rad"
    return _by_joint(robot, "stiffness", _chosen(robot, stiffness), expected, lambda _, k: k > 0)


def spring_stiffness(robot: Robot, stiffness: SpringChoice = None, curved: Iterable[str] = ()) -> Array:
    """Stiffness (n,) of every joint's spring, or (..., n) where it changes along a batch.

    Args:
        robot: n joints.
        stiffness: as for ``joint_stiffness``; a joint may also have an array (...), a number for each sample,
            as a stiffness that changes with time. A joint without a motor turns freely, whatever the default
            is, unless it is named: 0.
        curved: names of the joints whose springs have a law of their own, and need none: 0.

    Raises:
        InputError, UnknownNameError: as for ``joint_stiffness``. ShapeError: arrays that do not broadcast.
    """
    motors, curved = motor_joints(robot), set(curved)
    passive = {name for name in robot.joint_names if name not in motors}
    needed = any(name not in passive | curved for name in robot.joint_names)
    if needed and _of_motors(robot, stiffness):
        return np.where([name in passive | curved for name in robot.joint_names], 0, joint_stiffness(robot))
    chosen = _chosen(robot, stiffness) if needed or stiffness is not None else {}
    given = chosen if isinstance(chosen, Mapping) else {"default": chosen}
    k = _by_joint(
        robot,
        "stiffness",
        {**dict.fromkeys(passive | curved, 0.0), **given},
        "a positive number in N m/rad, or an array of one for each sample",
        lambda name, k: k >= 0 if name in passive | curved else k > 0,
        arrays=True,
    )
    return np.where([name in curved for name in robot.joint_names], 0, k)


def _chosen(robot: Robot, stiffness: SpringChoice) -> Any:
    """What is given, or what the table says."""
    chosen = robot.servos.get("stiffness") if stiffness is None else stiffness
    if chosen is None:
        raise InputError(
            f"{robot.name} has no joint stiffness; give one in N m/rad, or write stiffness under [servos] "
            f"of its table, or a model of servo that is known: {', '.join(motor_models())}"
        )
    return chosen


def drive_losses(
    robot: Robot,
    stiffness: StiffnessChoice = None,
    damping: StiffnessChoice = None,
    armature: StiffnessChoice = None,
    friction: StiffnessChoice = None,
) -> tuple[Array, Array, Array]:
    """Damping (n,) [N m s/rad], rotor inertia (n,) [kg m^2], dry friction (n,) [N m] of every joint's servo.

    They take a share of the torque of servos that move. Each is given as a stiffness is. None stands for the
    figures of the table's servo models where the stiffness is theirs too, else for 0: a spring has none.

    Raises:
        InputError: a joint has none, or one is no finite number of at least 0.
        UnknownNameError: no such joint.
    """
    choices = {
        "damping": (damping, "N m s/rad"),
        "armature": (armature, "kg m^2"),
        "friction": (friction, "N m"),
    }
    if all(chosen is None for chosen, _ in choices.values()) and _of_motors(robot, stiffness):
        motors = motors_of(robot)
        figures = [(m.damping, m.armature, m.friction.coulomb) for m in motors]
        d, inertia, dry = np.array(figures, dtype=float).reshape(-1, 3).T
        return d, inertia, dry
    d, inertia, dry = (
        _by_joint(
            robot, what, 0.0 if chosen is None else chosen, f"a number of at least 0 {unit}", _not_negative
        )
        for what, (chosen, unit) in choices.items()
    )
    return d, inertia, dry


def _of_motors(robot: Robot, stiffness: SpringChoice) -> bool:
    """Whether the stiffness of the joints follows from the table's servo models."""
    return stiffness is None and robot.servos.get("stiffness") is None and names_motors(robot)


def _not_negative(name: str, value: Any) -> Any:
    return value >= 0


def _by_joint(
    robot: Robot,
    what: str,
    chosen: Any,
    expected: str,
    valid: Callable[[str, Any], Any],
    arrays: bool = False,
) -> Array:
    """The numbers (n,) of a choice, or (..., n) where arrays are allowed, every one of them checked."""
    by_name = chosen if isinstance(chosen, Mapping) else {"default": chosen}
    for name in by_name:
        if name != "default" and name not in robot.joint_names:
            raise UnknownNameError("joint", name, robot.joint_names)
    for name, value in by_name.items():
        number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
        several = arrays and isinstance(value, np.ndarray) and value.dtype.kind in "iuf"
        sound = math.isfinite(value) if number else several and np.isfinite(value).all()
        if not (sound and (valid(name, value) if number else np.all(valid(name, value)))):
            where = "" if name == "default" else f" of {name}"
            raise InputError(f"{what}{where} is {value!r}; it must be {expected}")
    missing = [name for name in robot.joint_names if name not in by_name and "default" not in by_name]
    if missing:
        raise InputError(f"no {what} for {', '.join(missing)}; name them, or give a default")
    every = {**dict.fromkeys(robot.joint_names, by_name.get("default")), **by_name}
    if not any(isinstance(value, np.ndarray) for value in every.values()):
        return np.array([every[name] for name in robot.joint_names], dtype=float)
    columns = [np.asarray(every[name], dtype=float) for name in robot.joint_names]
    batch = one_batch(
        {f"{what} of {name}": (x, 0) for name, x in zip(robot.joint_names, columns, strict=True)}
    )
    return np.stack([np.broadcast_to(x, batch) for x in columns], axis=-1)
