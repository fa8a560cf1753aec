"""What a simulator is to screwkin: reset, step, observe, close."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.model.state import State


@dataclass(frozen=True, eq=False)
class Command:
    """Commands to the joints for one step: q (n,) at its start, qd (n,) through it [rad or m, per s].

    T_world_base (4, 4) is where the plan sees the base; a backend with physics takes no notice of it. force
    (3,): on the base link's CoM through the step, world axes [N]; None for none.
    """

    q: Any
    qd: Any
    T_world_base: Any
    force: Any = None


@dataclass(frozen=True)
class Contact:
    """A point where the robot touches the floor: place [m], force of the floor [N], and the link's name."""

    link: str
    point: tuple[float, float, float]
    force: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Observation:
    """What is seen after a step.

    time [s] since reset; T_world_base (4, 4); q, qd (n,); torque (n,) of the motors [N m];
    T_world_foot (feet, 4, 4): the tips of the legs in table order; ankle_wrench (feet, 6): ground wrench
    [m; f] about the world origin as the sensor in each leg's last joint feels it, NaN where there is none;
    contacts: the points that press on the floor.
    """

    time: float
    T_world_base: Array
    q: Array
    qd: Array
    torque: Array
    T_world_foot: Array
    ankle_wrench: Array
    contacts: tuple[Contact, ...]


def moment_about_origin(point: Array, force: Array) -> Array:
    """Moment (3,) [N m] about the world origin of a force at a point; ``np.cross`` is ten times slower."""
    (u, v, w), (x, y, z) = point.tolist(), force.tolist()
    return np.array([v * z - w * y, w * x - u * z, u * y - v * x])


class Backend(Protocol):
    """A simulated or real robot. Joints stand in table order everywhere."""

    name: str
    servo: str
    """What its servos are: ``rigid``, ``springs``, …"""
    settings: Mapping[str, Any]
    """Of its solver, as JSON data, with ``remarks`` on what it changes of the robot."""
    dt: float
    """Duration of one step [s]."""

    def reset(self, state: State) -> Observation:
        """Place the robot at rest in an unbatched state, and time at 0."""
        ...

    def step(self, command: Command) -> None:
        """Let ``dt`` pass under a command."""
        ...

    def observe(self) -> Observation:
        """The present state; looking changes nothing."""
        ...

    def close(self) -> None:
        """Give everything back; closing twice is harmless."""
        ...
