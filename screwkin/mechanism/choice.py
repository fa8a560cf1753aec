"""The choice of primary (imposed) and secondary (computed) couplings: a default, and a check with advice.

A choice is sound at a posture when the secondary couplings are as many as the rank of N and independent.
Ranks are decided on columns whose velocities are divided by the robot's size, so that metres do not weigh.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, norm, rotation_log
from screwkin.compiler.program import kept
from screwkin.errors import InputError, SingularError, expect, one_of
from screwkin.kinematics.positions import closure_ends, link_displacements
from screwkin.mechanism.graph import CouplingGraph
from screwkin.mechanism.mechanism import WAIST, Mechanism, unchosen
from screwkin.mechanism.network import coupling_twists, network_of_twists
from screwkin.mechanism.scaling import characteristic_length, referenced
from screwkin.mechanism.virtual_chain import VirtualChain
from screwkin.model.robot import Robot
from screwkin.model.state import reference_base, reference_posture

RANK_TOLERANCE = 1e-6
"""Smallest singular value, relative to the largest, of length-normalised screws still independent."""
CLOSED = 1e-7
"""Largest gap of a closure, in sizes of the robot and in rad, at which ranks are decided."""


def rank(N: Array) -> Any:
    """Numerical rank (...,) of length-normalised matrices (..., rows, columns)."""
    if min(N.shape[-2:]) == 0:
        return np.zeros(N.shape[:-2], dtype=int)
    values = np.linalg.svd(N, compute_uv=False)
    return (values > RANK_TOLERANCE * np.maximum(values[..., :1], 1.0)).sum(axis=-1)


def independent(N: Array, order: Sequence[int]) -> list[int]:
    """Columns, taken greedily in the given order, each of which adds a direction to those before."""
    basis: list[Array] = []
    chosen = []
    for column in order:
        v: Array = N[:, column]
        rest = v
        for _ in range(2):
            for b in basis:
                rest = rest - b * (b @ rest)
        if np.linalg.norm(rest) > RANK_TOLERANCE * 10 * max(float(np.linalg.norm(v)), 1e-12):
            basis.append(rest / np.linalg.norm(rest))
            chosen.append(column)
    return chosen


def preference(mechanism: Mechanism) -> list[int]:
    """Columns in the order in which they would rather be secondary.

    Further chains before all others: they measure, and only who names them primary imposes them. With
    virtual chains: joints of one limb, then the rotations of tips, of each chain the last first, then joints
    that limbs share, then the translations of tips, the waist last; a joint that no circuit needs never
    follows. Without: the last joint of the table first, so that the first ones drive.
    """
    real = [mechanism.position[name] for name in mechanism.robot.joint_names]
    measuring = [mechanism.position[name] for chain in mechanism.added for name in chain.names]
    if not mechanism.chains:
        return measuring + real[::-1]
    robot = mechanism.robot
    users = Counter(i for limb in robot.limbs for i in robot.leading(limb.link))
    shared = [column for i, column in enumerate(real) if users[i] > 1]
    own = [column for column in real if column not in shared]
    tips = [chain for chain in mechanism.chains if chain.limb]
    waist = [name for chain in mechanism.chains if not chain.limb for name in chain.names]
    turning = [n for chain in tips for n in reversed(chain.names) if n.split(".")[1][0] == "r"]
    moving = [n for chain in tips for n in chain.names if n.split(".")[1][0] == "p"]
    rotations, others = ([mechanism.position[n] for n in names] for names in (turning, (*moving, *waist)))
    return measuring + own + rotations + shared + others


def closed_mechanism(
    robot: Robot, primary: Sequence[str] | None = None, chains: Sequence[VirtualChain] = ()
) -> Mechanism:
    """The robot as one closed mechanism, its choice of primary couplings checked at the home posture.

    Args:
        robot: a humanoid (virtual chains to the waist and the tips) or any table with closures.
        primary: names of the couplings to impose; default: the virtual chains impose, real joints follow,
            and where a limb has fewer than six joints the rotations of its tip's chain follow too.
        chains: further virtual chains, from any link to any other; they measure unless their couplings are
            primary. The mechanism is examined at the home posture, where those of fewer than six pairs must
            reach their ends.

    Returns:
        Mechanism with ``couplings links circuits mobility primary secondary``.

    Raises:
        UnknownNameError: a primary name is no coupling, or an end of a chain no frame of the robot.
        InputError: a name twice; too few or too many primary couplings, with the ones to move; or a closure
            or a chain that is open at the home posture, where ranks would mean nothing.
        SingularError: the right number, but dependent; says which to exchange.

    Example:
        >>> import screwkin as sk
        >>> mechanism = sk.closed_mechanism(sk.load_robot(sk.robot_names()[0]))
        >>> len(mechanism.couplings), mechanism.mobility
        (48, 24)

    Source: Davies (1981); paper A, eq. 9-11, 15.
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    named = primary if primary is None or isinstance(primary, str) else tuple(primary)
    added = (chains,) if isinstance(chains, VirtualChain) else tuple(chains)
    for chain in added:
        expect(chain, VirtualChain, "chains", "a list of VirtualChain(name, couplings, end, start)")
    return Mechanism(robot, *_checked(robot, named, added))


