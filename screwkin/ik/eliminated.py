"""Elimination for six revolute joints over arrays, by its programs.

Three programs for every batch: the equations' table, the determinant at seventeen angles of the given joint,
and at every zero of it the limb's angles. Nothing depends on a guess, so what is no zero is no solution.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from screwkin.algebra.arrays import Array, Integers
from screwkin.algebra.harmonics import TOUCH, cells, crossing, derivatives, equal_angles, harmonics
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.ik.closed import EXACT, alike
from screwkin.ik.elimination import ANGLES, Elimination, vanishing
from screwkin.ik.polish import polished
from screwkin.ik.rank import key_of, sines, solution_kind, within_limits, worst_excess, wrapped_angles
from screwkin.ik.ways import shared_plane, usable_ways
from screwkin.kinematics.serial_chain import SerialChain, per_chain

BLOCK = 512
"""Samples computed together, which bounds the memory of a large batch."""
DOUBLE = 1e-12
"""Extremum of a determinant, over its largest value, where rounding may hide two zeros."""


class Candidates(NamedTuple):
    """Branches (R,) of samples, those of each in order: best first, as ``ik.rank`` says.

    Attributes:
        sample: whose.
        q: (R, 6), angles in (-pi, pi], or one turn off where only that is in the limits.
        error: norm of the residual [m and rad].
        worst: how far the worst joint lies beyond its limits [rad], negative inside.
        key: what orders them.
    """

    sample: Integers
    q: Array
    error: Array
    worst: Array
    key: Array


def eliminated(chain: SerialChain, target: Array, guess: Array) -> tuple[Candidates, Integers]:
    """The candidates of a limb that has an elimination: what the zeros of determinants lead to.

    Where a zero leads to no branch of its own, several nearly share the angle in which is eliminated, as in a
    plane of motion all may: there it is eliminated in another joint as well.

    Args:
        chain: of the limb.
        target: exact poses of the tip (B, 4, 4).
        guess: (B, 6), to which the nearest branch comes first.

    Returns:
        The candidates; and the numbers of the samples that were eliminated in two joints.
    """
    (first, *others), plane = usable_ways(chain), shared_plane(chain)
    found, unsure = _by(chain, first, target, guess)
    shared = np.zeros(len(target), dtype=bool) if plane is None else plane.near(target)
    more = [(plane.way, shared)] if plane is not None else []
    more += [(way, unsure & ~shared) for way in others[:1]]
    for way, chosen in more:
        at = np.flatnonzero(chosen)
        if len(at):
            found = _together(found, _by(chain, way, target[at], guess[at])[0], at)
    again = np.any([chosen for _, chosen in more], axis=0) if more else shared
    return found, np.flatnonzero(again)


def _by(chain: SerialChain, way: Elimination, target: Array, guess: Array) -> tuple[Candidates, Array]:
    """Candidates by one way to eliminate; and whether some zero of a sample (B,) has no branch of its own."""
    starts = range(0, max(len(target), 1), BLOCK)
    blocks = [_candidates(chain, way, target[i : i + BLOCK], guess[i : i + BLOCK], i) for i in starts]
    parts, unsure = zip(*blocks, strict=True)
    return Candidates(*map(np.concatenate, zip(*parts, strict=True))), np.concatenate(unsure)


def _candidates(
    chain: SerialChain, way: Elimination, target: Array, guess: Array, first: int
) -> tuple[Candidates, Array]:
    """Those of a block of samples, from the number of the first one on."""
    table = run(equations(chain, way), {"target": target})["table"]
    x = equal_angles(ANGLES)
    waves = np.stack([np.ones(ANGLES), np.cos(x), np.sin(x)], axis=1)
    matrices = (waves @ table.swapaxes(0, 1).reshape(3, -1)).reshape(ANGLES, len(target), -1)
    owner, zero, depth = _zeros(run(values(), {"matrix": matrices})["value"][..., 0].T)
    circle = np.stack([np.cos(zero), np.sin(zero)], axis=1)
    given = {"target": target[owner], "guess": guess[owner], "circle": circle, "table": table[owner]}
    out = run(branch(chain, way), given)
    error, worst, key = (out[name][:, 0] for name in ("error", "worst", "key"))
    hidden = DOUBLE if way.chain is chain else TOUCH  # of a limb moved a little, more than rounding hides
    order = np.lexsort((key, owner))
    found = Candidates(*(part[order] for part in (owner, out["q"], error, worst, key)))
    unsure = np.zeros(len(target), dtype=bool)
    unsure[owner[(depth <= hidden) | (np.isnan(depth) & (error > EXACT))]] = True
    unsure[found.sample[1:][_repeats(found)]] = True
    return found._replace(sample=found.sample + first), unsure


def _repeats(found: Candidates) -> Array:
    """Whether candidates (R - 1,) but the first are the ones before them again."""
    same = found.sample[1:] == found.sample[:-1]
    return np.asarray(same & alike(found.q[1:], found.q[:-1]).all(axis=1))


def _together(found: Candidates, others: Candidates, at: Integers) -> Candidates:
    """Candidates of all samples and those of some, by numbers ``at``, each once; best first."""
    others = others._replace(sample=at[others.sample])
    both = Candidates(*map(np.concatenate, zip(found, others, strict=True)))
    order = np.lexsort((both.key, both.sample))
    both = Candidates(*(part[order] for part in both))
    return Candidates(*(part[np.r_[True, ~_repeats(both)]] for part in both))


def _zeros(value: Array) -> tuple[Integers, Array, Array]:
    """Zeros of polynomials from their values (B, 17): index (R,), ascending, angle, and depth.

    The depth is the value at an extremum that nearly touches zero, and NaN where the sign changes.
    """
    terms = harmonics(value)
    owner, low, high, dips, negative = cells(terms)
    at = owner[dips]
    ends = {"low": low[dips, None], "high": high[dips, None]}
    out = run(zero(1), {"terms": terms[at], **ends})
    bottom, depth = out["angle"][:, 0], out["value"][:, 0]
    crossed = (depth < 0) != negative[dips]
    touched = ~crossed & (np.abs(depth) <= TOUCH)
    lows = [low[~dips], low[dips][crossed], bottom[crossed]]
    highs = [high[~dips], bottom[crossed], high[dips][crossed]]
    owners = np.concatenate([owner[~dips], at[crossed], at[crossed]])
    ends = {"low": np.concatenate(lows)[:, None], "high": np.concatenate(highs)[:, None]}
    found = run(zero(0), {"terms": terms[owners], **ends})["angle"][:, 0]
    depths = np.concatenate([np.full(len(owners), np.nan), np.abs(depth[touched])])
    owners, found = np.concatenate([owners, at[touched]]), np.concatenate([found, bottom[touched]])
    order = np.lexsort((found, owners))
    return owners[order], found[order], depths[order]


@cache
def zero(order: int) -> Program:
    """Where a polynomial or its slope (``order`` 1) changes its sign between two angles; its value there."""
    recorder = Recorder(
        f"crossing_{order}", "Where a trigonometric polynomial or its slope changes its sign."
    )
    terms = recorder.input("terms", ANGLES + 1)
    (low,), (high,) = recorder.input("low", 1), recorder.input("high", 1)
    x = crossing(terms, low, high, order)
    recorder.output("angle", [x])
    recorder.output("value", derivatives(terms, x, (0,)))
    return recorder.program()


@per_chain
def equations(chain: SerialChain, way: Elimination) -> Program:
    """The table of ``Elimination`` for a pose of the tip."""
    recorder = Recorder(
        identifier(chain.limb, "equations"),
        f"Six equations in two joints of {chain.limb}: coefficients of 1, cosine and sine of a third joint.",
    )
    table = way.table(way.displacement(pose_input(recorder, "target")))
    recorder.output("table", [x for part in table for x in part], 3, 54)
    return recorder.program()


@cache
def values() -> Program:
    """The determinant that vanishes at a solution."""
    recorder = Recorder("dialytic_determinant", "What vanishes where six equations have a common solution.")
    recorder.output("value", [vanishing(recorder.input("matrix", 54))])
    return recorder.program()


@per_chain
def branch(chain: SerialChain, way: Elimination) -> Program:
    """The positions of a limb for one zero of the determinant."""
    recorder = Recorder(
        identifier(chain.limb, "branch"),
        f"Joint positions of {chain.limb} for an angle of one joint at which six equations have a common"
        " solution, after Newton steps; error: norm of the residual [m and rad]; worst: beyond limits;"
        " key: order.",
    )
    target, guess = pose_input(recorder, "target"), recorder.input("guess", 6)
    c, s = recorder.input("circle", 2)
    q = way.branch(way.displacement(target), c, s, recorder.input("table", 3, 54))
    angles, error = polished(chain, q, target)
    q = wrapped_angles(chain, angles)
    worst = worst_excess(chain, q)
    kind = solution_kind(worst, error <= EXACT)
    recorder.output("q", q)
    recorder.output("error", [error])
    recorder.output("worst", [worst])
    recorder.output("key", [key_of(angles, sines(within_limits(chain, guess)), kind)])
    return recorder.program()


def elimination_programs(chain: SerialChain) -> list[Program]:
    """What ``eliminated`` runs for most poses of a limb."""
    way = usable_ways(chain)[0]
    return [equations(chain, way), values(), zero(0), zero(1), branch(chain, way)]
