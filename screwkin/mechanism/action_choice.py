"""Primary (imposed) and secondary (computed) actions: ranks, degrees of constraint, and a check with advice.

The dual of ``choice``: secondary actions are as many as the rank of A and independent; what is left over is
either imposed by the user (an effort, a squeeze) or redundant: rigid bodies leave it undecided.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.compiler.program import kept
from screwkin.errors import InputError, SingularError, one_of
from screwkin.mechanism.actions import (
    ActionSystem,
    Names,
    action_system,
    assembled_actions,
    unit_actions,
)
from screwkin.mechanism.choice import independent, rank
from screwkin.mechanism.mechanism import Mechanism, unchosen
from screwkin.mechanism.network import coupling_screws
from screwkin.mechanism.scaling import centre, characteristic_length
from screwkin.mechanism.screw_text import wrench_screw
from screwkin.model.robot import Robot
from screwkin.model.state import State, reference_posture


@dataclass(frozen=True, eq=False)
class ActionChoice:
    """What a mechanism's action matrix says at its reference posture.

    Attributes:
        system: the actions.
        primary: names of the actions that are imposed.
        secondary: names of those that follow.
        rank: of the action matrix.
        redundant: constraints that others contain already, the last ones of the table first to go: without
            them the mechanism has the same mobility, and its loops close with any dimensions.
        meaning: of every redundant constraint, in words: its screw in base axes at that posture.
    """

    system: ActionSystem
    primary: Names
    secondary: Names
    rank: int
    redundant: Names
    meaning: Names

    @property
    def degree(self) -> int:
        """Actions less the rank: how many may, and must, be imposed."""
        return len(self.system.names) - self.rank


def action_choice(
    mechanism: Mechanism,
    primary: Sequence[str] | None = None,
    active: Sequence[str] | None = None,
    contacts: Sequence[str] | None = None,
) -> ActionChoice:
    """The choice of primary actions, checked at the mechanism's reference posture.

    Args:
        mechanism: from ``closed_mechanism``.
        primary: names of the actions to impose; default: what is left over when constraints, then efforts,
            then contacts follow.
        active: names of the joints with an effort, as for ``action_matrix``; those in ``primary`` are added.
        contacts: as for ``action_matrix``.

    Raises:
        UnknownNameError: no such action.
        InputError: too many or too few primary actions, with those to move.
        SingularError: the right number, but the secondary ones are dependent; says which to exchange.
    """
    if isinstance(primary, str):
        raise InputError(f"primary is the text {primary!r}; give a list of actions, as [{primary!r}]")
    system = with_efforts(mechanism, primary or (), active, contacts)
    follow, count, redundant, meaning = _examined(mechanism.robot, system.active, system.contacts)
    wanted = imposed_names(system, [n for i, n in enumerate(system.names) if i not in follow])
    if primary is not None:
        wanted = imposed_names(system, primary)
    rest = tuple(name for name in system.names if name not in wanted)
    chosen = ActionChoice(system, wanted, rest, count, redundant, meaning)
    if primary is not None:
        _check(chosen, _at_reference(unchosen(mechanism.robot), system), wanted)
    return chosen


def with_efforts(
    mechanism: Mechanism,
    imposed: Sequence[str],
    active: Sequence[str] | None = None,
    contacts: Sequence[str] | None = None,
) -> ActionSystem:
    """The system in which couplings whose effort is imposed are active too."""
    system = action_system(mechanism, active, contacts)
    joints = mechanism.robot.joint_names
    more = [name for name in joints if name in imposed and name not in system.active]
    return action_system(mechanism, [*system.active, *more], system.contacts) if more else system


def imposed_names(system: ActionSystem, names: Sequence[str]) -> Names:
    """Names of actions, each known and given once, in the order of the columns."""
    wanted = [one_of("action", name, system.names) for name in names]
    twice = [name for name in wanted if wanted.count(name) > 1]
    if twice:
        raise InputError(f"primary names {twice[0]} twice; give every action once")
    return tuple(name for name in system.names if name in wanted)


def are_moments(mechanism: Mechanism, system: ActionSystem) -> Array:
    """(actions,) bool: which magnitudes are moments, the others being forces."""
    sliding = {joint.name for joint in mechanism.robot.tree if joint.screw.is_translation}
    flags = []
    for a, name in enumerate(system.names):
        coupling = system.edges[system.edge_of(a)]
        flags.append(coupling not in sliding if name == coupling else name.rpartition(".")[2][0] == "m")
    return np.array(flags, dtype=bool)


def unit_wrenches(mechanism: Mechanism, system: ActionSystem, state: State) -> Array:
    """W (..., 6, terms) of a system, world axes, moments about the base origin."""
    return unit_actions(mechanism, state, system.active, system.contacts)


def weighed_actions(mechanism: Mechanism, system: ActionSystem, state: State, W: Any) -> tuple[Any, Any, Any]:
    """The action matrix without units: (A, unit of every action, reference point from the base origin).

    Moments are taken at the point nearest to all axes and divided by ``characteristic_length``.
    """
    xp, length = numpy_of(W), characteristic_length(mechanism.robot)
    S = coupling_screws(mechanism, state)
    point = centre(S[..., [mechanism.position[joint.name] for joint in mechanism.robot.tree]])
    m = W[..., :3, :] - xp.cross(point[..., None], W[..., 3:, :], axis=-2)
    unit = np.where(are_moments(mechanism, system), length, 1.0)
    A = assembled_actions(system, xp.concatenate([m / length, W[..., 3:, :]], axis=-2)) * unit
    return A, unit, point


def _at_reference(mechanism: Mechanism, system: ActionSystem) -> Array:
    state = State(np.eye(4), np.array(reference_posture(mechanism.robot), dtype=float))
    A: Array = weighed_actions(mechanism, system, state, unit_wrenches(mechanism, system, state))[0]
    return A


def following_order(system: ActionSystem) -> list[int]:
    """Columns in the order in which they would rather be secondary: constraints, efforts, then contacts."""
    kind = []
    for a, name in enumerate(system.names):
        edge = system.edge_of(a)
        kind.append(2 if edge >= len(system.joints) else int(name == system.edges[edge]))
    return sorted(range(len(kind)), key=kind.__getitem__)


Examined = tuple[frozenset[int], int, Names, Names]


@kept
def _examined(robot: Robot, active: Names, contacts: Names) -> Examined:
    """Columns that follow by default, the rank of A, and the redundant constraints with their meaning."""
    mechanism = unchosen(robot)
    system = action_system(mechanism, active, contacts)
    A, order = _at_reference(mechanism, system), following_order(system)
    follow = independent(A, order)
    count = int(rank(A))
    passive = [a for a in order if system.names[a] != system.edges[system.edge_of(a)]]
    redundant = [a for a in passive if a not in follow]
    redundant = [a for a in redundant if system.edge_of(a) < len(system.joints)]
    names = tuple(system.names[a] for a in redundant)
    return frozenset(follow), count, names, tuple(_meanings(mechanism, system, redundant))


def _meanings(mechanism: Mechanism, system: ActionSystem, actions: Sequence[int]) -> list[str]:
    """Screws of some actions at the reference posture, in base axes, in words."""
    if not actions:
        return []
    state = State(np.eye(4), np.array(reference_posture(mechanism.robot), dtype=float))
    W = unit_wrenches(mechanism, system, state)
    term = {a: t for t, (a, _, _) in reversed(list(enumerate(system.terms)))}
    size = characteristic_length(mechanism.robot)
    return [wrench_screw(W[:, term[a]], np.zeros(3), size).text for a in actions]


def _check(chosen: ActionChoice, A: Array, wanted: Names) -> None:
    """The actions that are not imposed are as many as the rank and independent."""
    system, needed = chosen.system, chosen.rank
    names, order = system.names, following_order(system)
    rest = [a for a in order if names[a] not in wanted]
    basis = independent(A, rest)
    surplus = [names[a] for a in rest if a not in basis]
    missing = [names[a] for a in independent(A, [*basis, *order]) if a not in basis]
    if len(rest) > needed:
        raise InputError(
            f"{len(rest)} secondary actions but A has rank {needed}: {len(rest) - needed} too many; "
            f"make primary: {', '.join(surplus[: len(rest) - needed])}"
            + (f"; and make secondary instead: {', '.join(missing)}" if missing else "")
        )
    if len(rest) < needed:
        raise InputError(
            f"{len(rest)} secondary actions but A has rank {needed}: {needed - len(rest)} too few, the links "
            f"could not be in equilibrium; make secondary: {', '.join(missing[: needed - len(rest)])}"
        )
    if surplus:
        raise SingularError(
            f"the secondary actions are dependent (rank {len(basis)} of {needed}): make primary "
            f"{', '.join(surplus)}, which the others contain already, and make secondary "
            f"{', '.join(missing)}, which nothing else can replace"
        )


def check_imposed(mechanism: Mechanism, system: ActionSystem, names: Names) -> None:
    """Refuse imposed actions that equilibrium decides already, at the mechanism's reference posture.

    Raises:
        InputError: names those to leave out.
    """
    if not names:
        return
    bare = unchosen(mechanism.robot)
    A, order = _at_reference(bare, system), following_order(system)
    rest = [a for a in order if system.names[a] not in names]
    basis = independent(A, rest)
    missing = [system.names[a] for a in independent(A, [*basis, *order]) if a not in basis]
    if missing:
        raise InputError(
            f"{', '.join(missing)} cannot be imposed: the other actions would have rank {len(basis)} of "
            f"{len(basis) + len(missing)}, so that links could not be in equilibrium; leave "
            f"{'it' if len(missing) == 1 else 'them'} to be computed, or impose a load instead"
        )
