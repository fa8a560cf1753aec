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
from screwkin.ik.closed import EXACT
from screwkin.ik.elimination import ANGLES, Elimination, vanishing
from screwkin.ik.polish import polished
from screwkin.ik.rank import key_of, kind_of, sines, within_limits, worst_excess, wrapped_angles
from screwkin.kinematics.serial_chain import SerialChain, per_chain

BLOCK = 512
"""Samples computed together, which bounds the memory of a large batch."""


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


def eliminated(chain: SerialChain, way: Elimination, target: Array, guess: Array) -> Candidates:
    """The candidates of a limb: what the zeros of the determinant lead to.

    Args:
        chain: of the limb.
        way: to eliminate.
        target: exact poses of the tip (B, 4, 4).
        guess: (B, 6), to which the nearest branch comes first.
    """
    starts = range(0, max(len(target), 1), BLOCK)
    blocks = [_candidates(chain, way, target[i : i + BLOCK], guess[i : i + BLOCK], i) for i in starts]
    return Candidates(*map(np.concatenate, zip(*blocks, strict=True)))


def _candidates(chain: SerialChain, way: Elimination, target: Array, guess: Array, first: int) -> Candidates:
    """Those of a block of samples, from the number of the first one on."""
    table = run(equations(chain, way), {"target": target})["table"]
    x = equal_angles(ANGLES)
    waves = np.stack([np.ones(ANGLES), np.cos(x), np.sin(x)], axis=1)
    matrices = (waves @ table.swapaxes(0, 1).reshape(3, -1)).reshape(ANGLES, len(target), -1)
    owner, zero = _zeros(run(values(), {"matrix": matrices})["value"][..., 0].T)
    circle = np.stack([np.cos(zero), np.sin(zero)], axis=1)
    given = {"target": target[owner], "guess": guess[owner], "circle": circle, "table": table[owner]}
    out = run(branch(chain, way), given)
    error, worst, key = (out[name][:, 0] for name in ("error", "worst", "key"))
    order = np.lexsort((key, owner))
    parts = (part[order] for part in (owner + first, out["q"], error, worst, key))
    return Candidates(*parts)


def _zeros(value: Array) -> tuple[Integers, Array]:
    """Index (R,), ascending, and angle (R,) of the zeros of polynomials from their values (B, 17)."""
    terms = harmonics(value)
    owner, low, high, dips, negative = cells(terms)
    at = owner[dips]
    ends = {"low": low[dips, None], "high": high[dips, None]}
    out = run(zero(1), {"terms": terms[at], **ends})
    bottom, depth = out["angle"], out["value"][:, 0]
    crossed = (depth < 0) != negative[dips]
    touched = ~crossed & (np.abs(depth) <= TOUCH)
    lows = [low[~dips], low[dips][crossed], bottom[crossed, 0]]
    highs = [high[~dips], bottom[crossed, 0], high[dips][crossed]]
    owners = np.concatenate([owner[~dips], at[crossed], at[crossed]])
    ends = {"low": np.concatenate(lows)[:, None], "high": np.concatenate(highs)[:, None]}
    found = run(zero(0), {"terms": terms[owners], **ends})["angle"][:, 0]
    owners, found = np.concatenate([owners, at[touched]]), np.concatenate([found, bottom[touched, 0]])
    order = np.lexsort((found, owners))
    return owners[order], found[order]


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
    kind = kind_of(worst, error <= EXACT)
    recorder.output("q", q)
    recorder.output("error", [error])
    recorder.output("worst", [worst])
    recorder.output("key", [key_of(angles, sines(within_limits(chain, guess)), kind)])
    return recorder.program()


def elimination_programs(chain: SerialChain, way: Elimination) -> list[Program]:
    """What ``eliminated`` runs for a limb."""
    return [equations(chain, way), values(), zero(0), zero(1), branch(chain, way)]