def mechanism_imposing(robot: Robot, names: Sequence[str], chains: Sequence[VirtualChain] = ()) -> Mechanism:
    """The closed mechanism of the default choice, but that couplings of these names are primary.

    For every one of them that measures or follows by default another coupling follows instead, the one that
    would rather than any other.

    Args:
        robot: as for ``closed_mechanism``.
        names: of couplings to impose.
        chains: further virtual chains.

    Raises:
        UnknownNameError: no such coupling. SingularError: they depend on one another. Else as
            ``closed_mechanism``.
    """
    mechanism = closed_mechanism(robot, chains=chains)
    wanted = [mechanism.position[one_of("coupling", name, mechanism.couplings)] for name in names]
    if {*names} <= {*mechanism.primary}:
        return mechanism
    q, T = reference_posture(robot), reference_base(robot)
    N = referenced(mechanism, network_of_twists(mechanism, coupling_twists(mechanism, T, q)))
    order = [column for column in preference(mechanism) if column not in wanted]
    following = independent(N, [*order, *wanted])
    if tied := [mechanism.couplings[column] for column in wanted if column in following]:
        raise SingularError(
            f"{', '.join(names)} cannot all be imposed: {', '.join(tied)} follows from others; leave it out"
        )
    primary = [name for column, name in enumerate(mechanism.couplings) if column not in following]
    return closed_mechanism(robot, primary, chains)


Parts = tuple[
    tuple[VirtualChain, ...],
    CouplingGraph,
    tuple[str, ...],
    tuple[str, ...],
    int,
    tuple[VirtualChain, ...],
]


@kept
def _checked(robot: Robot, primary: Sequence[str] | None, added: tuple[VirtualChain, ...]) -> Parts:
    """The parts of ``closed_mechanism`` besides the robot."""
    _check_names(robot, added)
    bare, q, T = unchosen(robot, added), reference_posture(robot), reference_base(robot)
    check_closed(bare, T, q)
    N = referenced(bare, network_of_twists(bare, coupling_twists(bare, T, q)))
    mobility = len(bare.couplings) - int(rank(N))
    if primary is None:
        columns = set(independent(N, preference(bare)))
        primary = tuple(name for i, name in enumerate(bare.couplings) if i not in columns)
    wanted = _wanted(bare, primary)
    chosen = replace(
        bare,
        primary=tuple(name for name in bare.couplings if name in wanted),
        secondary=tuple(name for name in bare.couplings if name not in wanted),
        mobility=mobility,
    )
    _check(chosen, N)
    return bare.chains, bare.graph, chosen.primary, chosen.secondary, mobility, added


