"""Davies' method as a program: secondary rates from primary ones, block by block, by reciprocal screws.

A block that joins one circuit by six couplings is six equations. Where three of its screws meet in a point (a
hip, an ankle, the virtual rotations of a hand) or are parallel, they fall apart into two systems of three.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwkin.algebra.scalar import Scalar, abs_, sqrt
from screwkin.algebra.screws import Displacement, at, turn
from screwkin.algebra.se3 import IDENTITY, NO_TWIST, UNTURNED, ZERO, Pose, Rotation, Twist, Vector, cross, dot
from screwkin.compiler.program import Recorder, kept
from screwkin.compiler.records import identifier, pose_input
from screwkin.kinematics.arrays import Argument
from screwkin.kinematics.door import Door
from screwkin.kinematics.kinds import STATE
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.chains import chain_twists
from screwkin.mechanism.limb_motion import LimbMotion
from screwkin.mechanism.limb_rates import Split, pose_rates
from screwkin.mechanism.mechanism import Mechanism, mechanism_of
from screwkin.mechanism.network import coupling_screws, coupling_twists
from screwkin.mechanism.scaling import characteristic_length, reference_couplings
from screwkin.mechanism.virtual_chain import VirtualChain
from screwkin.model.robot import Robot


def formula_blocks(mechanism: Mechanism) -> list[int]:
    """Indices of the blocks that have a formula: one circuit, six secondary couplings, no coupled joints."""
    coupled = np.any(mechanism.circuit_matrix[:, len(mechanism.couplings) :], axis=1).tolist()
    return [
        k
        for k, (circuits, own) in enumerate(mechanism.blocks)
        if len(circuits) == 1 and len(own) == 6 and not coupled[circuits[0]]
    ]


@kept
def secondary_door(
    robot: Robot,
    primary: tuple[str, ...],
    secondary: tuple[str, ...],
    added: tuple[VirtualChain, ...] = (),
) -> Door:
    """Rates of the secondary couplings of all ``formula_blocks``, and a bound of their singular values.

    Args:
        robot: the robot.
        primary: names of the primary couplings, as in ``Mechanism.primary``.
        secondary: names of the secondary couplings.
        added: further chains, as in ``Mechanism.added``.

    Returns:
        Calls of ``T_world_base q primary``; ``secondary``: all rates, 0 of couplings in other blocks;
        ``least``: no singular value of a block at its reference point, normalised, is smaller.

    Source: paper A, eq. 10-11.
    """
    mechanism = mechanism_of(robot, primary, secondary, added)
    recorder = Recorder(
        identifier(robot.name, "secondary"),
        f"Rates of the secondary couplings of {robot.name} from those of the primary ones; least: a lower"
        " bound of the singular values of each block's screws, velocities over the robot's size.",
    )
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    R = T.R
    imposed = dict(zip(primary, recorder.input("primary", len(primary)), strict=True))
    twists = _in_base_axes(mechanism, T, q)
    D = link_displacements(robot, q)
    bodies = _by_bodies(mechanism, R, D)
    rates: list[Scalar] = [0.0] * len(secondary)
    least = []
    for k in formula_blocks(mechanism):
        (circuit,), own = mechanism.blocks[k]
        signs = dict(zip(mechanism.edges, mechanism.circuit_matrix[circuit].tolist(), strict=True))
        wanted = NO_TWIST
        for name in (*robot.joint_names, *(name for chain in added for name in chain.names)):
            if name in imposed:
                wanted = wanted - twists[name] * imposed[name] * signs[name]
        for place, screws in bodies:
            motion = NO_TWIST
            for name, screw in screws.items():
                if name in imposed:
                    motion = motion + screw * imposed[name] * signs[name]
            wanted = wanted - at(-place, turn(R.T, motion))
        names = [secondary[i] for i in own]
        split, point, axes, columns = _system(mechanism, D, q, names, twists)
        here = turn(axes.T, at(point, wanted))
        values, determinant = pose_rates(columns, split, here, characteristic_length(robot))
        for i, name, value in zip(own, names, values, strict=True):
            rates[i] = value * signs[name]
        least.append(_bound(mechanism, circuit, names, twists, point, D, determinant))
    recorder.output("secondary", rates)
    recorder.output("least", least)
    return Door(recorder, secondary_arguments(robot, primary))


def secondary_arguments(robot: Robot, primary: Sequence[str]) -> list[Argument]:
    """State and primary rates, as messages name them."""
    state = coupling_screws.definition.arguments(robot, STATE).values()
    return [*(a for own in state for a in own), Argument("primary", "primary_rates", (len(primary),))]


def _in_base_axes(mechanism: Mechanism, T: Pose, q: Sequence[Scalar]) -> dict[str, Twist]:
    """Every coupling's screw at the base origin, base axes, where joints have most zeros."""
    real, back = set(mechanism.robot.joint_names), T.R.T
    level, turned = (coupling_twists(mechanism, pose, q) for pose in (IDENTITY, T))
    return {
        name: level[k] if name in real else turn(back, turned[k])
        for k, name in enumerate(mechanism.couplings)
    }


