"""How near a planned motion takes every servo to what its motor can do: speed, torque, and both at once.

A motor's torque falls with its speed, in a straight line from the greatest torque at rest to none at the
greatest speed; where the load turns the motor, it holds more than at rest. With tau and qd of one sign where
the motor drives, the line is |tau / effort + qd / velocity| = 1: the whole supply on the winding.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from screwkin.errors import InputError
from screwkin.gait.feed_forward import walking_torques
from screwkin.kinematics.limits import limited_joints
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory


@dataclass(frozen=True)
class ServoShare:
    """The most that a motion asks of a joint, as shares of its limits; 0 where it has none.

    speed: of its greatest speed. torque: of its greatest torque. line: of the supply, by its speed-torque
    line; at: when that is [s]. None where torques do not follow from the motion: on other than two feet, and
    where closures bear loads too.
    """

    speed: float
    torque: float | None = None
    line: float | None = None
    at: float | None = None


def servo_shares(robot: Robot, motion: Trajectory) -> Mapping[str, ServoShare]:
    """The shares of every joint, by its name.

    Args:
        robot: n joints with greatest speeds and torques.
        motion: of that robot, T samples.
    """
    joints = limited_joints(robot)
    velocity, effort = np.array([(float(joint.velocity), float(joint.effort)) for joint in joints]).T
    speed = motion.qd / velocity
    fastest = np.abs(speed).max(axis=0)
    try:
        if robot.closures:
            raise InputError("closures share loads")
        torque = walking_torques(robot, motion) / effort
    except InputError:
        return {joint.name: ServoShare(float(s)) for joint, s in zip(joints, fastest, strict=True)}
    line = np.abs(torque + speed)
    rows = zip(joints, fastest, np.abs(torque).max(axis=0), line.T, strict=True)
    return {
        joint.name: ServoShare(
            float(s), float(most), float(along.max()), float(motion.time[int(along.argmax())])
        )
        for joint, s, most, along in rows
    }
