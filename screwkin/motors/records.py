"""What a servo is to physics: a motor behind a firmware loop, with friction in its gears."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from screwkin.errors import InputError

FrictionModel = Literal["m1", "m2", "m3", "m4", "m5", "m6"]


@dataclass(frozen=True)
class Friction:
    """Coefficients of a friction budget; each is a number, or an array of joints or samples.

    coulomb [N m]; viscous [N m s/rad]; stribeck [N m]: more at rest, fading with the speed as
    exp(-|w / speed|^shape), speed [rad/s]; load_motor and load_external: shares of the torques of motor and
    load; the same at rest with ``_stribeck``, and of their squares with ``_square`` [1/(N m)].
    """

    coulomb: Any = 0.0
    viscous: Any = 0.0
    stribeck: Any = 0.0
    speed: Any = 1.0
    shape: Any = 1.0
    load_motor: Any = 0.0
    load_external: Any = 0.0
    load_motor_stribeck: Any = 0.0
    load_external_stribeck: Any = 0.0
    load_motor_square: Any = 0.0
    load_external_square: Any = 0.0

    @cached_property
    def fades(self) -> bool:
        """Whether anything depends on the Stribeck speed."""
        return any(
            np.any(term)
            for term in (self.stribeck, self.load_motor_stribeck, self.load_external_stribeck, *self._squares)
        )

    @cached_property
    def squares(self) -> bool:
        """Whether anything depends on squares of torques."""
        return any(np.any(term) for term in self._squares)

    @property
    def _squares(self) -> tuple[Any, Any]:
        return self.load_motor_square, self.load_external_square


@dataclass(frozen=True)
class Motor:
    """A servo's motor and firmware; each figure is a number, or an array of joints or samples.

    constant: torque constant at the output, N m/A and V s/rad; resistance [ohm]; voltage of the supply [V];
    armature: inertia of the rotor at the output [kg m^2]; gain: duty per rad and unit of the firmware's gain;
    kp: that gain; dead_zone [rad]: error without any duty; punch: least duty beyond it; max_duty; max_current
    [A]; lag: from a goal to its effect [s]; friction: see there.
    """

    constant: Any
    resistance: Any
    voltage: Any
    armature: Any
    gain: Any
    kp: Any = 1.0
    dead_zone: Any = 0.0
    punch: Any = 0.0
    max_duty: Any = 1.0
    max_current: Any = math.inf
    lag: Any = 0.0
    friction: Friction = field(default_factory=Friction)

    @property
    def stall_torque(self) -> Any:
        """Greatest torque at rest [N m], friction apart."""
        current = np.minimum(self.max_duty * self.voltage / self.resistance, self.max_current)
        return self.constant * current

    @property
    def stiffness(self) -> Any:
        """Torque per error in the steady state [N m/rad], below the limits and beyond the dead zone."""
        return self.gain * self.kp * self.voltage * self.constant / self.resistance

    @property
    def damping(self) -> Any:
        """Torque per speed [N m s/rad] that back-EMF and viscous friction take."""
        return self.constant**2 / self.resistance + self.friction.viscous


@dataclass(frozen=True)
class MotorModel:
    """Figures of a servo model and what is known of them.

    identified: measured on a bench, with friction; else assumed from the maker's sheet. ranges: least and
    greatest value of figures that are not certain. registers: the model whose registers the bus finds in it,
    where that is another one.
    """

    model: str
    aliases: tuple[str, ...]
    source: str
    identified: bool
    motor: Motor
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    registers: str = ""


def stacked(motors: Sequence[Motor]) -> Motor:
    """One record with arrays (n,) for n motors.

    Raises:
        InputError: there are none.
    """
    if not motors:
        raise InputError("no motors to stack; give at least one")
    friction = _columns(Friction, [motor.friction for motor in motors])
    return Motor(**_columns(Motor, motors, skip="friction"), friction=Friction(**friction))


def _columns(kind: type, records: Sequence[Any], skip: str = "") -> dict[str, Any]:
    names = [f.name for f in fields(kind) if f.name != skip]
    return {name: np.array([getattr(record, name) for record in records], dtype=float) for name in names}
