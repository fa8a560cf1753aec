"""All branches of revolute joints without closed form: six, or four and five whose tip is free to turn.

Those of the nearest limb that has one, where the axes are parallel or meet but for tolerance, else those
of an elimination; Newton's method on the limb itself makes them exact.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from screwkin.algebra.arrays import Array, Integers
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.ik.closed import (
    EXACT,
    SAME,
    clearness,
    completed,
    conditioned,
    first_of_its_kind,
)
from screwkin.ik.eliminated import Candidates, eliminated, elimination_programs
from screwkin.ik.elimination import BRANCHES
from screwkin.ik.on_limits import on_limits
from screwkin.ik.polish import NEAR, ROUGH, both_sides, from_guess, iterated, steps, unfolded
from screwkin.ik.rank import INSIDE
from screwkin.ik.relative import departure, relative
from screwkin.ik.solutions import KINDS, LimbSolutions, ordered
from screwkin.ik.ways import elimination, exact
from screwkin.kinematics.serial_chain import SerialChain, per_chain
from screwkin.model.records import LIMIT_TOLERANCE

OTHERS = 2
"""Other axes of further joints that are tried where those of the first choice lead to no solution."""
FOLDED = 100.0
"""Slack of a relative's branches, over its departure from the limb, below which the limb's own may fall
together elsewhere."""
CLEAR = 1e-7
"""Slack of a relative's branches below which rounding decides about them: there its arrays serve."""
APART = 10 * SAME
"""Difference of two branches' keys below which they may be one: that of six angles ``SAME`` apart is less."""


def has_branches(chain: SerialChain) -> bool:
    """True if all branches of the limb can be computed, though it has no closed form."""
    whole = of_six(chain)
    return relative(whole) is not None or elimination(whole) is not None


def by_relative(chain: SerialChain) -> bool:
    """True if elimination is not exact, and the limb has a relative with a closed form."""
    whole = of_six(chain)
    return not exact(whole) and relative(whole) is not None


def of_six(chain: SerialChain) -> SerialChain:
    """The limb, one of four or five joints with further ones that turn its tip."""
    return _wholes(chain)[0]


@per_chain
def _wholes(chain: SerialChain) -> tuple[SerialChain, ...]:
    """The limb ``of_six``, and others for poses in which that is singular.

    Of the axes of further joints those come first about which branches of the relative are furthest apart,
    then others, or where there is no relative one, by how well the six joints are conditioned.
    """
    missing = 6 - len(chain.screws)
    if missing not in (1, 2) or not chain.turning.all():
        return (chain,)
    near = [(form, whole) for whole in completed(chain) if (form := relative(whole)) is not None]
    if near:
        clearest = max(near, key=lambda pair: clearness(pair[0], 6 - missing))[1]
        others = [whole for _, whole in near if whole is not clearest]
        return clearest, *sorted(others, key=conditioned, reverse=True)[:OTHERS]
    freed = [chain.freed(free, range(missing)) for free in combinations(("rx", "ry", "rz"), missing)]
    return (
        max((whole for whole in freed if elimination(whole) is not None), key=conditioned, default=chain),
    )


def branch_solutions(
    chain: SerialChain, target: Array, guess: Array, tolerances: tuple[float, float], batch: tuple[int, ...]
) -> LimbSolutions:
    """All solutions of a limb that ``has_branches``, best first.

    Args:
        chain: of the limb.
        target: exact poses of the tip (B, 4, 4).
        guess: (B, n).
        tolerances: angle [rad] and distance [m] within which limits are preferred to an exact solution.
        batch: shape with B samples.
    """
    if len(chain.screws) < 6:
        return _with_held_tip(chain, target, guess, tolerances, batch)
    if by_relative(chain):
        return careful_solutions(chain, *_near_relative(chain, target), target, guess, tolerances, batch)
    found, again = eliminated(chain, target, guess)
    place = np.arange(len(found.sample)) - np.searchsorted(found.sample, found.sample)
    solutions = _at_once(chain, found, place, len(target), batch)
    at = np.union1d(_open(found, len(target), tolerances), again)
    if len(at):
        number = np.full(len(target), -1)
        number[at] = np.arange(len(at))
        rows = np.flatnonzero((number[found.sample] >= 0) & (place < BRANCHES))
        slots = number[found.sample[rows]], place[rows]
        q, error = np.zeros((len(at), BRANCHES, 6)), np.full((len(at), BRANCHES), np.inf)
        q[slots], error[slots] = found.q[rows], found.error[rows]
        part = careful_solutions(chain, q, error, target[at], guess[at], tolerances, (len(at),))
        for name in KINDS:
            whole, some = getattr(solutions, name), getattr(part, name)
            whole.reshape(len(target), *some.shape[1:])[at] = some
    return solutions


