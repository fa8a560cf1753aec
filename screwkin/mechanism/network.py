"""Davies' network matrix: the circuits' screws, formed at a point that travels with the robot.

Source: paper A, eq. 8-11 and 15. The circulation law N q' = 0 holds at any point; far from the robot
the matrix loses digits (condition 1e2 at the waist, 2.5e5 at 50 m), so screws are taken at the waist origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Integers
from screwkin.algebra.scalar import Scalar, is_jax, structural
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import NO_TWIST, ZERO, Pose, Twist, Vector, as_array, bracket
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Columns, Joints
from screwkin.kinematics.positions import joint_twists, link_displacements, pose_in_base
from screwkin.mechanism.chains import chain_twists
from screwkin.mechanism.mechanism import Mechanism


def coupling_twists(
    mechanism: Mechanism,
    T: Pose,
    q: Sequence[Scalar],
    point: Vector = ZERO,
    coordinates: Sequence[Scalar] | None = None,
) -> list[Twist]:
    """Normalised screw of every edge of the mechanism, world axes: the couplings', then the coupled joints'.

    Args:
        mechanism: the closed mechanism.
        T: pose of the base. Where it stands enters into chains only that turn about a place of the floor: of
            others, virtual translations have no place, virtual rotations pass through their body.
        q: joint positions in table order.
        point: where the screws are taken, from the base origin, world axes [m].
        coordinates: of all couplings, where further chains do not reach their ends [m, rad].
    """
    robot = mechanism.robot
    D = link_displacements(robot, q)
    turned = Pose(T.R, ZERO)
    twists = {joint.name: t for joint, t in zip(robot.tree, joint_twists(robot, D, turned), strict=True)}
    for chain in mechanism.chains:
        body = turned if chain.limb is None else turned @ pose_in_base(robot, D, chain.limb.tip)
        R_chain = body.R @ mechanism.held(chain, turned).R.T
        twists |= zip(chain.names, chain_twists(chain.couplings, R_chain, body.p), strict=True)
    carried = dict(zip(robot.link_names, D, strict=True))
    for chain in mechanism.added:
        start, end = chain.ends(robot, T, carried)
        if coordinates is None:
            values = chain.coordinates(start, end)
        else:
            values = [coordinates[mechanism.position[name]] for name in chain.names]
            end = chain.reached(start, values)
        twists |= zip(chain.names, chain.twists(start, end, values), strict=True)
    return [at(point, twists[name]) for name in mechanism.edges]


@formula
def coupling_screws(mechanism: Mechanism, T_world_base: Pose, q: Joints) -> Columns:
    """Normalised screws of all couplings of the closed mechanism, world axes, and of its coupled joints.

    Args:
        mechanism: from ``closed_mechanism``.
        state:

    Returns:
        S (..., 6, edges), columns [omega; v at the base origin] in the order of ``mechanism.edges``.
    """
    return coupling_twists(mechanism, T_world_base, q)


def network_blocks(mechanism: Mechanism, twists: Sequence[Twist]) -> list[list[Twist]]:
    """The network matrix as rows of signed screws: one row of blocks for every circuit."""
    signed = {1: lambda t: t, -1: lambda t: -t, 0: lambda t: NO_TWIST}
    count, rows = len(mechanism.couplings), []
    for signs in mechanism.circuit_matrix:
        every = [signed[int(sign)](twist) for sign, twist in zip(signs, twists, strict=True)]
        for joint, twist in zip(mechanism.robot.coupled, every[count:], strict=True):
            column = mechanism.position[joint.leader]
            every[column] = every[column] + twist * structural(joint.ratio)
        rows.append(every[:count])
    return rows


def network_of_twists(
    mechanism: Mechanism,
    twists: Sequence[Twist],
    batch: tuple[int, ...] = (),
    circuits: Integers | None = None,
) -> Any:
    """N (..., 6 circuits, couplings) from the edges' screws: rows [omega; v] of every circuit.

    ``circuits`` (k, edges) is another choice of circuits than the mechanism's own.
    """
    return assembled(mechanism, as_array(list(twists), batch).swapaxes(-1, -2), circuits)


def assembled(mechanism: Mechanism, S: Any, circuits: Integers | None = None) -> Any:
    """The same from the edges' screws as columns S (..., 6, edges)."""
    B = (mechanism.circuit_matrix if circuits is None else circuits).astype(float)
    signs = B.reshape(*(1 for _ in S.shape[:-2]), len(B), 1, B.shape[1])
    N = signs * S[..., None, :, :]
    N = N.reshape(*S.shape[:-2], 6 * len(B), B.shape[1])
    return N @ mechanism.gears if mechanism.robot.coupled else N


def twist_rates(mechanism: Mechanism, twists: Sequence[Twist], rates: Sequence[Scalar]) -> list[Twist]:
    """Time derivative of every edge's screw when all edges move at some rates, at the fixed point.

    The link on which a screw stands carries it: the derivative is the bracket of that link's twist with it.
    """
    moving: dict[str, Twist] = {mechanism.links[0]: NO_TWIST}
    derivative: dict[int, Twist] = {}
    edges = mechanism.graph.edges
    while len(derivative) < len(edges):
        for i, (_, tail, head) in enumerate(edges):
            if i not in derivative and tail in moving:
                derivative[i] = bracket(moving[tail], twists[i])
                moving.setdefault(head, moving[tail] + twists[i] * rates[i])
    return [derivative[i] for i in range(len(edges))]


def blend(columns: Sequence[int], values: Any, others: Sequence[int], rest: Any) -> Any:
    """Values of all couplings (..., couplings) from those of two complementary sets of columns."""
    order = np.argsort(np.array([*columns, *others]))
    if is_jax(values) or is_jax(rest):
        import jax.numpy as jnp

        return jnp.concatenate([values, rest], axis=-1)[..., order]
    return np.concatenate([values, rest], axis=-1)[..., order]
