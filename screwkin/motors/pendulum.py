"""A mass on the shaft of a servo, integrated by the library itself: the bench of identification.

The step is semi-implicit Euler with friction that stops within its budget, as engines take it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.motors.law import drive, load_torque, stopping_torque
from screwkin.motors.records import Motor

STEP = 1e-3
"""Duration of a step by default [s]."""


@dataclass(frozen=True, eq=False)
class Pendulum:
    """What hangs on a horizontal shaft: inertia about it [kg m^2], and weight [N m].

    The weight's torque at angle q is -weight sin(q + offset): at -offset it hangs straight down. Figures are
    numbers, or arrays of samples.
    """

    inertia: Any
    weight: Any
    offset: Any = 0.0

    @classmethod
    def of_mass(cls, mass: float, length: float, gravity: float = 9.81) -> Pendulum:
        """A mass [kg] in a point at a distance [m]."""
        return cls(mass * length**2, mass * gravity * length)


def swing(motor: Motor, pendulum: Pendulum, goals: Array, q: Any, qd: Any = 0.0, dt: float = STEP) -> Array:
    """Angles (K + 1, ...) [rad] at the ends of K steps, the first row being the start.

    Args:
        motor: figures that broadcast to (...).
        pendulum: likewise.
        goals: (K, ...) [rad] at the start of each step, delayed already; see ``delayed``.
        q: angle (...) at the start [rad].
        qd: speed (...) at the start [rad/s].
        dt: [s].
    """
    inertia = pendulum.inertia + motor.armature
    shape = np.broadcast_shapes(np.shape(goals[0]), np.shape(q), np.shape(inertia), np.shape(motor.constant))
    q, qd, external = np.broadcast_to(q, shape), np.broadcast_to(qd, shape), np.zeros(shape)
    angles = np.empty((len(goals) + 1, *shape))
    angles[0] = q
    for k, goal in enumerate(goals):
        torque, budget = drive(motor, goal, q, qd, external)
        free = torque - pendulum.weight * np.sin(q + pendulum.offset)
        friction = stopping_torque(budget, inertia, qd, free, dt)
        qdd = (free + friction) / inertia
        external = load_torque(motor, torque, friction, qdd)
        qd = qd + dt * qdd
        q = q + dt * qd
        angles[k + 1] = q
    return angles


def delayed(goals: Array, lag: Any, dt: float = STEP) -> Array:
    """Goals (K, ...) at steps of dt, later by a lag (...) [s]; before it passes, the first goal holds."""
    rows = np.arange(len(goals)).reshape(-1, *(1,) * (goals.ndim - 1)) - np.asarray(lag) / dt
    rows = np.maximum(rows, 0.0)
    low = np.floor(rows).astype(int)
    high, part = np.minimum(low + 1, len(goals) - 1), rows - low
    columns = np.broadcast_to(goals, np.broadcast_shapes(goals.shape, rows.shape))
    earlier = np.take_along_axis(columns, np.broadcast_to(low, columns.shape), 0)
    later = np.take_along_axis(columns, np.broadcast_to(high, columns.shape), 0)
    return np.asarray(earlier + part * (later - earlier))