def _wanted(bare: Mechanism, primary: Sequence[str]) -> set[str]:
    """The names, each of a coupling and given once."""
    if isinstance(primary, str):
        raise InputError(f"primary is the text {primary!r}; give a list of couplings, as [{primary!r}]")
    wanted: set[str] = set()
    for name in primary:
        if one_of("coupling", name, bare.couplings) in wanted:
            raise InputError(f"primary names {name} twice; give every coupling once")
        wanted.add(name)
    return wanted


def _check_names(robot: Robot, added: Sequence[VirtualChain]) -> None:
    """Every further chain has a name of its own."""
    taken = {WAIST, *robot.tip_names}
    for chain in added:
        if chain.name in taken:
            raise InputError(f"chain {chain.name}: another chain has this name; give every chain its own")
        taken.add(chain.name)


def check_closed(mechanism: Mechanism, T: Pose, q: Sequence[float]) -> None:
    """The two ends of every closure and further chain coincide, to ``CLOSED`` times the size and in rad."""
    robot = mechanism.robot
    carried = dict(zip(robot.link_names, link_displacements(robot, list(q)), strict=True))
    length = characteristic_length(robot)
    where = "at the posture where the mechanism is examined"
    for closure in robot.closures:
        if gap := _gap(*closure_ends(closure, carried, T), length):
            raise InputError(
                f"{robot.name}: closure {closure.name} is open by {gap} {where}; give a posture home that "
                "closes it, by formulas or to nine digits (mechanism.closure.nearest_closed finds one)"
            )
    for chain in mechanism.added:
        start, end = chain.ends(robot, T, carried)
        if gap := _gap(end, chain.reached(start, chain.coordinates(start, end)), length):
            raise InputError(
                f"{robot.name}: chain {chain.name} of {', '.join(chain.couplings)} misses its end by {gap} "
                f"{where}; place its frames so that it reaches, or take six pairs and impose the others"
            )


def _gap(a: Pose, b: Pose, length: float) -> str:
    """How far two poses are apart, in words; nothing where they coincide."""
    gap, turn = float(norm(b.p - a.p)), float(norm(rotation_log(b.R @ a.R.T)))
    apart = gap > CLOSED * length or turn > CLOSED
    return f"{1e3 * gap:.3g} mm and {np.degrees(turn):.3g} deg" if apart else ""


def _check(mechanism: Mechanism, N: Array) -> None:
    names, needed = mechanism.couplings, len(mechanism.couplings) - mechanism.mobility
    basis = independent(N, mechanism.secondary_columns)
    surplus = [names[i] for i in mechanism.secondary_columns if i not in basis]
    completed = independent(N, [*basis, *preference(mechanism)])
    missing = [names[i] for i in completed if i not in basis]
    have = len(mechanism.secondary)
    if have > needed:
        raise InputError(
            f"{have} secondary couplings but N has rank {needed}: {have - needed} too many; "
            f"make primary: {', '.join(surplus[: have - needed])}"
            + (
                f"; and make secondary instead of {', '.join(surplus[have - needed :])}: {', '.join(missing)}"
                if missing
                else ""
            )
        )
    if have < needed:
        raise InputError(
            f"{have} secondary couplings but N has rank {needed}: {needed - have} too few, the circuits "
            f"could not close; make secondary: {', '.join(missing[: needed - have])}"
        )
    if surplus:
        raise SingularError(
            f"the secondary couplings are dependent (rank {len(basis)} of {needed}): make primary "
            f"{', '.join(surplus)}, whose motion the other secondary couplings already contain, and make "
            f"secondary {', '.join(missing)}, which nothing else can follow"
        )


def mobility_at(mechanism: Mechanism, N: Array) -> Any:
    """Mobility (...,) at given states: couplings less the rank of N (..., 6 circuits, couplings)."""
    return len(mechanism.couplings) - rank(referenced(mechanism, N))