def _with_held_tip(
    chain: SerialChain, target: Array, guess: Array, tolerances: tuple[float, float], batch: tuple[int, ...]
) -> LimbSolutions:
    """The solutions of four or five joints: those of six where the last, which turn the tip, rest."""
    first, *others = _wholes(chain)
    q, error = _held(chain, first, target, guess)
    for whole in others:
        lost = np.flatnonzero(~(error <= EXACT).any(axis=1))
        if len(lost):
            q[lost], error[lost] = _held(chain, whole, target[lost], guess[lost])
    if max(tolerances) > LIMIT_TOLERANCE:
        owner, k = np.nonzero(error <= EXACT)
        q[owner, k] = on_limits(chain, q[owner, k], target[owner], tolerances)
    valid = first_of_its_kind(q, error)
    return _certified(chain, q, error, valid, guess, batch)


def _held(chain: SerialChain, whole: SerialChain, target: Array, guess: Array) -> tuple[Array, Array]:
    """What Newton steps of the limb make of the branches (B, k, n) of six joints, and its error (B, k)."""
    own, count = len(chain.screws), len(target)
    start = np.concatenate([guess, np.zeros((count, 6 - own))], axis=1)
    found = branch_solutions(whole, target, start, (0.0, 0.0), (count,)).q
    owner, k = np.nonzero(np.isfinite(found).all(axis=2))
    q, error = np.nan_to_num(found[..., :own]), np.full(found.shape[:2], np.inf)
    out = run(steps(chain), {"start": q[owner, k], "target": target[owner]})
    q[owner, k], error[owner, k] = out["q"], out["error"][:, 0]
    iterated(chain, q, error, target)
    return chain.wrapped(q), error


def _certified(
    chain: SerialChain, q: Array, error: Array, valid: Array, guess: Array, batch: tuple[int, ...]
) -> LimbSolutions:
    """Branches in order; where none is a solution, the nearest one first."""
    lost = np.flatnonzero(~valid.any(axis=1))
    k = error[lost].argmin(axis=1)
    q[lost, 0], error[lost, 0] = q[lost, k], error[lost, k]
    once = np.ones(valid.shape, dtype=int)
    return ordered(chain, "branches", q, valid, error, once, guess, batch)


def _at_once(
    chain: SerialChain, found: Candidates, place: Integers, count: int, batch: tuple[int, ...]
) -> LimbSolutions:
    """The candidates that are solutions, in their order; place: of each among those of its sample."""
    rows = np.flatnonzero((found.key < -0.5 * INSIDE) & (place < BRANCHES))
    slots = found.sample[rows], place[rows]
    q, error = np.full((count, BRANCHES, 6), np.nan), np.full((count, BRANCHES), np.inf)
    valid, inside = np.zeros((2, count, BRANCHES), dtype=bool)
    q[slots], error[slots] = found.q[rows], found.error[rows]
    valid[slots], inside[slots] = True, found.key[rows] < -1.5 * INSIDE
    once = np.ones((count, BRANCHES), dtype=int)
    q, valid, inside, error, once = (
        part.reshape(*batch, *part.shape[1:]) for part in (q, valid, inside, error, once)
    )
    return LimbSolutions(chain.limb, chain.names, "branches", q, valid, inside, error, once, chain)


def _open(found: Candidates, count: int, tolerances: tuple[float, float]) -> Integers:
    """Samples with more to decide.

    They have no solution inside the limits, or some that want more Newton steps, that may be one, or that are
    at a limit or may be put on it.
    """
    sample, worst, valid = found.sample, found.worst, found.key < -0.5 * INSIDE
    open_ = np.ones(count, dtype=bool)
    open_[sample[(found.key < -1.5 * INSIDE) & (found.error <= ROUGH)]] = False
    more = (found.error > ROUGH) & (found.error < NEAR)
    beside = valid & (worst >= LIMIT_TOLERANCE - SAME) & (worst <= max(LIMIT_TOLERANCE + SAME, *tolerances))
    open_[sample[more | beside]] = True
    alike = (sample[1:] == sample[:-1]) & (found.key[1:] - found.key[:-1] < APART) & valid[1:]
    open_[sample[1:][alike]] = True
    return np.flatnonzero(open_)


