"""What differs between a plan's world and the one it meets: a record of figures with units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.terrain import STEEPEST, Terrain
from screwkin.errors import Fault, InputError, near, one_of

Figure = float | Mapping[str, float]
"""One number for all, or numbers by the names of links or joints; those not named stay as they are."""
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Perturbation:
    """A world that is not the planned one; every default leaves it as planned.

    Of the robot: mass: factor of a link's mass, and of its inertia with it, for all links or by name;
    inertia: factor of all inertias beyond that; com: shift of the base link's CoM in base axes [m]; payload
    [kg]: a point mass on the base link at payload_at, in base axes of the zero pose [m].

    Of the floor: friction: coefficient, None for the usual one; restitution: speed after a bounce as a share
    of the speed before; slope: angles [rad] by which the floor rises ahead and to the left beyond the plan,
    as in ``Terrain``; rise [m]: how much higher it is where x is beyond rise_at [m], negative for a drop.

    push: impulse on the base link's CoM [N s], in the plan's axes, from push_at, in the trajectory's time,
    for push_duration [s].

    Of the servos, for all joints or by name: lag: from a command to its effect [s]; stiffness: factor of the
    torque per position error; backlash: play in which nothing is transmitted [rad or m]; torque: factor of
    the greatest torque; fade: share of it that is lost in a second [1/s]. dropped: share of the frames that
    never arrive, each of frame [s]; the servos stay at the one before.

    Of the senses: imu_noise [rad] and imu_rate_noise [rad/s]: standard deviations about each axis; imu_bias
    [rad] and imu_rate_bias [rad/s], about the axes of the base. Gravity holds the lean; what rates are wrong
    by about the vertical turns the heading more and more, a noise's as it wanders. sense_lag [s]: from what
    happens to its reading; cells: 1 if feet feel forces, 0 if not. seed: of what is random in a run.
    """

    mass: Figure = 1.0
    inertia: float = 1.0
    com: Triple = (0.0, 0.0, 0.0)
    payload: float = 0.0
    payload_at: Triple = (0.0, 0.0, 0.0)
    friction: float | None = None
    restitution: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)
    rise: float = 0.0
    rise_at: float = 0.0
    push: Triple = (0.0, 0.0, 0.0)
    push_at: float = 0.0
    push_duration: float = 0.02
    lag: Figure = 0.0
    stiffness: Figure = 1.0
    backlash: Figure = 0.0
    torque: Figure = 1.0
    fade: float = 0.0
    dropped: float = 0.0
    frame: float = 0.01
    imu_noise: float = 0.0
    imu_rate_noise: float = 0.0
    imu_bias: Triple = (0.0, 0.0, 0.0)
    imu_rate_bias: Triple = (0.0, 0.0, 0.0)
    sense_lag: float = 0.0
    cells: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        faults = [str(fault) for fault in perturbation_faults(vars(self))]
        if faults:
            raise InputError("; ".join(faults))

    @property
    def nothing(self) -> bool:
        """Whether the world is the planned one."""
        return self == NONE

    def gravity(self, strength: float) -> Array:
        """Acceleration of gravity (3,) in the plan's axes, from its strength [m/s^2]."""
        down = np.array([0.0, 0.0, -strength])
        return down if not any(self.slope) else np.asarray(down @ Terrain(*self.slope).R)

    def force(self, time: float, dt: float) -> Array | None:
        """The push's mean force (3,) in a step from a time of the trajectory [N], None where it is over."""
        begun, ended = max(time, self.push_at), min(time + dt, self.push_at + self.push_duration)
        if not any(self.push) or ended - begun < 1e-9 * dt:
            return None
        return np.array(self.push) * ((ended - begun) / (self.push_duration * dt))

    def to_dict(self) -> dict[str, Any]:
        """As JSON data: what differs from the planned world only."""
        differing = {key: value for key, value in vars(self).items() if value != DEFAULTS[key]}
        return {
            key: dict(value)
            if isinstance(value, Mapping)
            else list(value)
            if isinstance(value, tuple)
            else value
            for key, value in differing.items()
        }


