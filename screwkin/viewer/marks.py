"""What explains a robot beside its body: screw axes, frames, and the circuits of its closed mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot
from screwkin.sim.solids import robot_size

AXIS = 0.09
"""Half the length that is drawn of a screw axis, in sizes of the robot."""
_SAME = 1e-9  # m: points of a way that coincide


@dataclass(frozen=True, eq=False)
class Axis:
    """A joint's screw axis.

    Attributes:
        joint: its name.
        link: index of the link that carries it: the joint's child.
        ends: (2, 3) [m] in the zero pose, in base axes; it points from the first to the second.
        slides: whether the joint slides along it, without turning.
    """

    joint: str
    link: int
    ends: Array
    slides: bool


@dataclass(frozen=True, eq=False)
class PlacedFrame:
    """A frame by name: index of the link that carries it, its pose (4, 4) in the zero pose, in base axes."""

    name: str
    link: int
    pose: Array


@dataclass(frozen=True, eq=False)
class Way:
    """A circuit as a closed line: points (K, 3) [m], and whether the leg after each is a virtual chain."""

    points: Array
    virtual: tuple[bool, ...]

    @property
    def legs(self) -> Array:
        """Ends (K, 2, 3) of its legs; the last one leads back to the first point."""
        return np.stack([self.points, np.roll(self.points, -1, axis=0)], axis=1)


def screw_axes(robot: Robot) -> list[Axis]:
    """The screw axes of all joints, about the point ``s0`` that the table names."""
    half = AXIS * robot_size(robot)
    axes = []
    for joint in robot.tree:
        s, s0 = (as_array(part).astype(float) for part in (joint.screw.s, joint.screw.s0))
        link = robot.link_names.index(joint.child)
        axes.append(
            Axis(joint.name, link, np.stack([s0 - half * s, s0 + half * s]), joint.type == "prismatic")
        )
    return axes


def placed_frames(robot: Robot) -> list[PlacedFrame]:
    """The base, the tips of the limbs and the table's further frames."""
    names = ["base", *robot.tip_names, *(frame.name for frame in robot.frames)]
    places = ((name, *robot.frame(name)) for name in names)
    return [
        PlacedFrame(name, robot.link_names.index(link), as_array(home).astype(float))
        for name, link, home in places
    ]


def circuit_line(mechanism: Mechanism, circuit: str, Ts: Array, T_world_base: Array) -> Way:
    """The line of a circuit through its joints, and along its virtual chains from the floor and back.

    Args:
        mechanism: a robot's.
        circuit: one of ``mechanism.circuit_names``.
        Ts: (L, 4, 4), what carries every link from the zero pose into the world.
        T_world_base: (4, 4).
    """
    row = mechanism.circuits[mechanism.circuit_names.index(circuit)]
    points: list[Array] = []
    virtual: list[bool] = []
    for (name, chained), group in groupby(_in_turn(mechanism, row), lambda step: _carrier(step[0])):
        forward = next(group)[1]
        if chained:
            places = _chain(mechanism, name, Ts, T_world_base)[:: 1 if forward else -1]
        else:
            places = [_joint_place(mechanism.robot, name, Ts)]
        points += places
        virtual += [True] * (len(places) - 1) + [False]
    apart = [k for k, p in enumerate(points) if np.linalg.norm(p - points[(k + 1) % len(points)]) > _SAME]
    return Way(np.array([points[k] for k in apart]).reshape(-1, 3), tuple(virtual[k] for k in apart))


def _carrier(coupling: str) -> tuple[str, bool]:
    """The virtual chain of a coupling, or the coupling itself; and which of the two it is."""
    chain, dot, _ = coupling.partition(".")
    return chain, bool(dot)


def _in_turn(mechanism: Mechanism, row: Mapping[str, int]) -> list[tuple[str, bool]]:
    """The couplings of a circuit in the order in which one goes round; whether along their own direction."""
    (name, start, at), *left = (edge for edge in mechanism.graph.edges if edge[0] in row)
    turn = [(name, True)]
    while left and at != start:
        k = next(i for i, (_, a, b) in enumerate(left) if at in (a, b))
        name, a, b = left.pop(k)
        turn.append((name, a == at))
        at = b if a == at else a
    return turn


def _joint_place(robot: Robot, name: str, Ts: Array) -> Array:
    """The point s0 (3,) of a joint in the world."""
    joint = next(joint for joint in robot.tree if joint.name == name)
    T = Ts[robot.link_names.index(joint.child)]
    return np.asarray(T[:3, :3] @ as_array(joint.screw.s0).astype(float) + T[:3, 3])


def _chain(mechanism: Mechanism, name: str, Ts: Array, T_world_base: Array) -> list[Array]:
    """A virtual chain from the floor to its body: along its three sliding pairs where it begins with them."""
    robot = mechanism.robot
    chain = next(chain for chain in mechanism.chains if chain.name == name)
    end = T_world_base
    if chain.limb is not None:
        link, home = robot.frame(chain.limb.tip)
        end = Ts[robot.link_names.index(link)] @ as_array(home).astype(float)
    x, y, z = end[:3, 3]
    if chain.couplings[:3] != ("px", "py", "pz"):
        return [np.zeros(3), end[:3, 3]]
    return [np.array(p) for p in ((0.0, 0.0, 0.0), (x, 0.0, 0.0), (x, y, 0.0), (x, y, z))]