def _by_bodies(
    mechanism: Mechanism, R: Rotation, D: Sequence[Displacement]
) -> list[tuple[Vector, dict[str, Twist]]]:
    """Of every virtual chain its body's place, base axes, and its couplings' screws there, world axes.

    What a chain imposes is added up at its body, turned and taken to the base origin once.
    """
    bodies, turned = [], Pose(R, ZERO)
    for chain in mechanism.chains:
        body = IDENTITY if chain.limb is None else pose_in_base(mechanism.robot, D, chain.limb.tip)
        turning = R @ body.R @ mechanism.held(chain, turned).R.T
        bodies.append(
            (body.p, dict(zip(chain.names, chain_twists(chain.couplings, turning, ZERO), strict=True)))
        )
    return bodies


def _bound(
    mechanism: Mechanism,
    circuit: int,
    names: Sequence[str],
    twists: Mapping[str, Twist],
    near: Vector,
    D: Sequence[Displacement],
    determinant: Scalar,
) -> Scalar:
    """Lower bound of a block's least singular value, from its determinant, which no reference point changes.

    The determinant is the product of the singular values; all but the least have a product of at most that
    of a matrix whose Frobenius norm they share equally.
    """
    length = characteristic_length(mechanism.robot)
    tip = tip_of(mechanism, circuit)
    sizes = {} if tip is None else _sizes(mechanism.robot, tip, length)
    if all(name in sizes for name in names):
        return abs_(determinant) / (sum(sizes[name] for name in names) / 5) ** 2.5
    if tip is not None:
        point, counted = pose_in_base(mechanism.robot, D, tip.name).p, [twists[name] for name in names]
    else:  # at the point nearest to all axes of the circuit their sum is not larger than at any other
        point, counted = near, [twists[name] for name in mechanism.circuits[circuit]]
    there = [at(point, twist) for twist in counted]
    mean = sum(dot(t.omega, t.omega) + dot(t.v, t.v) / length**2 for t in there) / 5
    return abs_(determinant) / (mean * mean * sqrt(mean))


def tip_of(mechanism: Mechanism, circuit: int) -> VirtualChain | None:
    """The virtual chain whose tip is the reference point of a circuit; None if it is another point."""
    row = mechanism.involved[circuit].tolist()
    reference = {mechanism.couplings[c] for c in reference_couplings(mechanism, row)}
    for chain in mechanism.chains:
        turning = {name for name in chain.names if name.split(".")[1][0] == "r"}
        if chain.limb is not None and len(turning) > 1 and reference == turning:
            return chain
    return None


def _sizes(robot: Robot, tip: VirtualChain, length: float) -> dict[str, float]:
    """Bounds of the squared norms of screws at a limb's tip: revolute joints, and the tip's own chain."""
    assert tip.limb is not None
    joints = [robot.joints[i] for i in robot.path_to(tip.limb.link)]
    own = {name: 1.0 if name.split(".")[1][0] == "r" else 1 / length**2 for name in tip.names}
    if any(joint.type != "revolute" or joint.screw.is_translation for joint in joints):
        return own
    reach = SerialChain.of(robot, tip.limb.name).levers
    return own | {j.name: 1 + (r / length) ** 2 for j, r in zip(joints, reach, strict=True)}


def _system(
    mechanism: Mechanism,
    D: Sequence[Displacement],
    q: Sequence[Scalar],
    names: Sequence[str],
    twists: Mapping[str, Twist],
) -> tuple[Split | None, Vector, Rotation, Sequence[Twist]]:
    """The screws of a block: how they fall apart, their point and axes, and they themselves.

    Those of all joints of a limb are seen from a link amid the limb, as ``LimbMotion`` does. Where no
    couplings meet, the point is one near the mechanism, at least on the axis of the first coupling.
    """
    robot, first = mechanism.robot, twists[names[0]]
    split, point = None, cross(first.omega, first.v)
    for limb in robot.limbs:
        path = robot.path_to(limb.link)
        if [robot.tree[i].name for i in path] == list(names):
            motion = LimbMotion.of(robot, limb, D, q, len(path) // 2)
            return motion.split, motion.point, motion.axes, motion.twists
        if {f"{limb.tip}.{axis}" for axis in ("rx", "ry", "rz")} == set(names[-3:]):
            point = pose_in_base(robot, D, limb.tip).p
            split = Split("meeting", len(names) - 3, point)
            break
    return split, point, UNTURNED, [at(point, twists[name]) for name in names]
