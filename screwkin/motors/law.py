"""The law of a servo's motor, for any engine: torque of the motor, and the budget of its friction.

A firmware loop makes a duty of the position error; its share of the supply drives the winding against the
back-EMF. Friction opposes motion by at most its budget and stops it within that; an engine's solver, or
``stopping_torque``, finds how much of it acts.

Source: Duclusaud, Passault, Padois, Ly (ICRA 2025), "Extended Friction Models for the Physics Simulation of
Servo Actuators", friction models M1 to M6.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from screwkin.motors.records import Friction, Motor


class Drive(NamedTuple):
    """What a motor does in a step: its torque, and the greatest torque of its friction [N m]."""

    torque: Any
    budget: Any


def drive(motor: Motor, goal: Any, q: Any, qd: Any, external: Any) -> Drive:
    """Motor torque and friction budget, each in the shape (...) of the arguments.

    Args:
        motor: figures that broadcast with the rest.
        goal: commanded angle [rad], ``motor.lag`` ago.
        q: angle at the output [rad].
        qd: speed there [rad/s].
        external: torque of the load on the output [N m], see ``load_torque``.
    """
    torque = motor_torque(motor, duty(motor, goal - q), qd)
    return Drive(torque, friction_budget(motor.friction, torque, external, qd))


def duty(motor: Motor, error: Any) -> Any:
    """Share of the supply [-1, 1] that the firmware applies for a position error [rad]."""
    size = np.abs(error) - motor.dead_zone
    wanted = motor.punch + motor.gain * motor.kp * size
    return np.sign(error) * np.minimum(np.where(size > 0.0, wanted, 0.0), motor.max_duty)


def motor_torque(motor: Motor, share: Any, qd: Any) -> Any:
    """Torque of the winding at the output [N m] for a duty and a speed [rad/s]."""
    current = (share * motor.voltage - motor.constant * qd) / motor.resistance
    return motor.constant * np.minimum(np.maximum(current, -motor.max_current), motor.max_current)


def friction_budget(friction: Friction, torque: Any, external: Any, qd: Any) -> Any:
    """Greatest friction torque [N m] for torques of motor and load [N m] and a speed [rad/s]."""
    f, speed = friction, np.abs(qd)
    budget = f.coulomb + f.viscous * speed + np.abs(f.load_external * external - f.load_motor * torque)
    if not f.fades:
        return budget
    at_rest = f.stribeck + np.abs(f.load_external_stribeck * external - f.load_motor_stribeck * torque)
    if f.squares:
        at_rest = at_rest + _squares(f, torque, external)
    return budget + at_rest * np.exp(-((speed / f.speed) ** f.shape))


def _squares(f: Friction, torque: Any, external: Any) -> Any:
    """The weaker side's square where motor and load oppose each other."""
    driving = np.abs(torque) > np.abs(external)
    square = np.where(driving, f.load_external_square * external**2, f.load_motor_square * torque**2)
    return np.where(torque * external < 0.0, square, 0.0)


def stopping_torque(budget: Any, inertia: Any, qd: Any, torque: Any, dt: float) -> Any:
    """Friction torque through a step [N m]: what stops an inertia under a torque, within the budget."""
    wanted = -(inertia * qd / dt + torque)
    return np.minimum(np.maximum(wanted, -budget), budget)


def load_torque(motor: Motor, torque: Any, friction: Any, qdd: Any) -> Any:
    """Torque of the load on the output [N m] in a step with these torques and this acceleration [rad/s^2].

    What passes the gears is what motor and friction leave after the rotor is accelerated; the load is its
    opposite. At rest it is the negative of both.
    """
    return motor.armature * qdd - torque - friction
