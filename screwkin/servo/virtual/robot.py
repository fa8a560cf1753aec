"""The servos of a robot, virtual: each where its joint stands, as stiff as its joint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from screwkin.compliance.springs import StiffnessChoice, joint_stiffness
from screwkin.errors import InputError, ShapeError
from screwkin.model.robot import Robot
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.servo import VirtualServo


def virtual_servos(
    robot: Robot,
    q: Sequence[float] | None = None,
    stiffness: StiffnessChoice = None,
    return_delay: float = 0.0,
    changed: Mapping[str, float] | None = None,
) -> list[VirtualServo]:
    """A virtual servo for every joint of a robot that has a motor, in the order of its joints.

    Args:
        robot: with ``[servos]`` in its table.
        q: joint angles [rad] where they stand; default: the posture ``home``, or all 0 without one.
        stiffness: of the joints [N m/rad]; default: the table's, or rigid without one.
        return_delay: of every servo [s]; 0 to 508 microseconds.
        changed: registers of every servo set otherwise, by name.

    Raises:
        TableError: the faults of ``[servos]``.
        InputError: q, the stiffness or the delay is wrong, or a servo cannot stand there.
    """
    servos = ServoMap.of(robot)
    if q is None:
        home = [posture.q for posture in robot.postures if posture.name == "home"]
        q = home[0] if home else (0.0,) * len(robot.joints)
    if len(q) != len(robot.joints):
        raise ShapeError(f"q has {len(q)} values; {robot.name} has {len(robot.joints)} joints")
    if not 0 <= return_delay <= 508e-6:
        raise InputError(f"return delay {return_delay!r} s; servos have 0 to 0.000508 s")
    springs = [math.inf] * len(q)
    if stiffness is not None or "stiffness" in robot.servos:
        springs = joint_stiffness(robot, stiffness).tolist()
    virtual = []
    for servo in servos.joints:
        place = robot.joint_names.index(servo.joint)
        angle, spring = q[place], springs[place]
        servo.ticks_from_angle(angle)  # refused if it cannot stand there
        one = VirtualServo(
            servo.profile, servo.id, servo.direction * angle + servo.zero, spring, servos.baud, return_delay
        )
        for name, value in (changed or {}).items():
            one.put(name, int(value))
        virtual.append(one)
    return virtual
