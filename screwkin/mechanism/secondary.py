"""Kernel of Davies' method: secondary rates from primary ones, block by block, by reciprocal screws.

Each block of N that joins one circuit is six equations. Where three of its screws meet in a point (a hip, an
ankle, the virtual rotations of a hand) or are parallel, they fall apart into two systems of three.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra import scalar
from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Displacement, at
from screwkin.algebra.se3 import (
    NO_TWIST,
    UNTURNED,
    ZERO,
    Rotation,
    Twist,
    Vector,
    dot,
    pose_from_array,
    unstack,
)
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.kinematics.positions import link_displacements
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism import rates
from screwkin.mechanism.choice import RANK_TOLERANCE, characteristic_length
from screwkin.mechanism.davies import mechanism_of
from screwkin.mechanism.least_values import small
from screwkin.mechanism.limb_rates import Split, pose_rates, split_of
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import coupling_twists, network_matrix
from screwkin.model.robot import Robot


def secondary_rates(
    mechanism: Mechanism, T_world_base: Array, q: Array, primary: Array
) -> tuple[Array, Array] | None:
    """As ``mechanism.rates.secondary_rates``, by a program; None if blocks are too large for one.

    Args:
        mechanism: the closed mechanism.
        T_world_base: (B, 4, 4).
        q: (B, n) [rad or m].
        primary: (B, primary) [rad/s or m/s].

    Returns:
        (B, secondary), samples in doubt by the network matrix; and which samples (B,) are singular.
    """
    if not small(mechanism):
        return None
    program = followers(mechanism.robot, mechanism.primary, mechanism.secondary)
    found = run(program, {"T_world_base": T_world_base, "q": q, "primary": primary})
    values, again = found["secondary"], np.flatnonzero(~(found["least"] > RANK_TOLERANCE).all(axis=-1))
    singular = np.zeros(len(values), dtype=bool)
    if len(again):
        twists = coupling_twists(mechanism, pose_from_array(T_world_base[again]).R, unstack(q[again]))
        N = network_matrix(mechanism, twists, (len(again),))
        solution = rates.secondary_rates(mechanism, N, primary[again])
        values[again], singular[again] = solution.values, solution.singular.any(axis=-1)
    return np.asarray(values), singular


@kept
def followers(robot: Robot, primary: tuple[str, ...], secondary: tuple[str, ...]) -> Program:
    """Rates of the secondary couplings, and a lower bound of every block's least singular value.

    Args:
        robot: the robot.
        primary: names of the imposed couplings, as in ``Mechanism.primary``.
        secondary: names of those that follow.

    Source: paper A, eq. 10-11.
    """
    mechanism = mechanism_of(robot, primary, secondary)
    recorder = Recorder(
        identifier(robot.name, "secondary"),
        f"Rates of the couplings of {robot.name} that follow, from those that are imposed; least: below it no"
        " singular value of a block's screws lies, velocities over the robot's size.",
    )
    R, q = pose_input(recorder, "T_world_base").R, recorder.input("q", len(robot.joints))
    imposed = dict(zip(primary, recorder.input("primary", len(primary)), strict=True))
    twists = _in_base_axes(mechanism, R, q)
    D = link_displacements(robot, q)
    found: dict[int, Scalar] = {}
    least = []
    for circuits, own in mechanism.blocks:
        signs = dict(zip(mechanism.couplings, mechanism.circuit_matrix[circuits[0]].tolist(), strict=True))
        wanted = NO_TWIST
        for name, rate in imposed.items():
            if signs[name]:
                wanted = wanted - twists[name] * rate * signs[name]
        names = [secondary[i] for i in own]
        columns = [twists[name] * signs[name] for name in names]
        values, bound = _solved(mechanism, D, names, columns, wanted)
        found.update(zip(own, values, strict=True))
        least.append(bound)
    recorder.output("secondary", [found[i] for i in range(len(secondary))])
    recorder.output("least", least)
    return recorder.program()


def _in_base_axes(mechanism: Mechanism, R: Rotation, q: Sequence[Scalar]) -> dict[str, Twist]:
    """Every coupling's screw, told at the base origin in the base's axes, where joints have most zeros."""
    real, back = set(mechanism.robot.joint_names), R.T
    level, turned = (coupling_twists(mechanism, axes, q) for axes in (UNTURNED, R))
    return {
        name: level[k] if name in real else Twist(back @ turned[k].omega, back @ turned[k].v)
        for k, name in enumerate(mechanism.couplings)
    }


def _solved(
    mechanism: Mechanism,
    D: Sequence[Displacement],
    names: Sequence[str],
    columns: Sequence[Twist],
    wanted: Twist,
) -> tuple[list[Scalar], Scalar]:
    """Rates of one block, and a lower bound of its least singular value.

    The determinant is the product of the singular values; all but the least have a product of at most that
    of a matrix whose Frobenius norm they share equally.
    """
    split, point = _split(mechanism, D, names)
    length = characteristic_length(mechanism.robot)
    there = [at(point, column) for column in columns]
    values, determinant = pose_rates(there, split, at(point, wanted), length)
    square = sum(dot(c.omega, c.omega) + dot(c.v, c.v) / length**2 for c in columns) / 5.0
    return values, scalar.sqrt(determinant * determinant / (square * square * square * square * square))


def _split(
    mechanism: Mechanism, D: Sequence[Displacement], names: Sequence[str]
) -> tuple[Split | None, Vector]:
    """Three neighbouring couplings that meet or are parallel, and where; base axes."""
    robot = mechanism.robot
    carried = dict(zip(robot.link_names, D, strict=True))
    for limb in robot.limbs:
        path = robot.path_to(limb.link)
        if [robot.joint_names[i] for i in path] == list(names):
            split = split_of(SerialChain.of(robot, limb.name))
            if split is not None:
                return split, carried[robot.joints[path[split.first]].parent] @ split.point
        turning = {f"{limb.tip}.{axis}" for axis in ("rx", "ry", "rz")}
        if turning == set(names[-3:]):
            tip = carried[limb.link] @ limb.frame.p
            return Split("meeting", len(names) - 3, tip), tip
    return None, ZERO
