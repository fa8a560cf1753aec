"""What servos do to joints, for every engine alike: a torque, and a motor that wants a rate within a bound.

A rigid servo is the motor alone: in every step it brings its joint to the commanded rate, plus a share of the
position error, with as much torque as that takes up to its effort. A spring is the torque alone. The firmware
loop of a real servo is a torque, and its dry friction a motor that wants rate zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.mechanism.linkages import motor_joints
from screwkin.model.robot import Robot
from screwkin.sim.backend import Command

POSITION_GAIN = 0.5
"""Share of a position error that a rigid servo removes in one step."""
UNLIMITED = 1e9
"""Stands for an infinite effort [N m] or limit [rad or m], which engines cannot compute with."""


@dataclass(frozen=True, eq=False)
class Actuation:
    """What is done to every joint in one step, each (n,).

    torque on the joint [N m or N]; rate that its motor wants [rad/s or m/s]; bound of the motor's own torque.
    """

    torque: Array
    rate: Array
    bound: Array

    def on(self, motors: Array) -> Actuation:
        """The same on the joints that have motors, given as (n,) bool; nothing on the others."""
        return Actuation(np.where(motors, self.torque, 0.0), self.rate, np.where(motors, self.bound, 0.0))


def motored(robot: Robot) -> Array:
    """(n,) bool: the joints that have motors."""
    driven = motor_joints(robot)
    return np.array([name in driven for name in robot.joint_names], dtype=bool)


class Servos(Protocol):
    """The servos of a robot. Joints stand in table order."""

    name: str
    rotor_inertia: Array
    """Inertia (n,) that every rotor adds to its joint, as seen there [kg m^2 or kg]."""
    relative_rotors: bool
    """Whether rotors must turn with their joints alone; else an engine may let them steady its step."""

    def reset(self, q: Array) -> None:
        """Servos at rest at positions (n,)."""
        ...

    def actuate(self, q: Array, qd: Array, motor: Array, command: Command, dt: float) -> Actuation:
        """What they do in a step.

        Args:
            q: positions (n,) at its start [rad or m].
            qd: rates (n,) at its start.
            motor: (n,) torque that the bounded motors used in the step before.
            command: to follow.
            dt: duration of the step [s].
        """
        ...


class RigidServos:
    """Servos that follow their commands exactly, within the efforts of the table."""

    name = "rigid"
    relative_rotors = False

    def __init__(self, robot: Robot, gain: float = POSITION_GAIN) -> None:
        self.rotor_inertia = self._no_torque = np.zeros(len(robot.joints))
        self._effort = np.array([joint.effort for joint in robot.joints], dtype=float)
        self._gain = gain

    def reset(self, q: Array) -> None:
        """Nothing is remembered."""

    def actuate(self, q: Array, qd: Array, motor: Array, command: Command, dt: float) -> Actuation:
        """The commanded rate, and a share of the position error."""
        rate = np.asarray(command.qd) + self._gain / dt * (np.asarray(command.q) - q)
        return Actuation(self._no_torque, rate, self._effort)