def careful_solutions(
    chain: SerialChain,
    q: Array,
    error: Array,
    target: Array,
    guess: Array,
    tolerances: tuple[float, float],
    batch: tuple[int, ...],
) -> LimbSolutions:
    """The solutions that branches (B, k, 6) lead to, with all that rounding leaves open decided.

    Args:
        chain: of the limb.
        q: changed in place.
        error: of them (B, k) [m and rad, norm], infinite where there is no branch; changed too.
        target: exact poses of the tip (B, 4, 4).
        guess: (B, 6).
        tolerances: see ``branch_solutions``.
        batch: shape with B samples.
    """
    iterated(chain, q, error, target)
    unfolded(chain, q, error, target)
    from_guess(chain, q, error, target, guess)
    q = chain.wrapped(q)
    if max(tolerances) > LIMIT_TOLERANCE:
        owner, k = (error <= EXACT).nonzero()
        q[owner, k] = on_limits(chain, q[owner, k], target[owner], tolerances)
    return _certified(chain, q, error, first_of_its_kind(q, error), guess, batch)


def _near_relative(chain: SerialChain, target: Array) -> tuple[Array, Array]:
    """Branches (B, 16, 6) next to those of the limb's relative, and their error (B, 16).

    Where rounding decides about these, and where they lead nowhere, those over arrays are taken.
    """
    out = run(relative_branches(chain), {"target": target})
    q, error = _next_to(chain, out["q"], out["slack"], target)
    unclear = (np.abs(out["slack"]) < CLEAR).any(axis=1) | ~(error <= EXACT).any(axis=1)
    again, form = np.flatnonzero(unclear), relative(chain)
    if len(again) and form is not None:
        near, slack = form.branches(target[again]), np.zeros((len(again), out["slack"].shape[1]))
        q[again], error[again] = _next_to(chain, near, slack, target[again])
    return q, error


def _next_to(chain: SerialChain, near: Array, slack: Array, target: Array) -> tuple[Array, Array]:
    """What Newton steps make of a relative's branches (B, k, 6), and of both sides of nearly folded ones."""
    count, k = near.shape[:2]
    starts, present = np.tile(near, (1, 3, 1)), np.ones((count, 3 * k), dtype=bool)
    folds = np.abs(slack) < FOLDED * departure(chain)
    present[:, k:] = np.tile(folds, 2)
    sample, row = folds.nonzero()
    ahead, back = both_sides(chain, near[sample, row], target[sample])
    starts[sample, k + row], starts[sample, 2 * k + row] = ahead, back
    q, error = starts, np.full(present.shape, np.inf)
    sample, row = (present & np.isfinite(starts).all(axis=2)).nonzero()
    polished = run(steps(chain), {"start": starts[sample, row], "target": target[sample]})
    q[sample, row], error[sample, row] = polished["q"], polished["error"][:, 0]
    crowded = np.flatnonzero((error < NEAR).sum(axis=1) > BRANCHES)
    again = (error[crowded] <= EXACT) & ~first_of_its_kind(chain.wrapped(q[crowded]), error[crowded])
    error[crowded] = np.where(again, np.inf, error[crowded])
    first = np.argsort(error, axis=1, kind="stable")[:, :BRANCHES]
    return np.take_along_axis(q, first[..., None], axis=1), np.take_along_axis(error, first, axis=1)


@per_chain
def relative_branches(chain: SerialChain) -> Program:
    """All branches of the limb's relative."""
    form = relative(chain)
    assert form is not None
    recorder = Recorder(
        identifier(chain.limb, "relative"),
        f"All branches of the limb nearest to {chain.limb} that has a closed form; slack: how far they are"
        " from falling together.",
    )
    rows = form.formula(pose_input(recorder, "target"))
    recorder.output("q", [x for *angles, _ in rows for x in angles], len(rows), 6)
    recorder.output("slack", [slack for *_, slack in rows])
    return recorder.program()


def branch_programs(chain: SerialChain) -> list[Program]:
    """What ``branch_solutions`` runs for a limb."""
    whole = of_six(chain)
    own = [relative_branches(whole)] if by_relative(whole) else elimination_programs(whole)
    return [*own, *map(steps, [whole] if whole is chain else [whole, chain])]
