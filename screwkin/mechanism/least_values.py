"""Kernel of how regular a mechanism is: the least singular value of every block of secondary couplings."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, where
from screwkin.algebra.se3 import UNTURNED, Twist, pose_from_array, unstack
from screwkin.algebra.singular_values import TRUSTED, least_singular_value
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.mechanism.choice import characteristic_length
from screwkin.mechanism.davies import mechanism_of
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import coupling_twists, network_matrix
from screwkin.mechanism.rates import singular_values
from screwkin.model.robot import Robot

LARGEST = 6
"""Side of the largest block that a program takes on: longer formulas leave more in doubt."""


def least_values(mechanism: Mechanism, T_world_base: Array, q: Array) -> Array:
    """As ``mechanism.rates.singular_values`` of the network matrix, by a program where blocks are small.

    Args:
        mechanism: the closed mechanism.
        T_world_base: (B, 4, 4).
        q: (B, n) [rad or m].

    Returns:
        (B, blocks), velocities divided by ``characteristic_length``.
    """
    if not small(mechanism):
        return _by_lapack(mechanism, T_world_base, q)
    program = block_values(mechanism.robot, mechanism.primary, mechanism.secondary)
    found = run(program, {"T_world_base": T_world_base, "q": q})
    least, again = found["least"], np.flatnonzero((found["sure"] <= 0).any(axis=1))
    if len(again):
        T = np.broadcast_to(T_world_base, (len(q), 4, 4))[again]
        least[again] = _by_lapack(mechanism, T, q[again])
    return least


def _by_lapack(mechanism: Mechanism, T_world_base: Array, q: Array) -> Array:
    twists = coupling_twists(mechanism, pose_from_array(T_world_base).R, unstack(q))
    return singular_values(mechanism, network_matrix(mechanism, twists, (len(q),)))


@kept
def block_values(robot: Robot, primary: tuple[str, ...], secondary: tuple[str, ...]) -> Program:
    """Least singular value of every block of a mechanism, and whether it is sure.

    Args:
        robot: the robot.
        primary: names of the imposed couplings, as in ``Mechanism.primary``.
        secondary: names of those that follow.
    """
    mechanism = mechanism_of(robot, primary, secondary)
    recorder = Recorder(
        identifier(robot.name, "regular"),
        f"Least singular value of the screws of every block of {robot.name} that follows, velocities over"
        " the robot's size; sure: 1 if the formula is exact there.",
    )
    R, q = pose_input(recorder, "T_world_base").R, recorder.input("q", len(robot.joints))
    # A common rotation of a block changes nothing. Virtual couplings are not turned by the base.
    level, turned = (coupling_twists(mechanism, axes, q) for axes in (UNTURNED, R))
    real, length = set(robot.joint_names), characteristic_length(robot)
    found = []
    for circuits, own in mechanism.blocks:
        columns = [mechanism.secondary_columns[i] for i in own]
        twists = level if {mechanism.couplings[c] for c in columns} <= real else turned
        signs = mechanism.circuit_matrix[circuits]
        block = [
            [int(sign) * x for sign in signs[:, c] for x in _weighed(twists[c], length)] for c in columns
        ]
        found.append(least_singular_value(block))
    recorder.output("least", [value for value, _ in found])
    recorder.output("sure", [where(error <= TRUSTED, 1.0, 0.0) for _, error in found])
    return recorder.program()


def small(mechanism: Mechanism) -> bool:
    """True if all blocks are square and small: programs take them on."""
    return all(6 * len(circuits) == len(own) <= LARGEST for circuits, own in mechanism.blocks)


def _weighed(twist: Twist, length: float) -> list[Scalar]:
    return [*twist.omega, *(x / length for x in twist.v)]
