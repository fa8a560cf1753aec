"""Real servos in any engine: a firmware loop drives the motor, and its friction is a brake within a budget.

The engine solves for the friction that acts, as a bounded motor that wants rate zero, and carries the rotors'
inertia; what the loop, the winding and the gears do is the law in ``screwkin.motors``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.motors.law import drive, load_torque
from screwkin.motors.records import Motor, stacked
from screwkin.sim.backend import Command
from screwkin.sim.delay import DelayLine
from screwkin.sim.drive import Actuation


class MotorServos:
    """A motor with its firmware at every joint."""

    relative_rotors = True

    def __init__(self, motors: Sequence[Motor], dt: float, name: str) -> None:
        """Servos in table order, for steps of at most dt [s].

        Raises:
            InputError: none, or the step is too long for them.
        """
        self.name, self._motors, self._dt = name, tuple(motors), dt
        self._motor = motor = stacked(motors)
        self._line = DelayLine(motor.lag, dt)
        self.rotor_inertia = motor.armature
        _check_step(motor, dt)
        self._still = np.zeros(len(motors))
        self.reset(self._still)

    def reset(self, q: Array) -> None:
        """Servos at rest at positions (n,), with no load."""
        self._qd, self._torque, self._loaded = self._still, self._still, False
        self._line.reset()

    @property
    def lag(self) -> Array:
        """From a goal to its effect (n,) [s]."""
        return np.asarray(self._motor.lag)

    def at_once(self) -> MotorServos:
        """The same motors without their lag."""
        return MotorServos([replace(motor, lag=0.0) for motor in self._motors], self._dt, self.name)

    def actuate(self, q: Array, qd: Array, motor: Array, command: Command, dt: float) -> Actuation:
        """The winding's torque, and friction as a bounded motor that wants rate zero."""
        external = self._still
        if self._loaded:
            external = load_torque(self._motor, self._torque, motor, (qd - self._qd) / dt)
        torque, budget = drive(self._motor, self._line.through(np.asarray(command.q)), q, qd, external)
        self._qd, self._torque, self._loaded = qd, torque, True
        return Actuation(torque, self._still, budget)


def _check_step(motor: Motor, dt: float) -> None:
    """Refuse a step in which a torque held through it would swing up the rotor alone.

    It is stable on an inertia I while k dt^2 + 2 d dt < 4 I (semi-implicit Euler), with the stiffness k of
    the loop and the damping d of the back-EMF.
    """
    damping = motor.constant**2 / motor.resistance
    use = (motor.stiffness * dt**2 + 2.0 * damping * dt) / (4.0 * motor.armature)
    if not (use < 1.0).all():
        worst = int(np.argmax(use))
        raise InputError(
            f"a step of {1e3 * dt:g} ms is too long for the servo of joint {worst}, with "
            f"{motor.stiffness[worst]:.3g} N m/rad and {damping[worst]:.3g} N m s/rad on a rotor of "
            f"{motor.armature[worst]:.3g} kg m^2"
        )
