"""Real servos in any engine: a firmware loop drives the motor, and its friction is a brake within a budget.

The engine solves for the friction that acts, as a bounded motor that wants rate zero, and carries the rotors'
inertia; what the loop, the winding and the gears do is the law in ``screwkin.motors``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.motors.law import drive, load_torque
from screwkin.motors.records import Motor, stacked
from screwkin.sim.backend import Command
from screwkin.sim.drive import Actuation


class MotorServos:
    """A motor with its firmware at every joint."""

    def __init__(self, motors: Sequence[Motor], dt: float, name: str) -> None:
        """Servos in table order, for steps of at most dt [s].

        Raises:
            InputError: none, or the step is too long for them.
        """
        self.name = name
        self._motor = motor = stacked(motors)
        self.rotor_inertia = motor.armature
        _check_step(motor, dt)
        self._still = np.zeros(len(motors))
        self.reset(self._still)

    def reset(self, q: Array) -> None:
        """Servos at rest at positions (n,), with no load."""
        self._qd, self._torque, self._loaded = self._still, self._still, False
        self._goals: list[Array] = []

    def actuate(self, q: Array, qd: Array, motor: Array, command: Command, dt: float) -> Actuation:
        """The winding's torque, and friction as a bounded motor that wants rate zero."""
        external = self._still
        if self._loaded:
            external = load_torque(self._motor, self._torque, motor, (qd - self._qd) / dt)
        torque, budget = drive(self._motor, self._goal(np.asarray(command.q), dt), q, qd, external)
        self._qd, self._torque, self._loaded = qd, torque, True
        return Actuation(torque, self._still, budget)

    def _goal(self, newest: Array, dt: float) -> Array:
        """What the servos act on (n,): the goal of a lag ago, between two steps where it falls there."""
        steps = self._motor.lag / dt
        if not steps.any():
            return newest
        count = int(np.ceil(steps.max())) + 1
        self._goals = [newest, *self._goals[: count - 1]]
        past = np.array(self._goals)
        ago = np.minimum(steps, len(past) - 1)
        low = np.minimum(ago.astype(int), max(len(past) - 2, 0))
        high, joints = np.minimum(low + 1, len(past) - 1), np.arange(len(newest))
        return np.asarray(past[low, joints] + (ago - low) * (past[high, joints] - past[low, joints]))


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
