"""How regular a mechanism is: the least singular value of every block of secondary couplings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Displacement, Screw, at
from screwkin.algebra.se3 import ZERO, Pose, Twist
from screwkin.algebra.singular_values import TRUSTED, least_singular_value
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import common_batch, run
from screwkin.kinematics.positions import joint_screws, link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.chains import chain_twists
from screwkin.mechanism.limb_motion import seen_screws
from screwkin.mechanism.mechanism import Mechanism, mechanism_of
from screwkin.mechanism.network import coupling_twists
from screwkin.mechanism.rates import block_rows, flat, network_of
from screwkin.mechanism.scaling import characteristic_length, referenced, weighed
from screwkin.mechanism.secondary import formula_blocks, tip_of
from screwkin.mechanism.virtual_chain import VirtualChain
from screwkin.model.robot import Robot


def least_values(mechanism: Mechanism, T_world_base: Array, q: Array) -> Array:
    """Least singular value of every block of secondary couplings, certified.

    Args:
        mechanism: the closed mechanism.
        T_world_base: (..., 4, 4).
        q: (..., n) [rad or m].

    Returns:
        (..., blocks), screws at the circuits' reference points, velocities divided by
        ``characteristic_length``: a number without unit.
    """
    batch = common_batch((T_world_base, q), (2, 1))
    T, q = flat(T_world_base, 2, batch), flat(q, 1, batch)
    least = np.empty((len(q), len(mechanism.blocks)))
    by_formula = _certifiable(mechanism)
    others = [k for k in range(len(mechanism.blocks)) if k not in by_formula]
    if by_formula:
        program = block_values(mechanism.robot, *mechanism.choice)
        result = run(program, {"T_world_base": T, "q": q})
        least[:, by_formula] = result["least"]
        uncertified = np.flatnonzero(~(result["error"] <= TRUSTED).all(axis=1))
        if len(uncertified):
            N = network_of(mechanism, T[uncertified], q[uncertified])
            least[uncertified[:, None], by_formula] = network_values(mechanism, N, by_formula)
    if others and len(q):
        least[:, others] = network_values(mechanism, network_of(mechanism, T, q), others)
    return least.reshape(*batch, least.shape[-1])


def network_values(mechanism: Mechanism, N: Array, blocks: Sequence[int] | None = None) -> Array:
    """The same of network matrices formed at the base origin.

    Args:
        mechanism: the closed mechanism.
        N: (..., 6 circuits, couplings).
        blocks: indices of blocks; default: all.
    """
    chosen = mechanism.blocks if blocks is None else [mechanism.blocks[k] for k in blocks]
    least, columns = np.empty((*N.shape[:-2], len(chosen))), mechanism.secondary_columns
    scaled = referenced(mechanism, N)
    for k, (circuits, own) in enumerate(chosen):
        A = scaled[..., block_rows(circuits), :][..., [columns[i] for i in own]]
        least[..., k] = np.linalg.svd(A, compute_uv=False)[..., -1]
    return least


def _certifiable(mechanism: Mechanism) -> list[int]:
    """Indices of the blocks that the program covers: of six couplings, with a tip for reference point."""
    return [k for k in formula_blocks(mechanism) if tip_of(mechanism, mechanism.blocks[k][0][0]) is not None]


@kept
def block_values(
    robot: Robot,
    primary: tuple[str, ...],
    secondary: tuple[str, ...],
    added: tuple[VirtualChain, ...] = (),
) -> Program:
    """Least singular value of each certifiable block and its error, as a program of ``T_world_base q``.

    Args:
        robot: the robot.
        primary: names of the primary couplings, as in ``Mechanism.primary``.
        secondary: names of the secondary couplings.
        added: further chains, as in ``Mechanism.added``.
    """
    mechanism = mechanism_of(robot, primary, secondary, added)
    recorder = Recorder(
        identifier(robot.name, "regular"),
        f"Least singular value of the secondary screws of every block of {robot.name}, velocities over the"
        " robot's size; error: bound of its relative error, the value is certified where it is small.",
    )
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    values: list[tuple[Scalar, Scalar]] = []
    for k in _certifiable(mechanism):
        (circuit,), own = mechanism.blocks[k]
        columns = [mechanism.secondary_columns[i] for i in own]
        signs = dict(zip(mechanism.edges, mechanism.circuit_matrix[circuit].tolist(), strict=True))
        names = [mechanism.couplings[c] for c in columns]
        twists = _at_reference(mechanism, circuit, names, T, q)
        length = characteristic_length(robot)
        values.append(least_singular_value([weighed(twists[name] * signs[name], length) for name in names]))
    recorder.output("least", [value for value, _ in values])
    recorder.output("error", [error for _, error in values])
    return recorder.program()


def _at_reference(
    mechanism: Mechanism, circuit: int, names: Sequence[str], T: Pose, q: Sequence[Scalar]
) -> dict[str, Twist]:
    """Screws of some couplings of a circuit at its reference point, in whatever axes they are simplest."""
    tip, robot = tip_of(mechanism, circuit), mechanism.robot
    assert tip is not None
    assert tip.limb is not None
    path = robot.path_to(tip.limb.link)
    if [robot.joint_names[i] for i in path] == list(names):
        # A common rotation changes no singular value; before the last joint most components are 0.
        chain = SerialChain.of(robot, tip.limb.name)
        screws = seen_screws(chain, None, [q[i] for i in path], len(path) - 1)
        return dict(zip(names, screws, strict=True))
    twists = dict(zip(mechanism.edges, coupling_twists(mechanism, T, q), strict=True))
    D = link_displacements(robot, q, Displacement(T.R, ZERO, ZERO))
    body, held = pose_in_base(robot, D, tip.name), mechanism.held(tip, Pose(T.R, ZERO))
    here = {name: at(body.p, twist) for name, twist in twists.items()}
    joints = zip(robot.tree, joint_screws(robot, D), strict=True)
    here |= {joint.name: Screw(s.s, s.s0 - body.p, s.pitch).twist for joint, s in joints}
    return here | dict(zip(tip.names, chain_twists(tip.couplings, body.R @ held.R.T, ZERO), strict=True))
