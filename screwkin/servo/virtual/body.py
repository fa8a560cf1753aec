"""The body of a virtual servo: its motion, deflection under load, temperature and alarms.

The motor follows its goal, or a rate, to first order with a limited speed; the load deflects the output on a
spring. All of it is in closed form, so that it does not matter how often one looks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

VOLTAGE, OVERHEAT, OVERLOAD = 0x01, 0x04, 0x20
"""Bits of an alarm; the same in the error byte of protocol 1.0 and the hardware error register of 2.0."""

_STALL_RISE = 60.0  # K above ambient that full torque would lead to
_WARMING = 60.0  # s


@dataclass(frozen=True)
class ToAngle:
    """Drive to an angle from the centre [rad], no faster than ``speed`` [rad/s]."""

    angle: float
    speed: float


@dataclass(frozen=True)
class AtRate:
    """Drive at a rate [rad/s] without end."""

    rate: float


Drive = ToAngle | AtRate | None
"""What the firmware wants of the motor; None: limp."""


@dataclass
class Body:
    """Angles from the servo's centre [rad], torques [N m], times [s], temperatures [degrees Celsius].

    ``stiffness`` [N m/rad] is that of the joint; ``load`` is what the world turns the output with, positive
    towards greater ticks, to which ``planned`` adds what ``load_at`` says of the body's time. ``lag`` is the
    time constant of the motion. A load beyond the torque limit is an overload once it has lasted for
    ``patience``. ``sag`` [V] is what the current of all servos takes of the supply.
    """

    stall_torque: float
    voltage: float
    angle: float = 0.0
    stiffness: float = math.inf
    load: float = 0.0
    load_at: Callable[[float], float] | None = None
    planned: float = 0.0
    lag: float = 0.025
    patience: float = 0.5
    temperature: float = 30.0
    ambient: float = 30.0
    rate: float = 0.0
    time: float = 0.0
    overloaded: float = 0.0
    sag: float = 0.0
    blocked: bool = False

    @property
    def supply(self) -> float:
        """The voltage that arrives [V]."""
        return self.voltage - self.sag

    @property
    def turned_with(self) -> float:
        """What the world turns the output with, all together [N m]."""
        return self.load + self.planned

    @property
    def output(self) -> float:
        """The angle of the output: the motor's, and the deflection of the spring."""
        return self.angle + self.turned_with / self.stiffness

    @property
    def effort(self) -> float:
        """The torque that holds against the load, as a share of the stall torque."""
        return -self.turned_with / self.stall_torque

    def advance(self, time: float, drive: Drive, torque: float) -> None:
        """Go on to a time with a drive and a torque limit [share of the stall torque]."""
        dt = time - self.time
        if dt <= 0:
            return
        self.time = time
        if self.load_at is not None:
            self.planned = self.load_at(time)
        if drive is None:
            self.rate, heat, strained = 0.0, 0.0, False
        else:
            if self.blocked:
                self.rate = 0.0
            elif isinstance(drive, ToAngle):
                self.angle, self.rate = approached(self.angle, drive.angle, dt, drive.speed, self.lag)
            else:
                self.angle, self.rate = spin(self.angle, self.rate, drive.rate, dt, self.lag)
            heat, strained = self.effort**2, abs(self.effort) > torque
        warm = self.ambient + _STALL_RISE * heat
        self.temperature = warm + (self.temperature - warm) * math.exp(-dt / _WARMING)
        self.overloaded = self.overloaded + dt if strained else 0.0


def spin(angle: float, rate: float, wanted: float, dt: float, lag: float) -> tuple[float, float]:
    """Angle and rate after ``dt`` of d(rate)/dt = (wanted - rate)/lag."""
    left = (rate - wanted) * math.exp(-dt / lag)
    return angle + wanted * dt + lag * (rate - wanted - left), wanted + left


def approached(angle: float, goal: float, dt: float, speed: float, lag: float) -> tuple[float, float]:
    """Angle and rate after ``dt`` of d(angle)/dt = (goal - angle)/lag, but no faster than ``speed``."""
    way, sense = abs(goal - angle), math.copysign(1.0, goal - angle)
    bend = speed * lag  # where the first order becomes slower than the limit
    if way > bend:
        even = (way - bend) / speed
        if dt <= even:
            return angle + sense * speed * dt, sense * speed
        way, dt = bend, dt - even
    left = way * math.exp(-dt / lag)
    return goal - sense * left, sense * left / lag