def noted(perturbation: Perturbation) -> dict[str, Any]:
    """A backend's settings that say what differs from the plan; none where nothing does."""
    return {} if perturbation.nothing else {"perturbation": perturbation.to_dict()}


def by_name(figure: Figure, names: Iterable[str], usual: float, what: str) -> Array:
    """A figure (n,) for every name.

    Args:
        figure: a number for all, or numbers by name.
        names: of links or joints, in order.
        usual: for those not named.
        what: the names are of, in messages.

    Raises:
        UnknownNameError: a number is for none of them.
    """
    every = tuple(names)
    if not isinstance(figure, Mapping):
        return np.full(len(every), float(figure))
    for name in figure:
        one_of(what, name, every)
    return np.array([figure.get(name, usual) for name in every], dtype=float)


_BOUNDS: Mapping[str, tuple[float, float]] = {
    "mass": (1e-3, 1e3),
    "inertia": (1e-3, 1e3),
    "com": (-10.0, 10.0),
    "payload": (0.0, 1e3),
    "payload_at": (-10.0, 10.0),
    "friction": (0.0, 10.0),
    "restitution": (0.0, 0.95),
    "slope": (-STEEPEST, STEEPEST),
    "rise": (-1.0, 1.0),
    "rise_at": (-1e3, 1e3),
    "push": (-1e4, 1e4),
    "push_at": (-1e6, 1e6),
    "push_duration": (1e-3, 1e3),
    "lag": (0.0, 1.0),
    "stiffness": (1e-3, 1e3),
    "backlash": (0.0, 1.0),
    "torque": (0.0, 1e3),
    "fade": (0.0, 1e3),
    "dropped": (0.0, 0.99),
    "frame": (1e-3, 1.0),
    "imu_noise": (0.0, 1.0),
    "imu_rate_noise": (0.0, 100.0),
    "imu_bias": (-1.0, 1.0),
    "imu_rate_bias": (-100.0, 100.0),
    "sense_lag": (0.0, 1.0),
    "cells": (0, 1),
    "seed": (0, 2**63),
}
"""Least and greatest value of every number; where a key has several numbers, of each."""


def perturbation_faults(values: Mapping[str, Any]) -> Iterator[Fault]:
    """What is wrong in values by key, one fault for a key.

    Args:
        values: numbers, tuples of numbers, or mappings of numbers by name.
    """
    for key, value in values.items():
        if key not in DEFAULTS:
            fix = f"{near(key, DEFAULTS)}Valid: {', '.join(DEFAULTS)}"
            yield Fault(PLACE, key, "unknown key", fix)
            continue
        usual, (least, most) = DEFAULTS[key], _BOUNDS[key]
        if value is None and usual is None:
            continue
        numbers: Iterable[Any] = [value]
        if isinstance(usual, tuple):
            if not isinstance(value, tuple) or len(value) != len(usual):
                yield Fault(PLACE, key, f"{value!r} is no list of {len(usual)}", f"Give {len(usual)} numbers")
                continue
            numbers = value
        elif isinstance(value, Mapping) and key in BY_NAME:
            numbers = value.values()
        if not all(_is_number(x) and least <= x <= most for x in numbers):
            fix = f"Give {'whole ' * (key in WHOLE)}numbers from {least:g} to {most:g}"
            yield Fault(PLACE, key, f"{value!r} is out of range", fix)
        elif key in WHOLE and not isinstance(value, int):
            yield Fault(PLACE, key, f"{value!r} is no whole number", "Give a whole number")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


PLACE = "[perturbation]"
"""Where the keys stand in a file."""
BY_NAME = ("mass", "lag", "stiffness", "backlash", "torque")
"""Keys that may hold numbers by the names of links (mass) or joints."""
WHOLE = ("cells", "seed")
"""Keys of whole numbers."""
DEFAULTS: Mapping[str, Any] = MappingProxyType({f.name: f.default for f in fields(Perturbation)})
"""What every key is where nothing differs from the plan."""
NONE = Perturbation()
"""The planned world."""
