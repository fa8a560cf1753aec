"""Elimination for six revolute joints over arrays: which way is the most exact, and its programs.

Three programs for every batch: the equations' table, the determinant at seventeen angles of the given joint,
and at every zero of it the limb's angles. Nothing depends on a guess, so what is no zero is no solution.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from screwkin.algebra.arrays import Array, Integers
from screwkin.algebra.harmonics import TOUCH, cells, crossing, derivatives, equal_angles, harmonics
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Vector, as_array, norm, unstack
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier, pose_input
from screwkin.compiler.run import run
from screwkin.ik.closed import EXACT
from screwkin.ik.elimination import ANGLES, Elimination, dialytic, eliminations, vanishing
from screwkin.ik.polish import polished
from screwkin.ik.rank import key_of, kind_of, sines, within_limits, worst_excess, wrapped_angles
from screwkin.ik.starts import box, spread
from screwkin.kinematics.serial_chain import SerialChain, forward, per_chain

BLOCK = 512
"""Samples computed together, which bounds the memory of a large batch."""
POSES = 96
"""Poses at which the ways to eliminate are compared."""
RARELY = 0.98
"""Share of them whose errors are compared: ways that are as exact mostly differ in the rest."""
RARE_ENOUGH = 1e-6
"""Such an error [rad] with which a way is taken without trying others."""
EXACT_ENOUGH = 1e-9
"""Error of the given joint [rad], at nine of ten poses, that costs no branches but those that nearly fall
together."""
USABLE = 1e-5
"""Error [rad] above which the determinant vanishes for all poses alike."""
STIR = 1e-5
"""How far axes are turned [rad] and moved, over the limb's length, where it does."""
ROUGHLY = 1e-3
"""Error [rad] then, up to which Newton's method arrives."""
STEP = 1e-4
"""Difference of angles [rad] from which the slope of the determinant is computed."""
ROUNDING = 1e-15
"""Rounding of the determinant over its largest value."""
PLANAR = 0.1
"""How near to a plane of motion a pose is [rad, and m over the limb's length] whose branches share angles."""


@per_chain
def elimination(chain: SerialChain) -> Elimination | None:
    """The most exact way to eliminate for a limb, None where there is none.

    Where all determinants vanish for all poses alike, as of limbs with several pairs of axes that meet, it is
    that of a limb whose axes are moved by so little that Newton's method makes up for it.
    """
    best, error = _most_exact(chain)
    if best is None or error > USABLE:
        best, error = _most_exact(_stirred(chain))
    return best if error <= ROUGHLY else None


@per_chain
def across(chain: SerialChain) -> tuple[Vector, Elimination] | None:
    """Normal of the plane in which all branches share the angle that is eliminated, and another way there.

    Where the joints beside three parallel axes are at zero, as at the home of most legs, the limb moves in a
    plane: the branches of such a pose differ in the angles of these three alone.
    """
    first = elimination(chain)
    if first is None or len(chain.screws) != 6:
        return None
    axes = np.array([[float(x) for x in screw.s] for screw in chain.screws])
    parallel = np.abs(axes @ axes.T) > 1.0 - 1e-12
    own = parallel[int(parallel.sum(axis=1).argmax())]
    if own.sum() < 3 or own[_joint(first)]:
        return None
    low, high = box(chain)
    q = (low + spread(6, POSES, 0) * (high - low)) * own
    tips, _ = forward(chain.screws, unstack(q), chain.tip)
    normal = chain.screws[int(own.argmax())].s
    for near, enough in ((chain, USABLE), (_stirred(chain), ROUGHLY)):
        ways = [way for way in eliminations(near) if own[_joint(way)]]
        errors = [float(np.quantile(_errors(way, tips, q), 0.9)) for way in ways]
        best = int(np.argmin(errors))
        if errors[best] <= enough:
            return normal, ways[best]
    return None


def _joint(way: Elimination) -> int:
    """The joint in which is eliminated, by its number in the chain."""
    return 5 - way.given if way.backwards else way.given


def planar(chain: SerialChain, target: Array) -> Array:
    """Whether poses (B, 4, 4) are of the plane of ``across``, or nearly so."""
    other = across(chain)
    if other is None:
        return np.zeros(len(target), dtype=bool)
    n = np.array([float(x) for x in other[0]])
    D = target @ np.linalg.inv(as_array(chain.tip))
    turned = np.abs(D[:, :3, :3] @ n - n).max(axis=1)
    return (turned < PLANAR) & (np.abs(D[:, :3, 3] @ n) < PLANAR * chain.length)


def _way(chain: SerialChain, beside: bool) -> Elimination:
    other = across(chain) if beside else None
    way = other[1] if other else elimination(chain)
    assert way is not None
    return way


@per_chain
def exact(chain: SerialChain) -> bool:
    """Whether no branches are missed but those that nearly fall together."""
    return _most_exact(chain)[1] <= EXACT_ENOUGH


@per_chain
def _most_exact(chain: SerialChain) -> tuple[Elimination | None, float]:
    """The way with least errors, rare ones counted, and what they are at nine of ten poses [rad]."""
    best, least, most = None, np.inf, np.inf
    if len(chain.screws) == 6 and chain.turning.all():
        low, high = box(chain)
        q = low + spread(6, POSES, 0) * (high - low)
        tips, _ = forward(chain.screws, unstack(q), chain.tip)
        for way in eliminations(chain):
            errors = _errors(way, tips, q)
            error, rare = (float(np.quantile(errors, share)) for share in (0.9, RARELY))
            if rare < most:
                best, least, most = way, error, rare
            if rare <= RARE_ENOUGH:
                break
    return best, least


def _stirred(chain: SerialChain) -> SerialChain:
    """The limb with axes turned and moved a little, each in another direction."""
    screws = []
    for screw, way in zip(chain.screws, spread(6, len(chain.screws), 1) - 0.5, strict=True):
        turned = screw.s + Vector(*map(float, way[:3])) * STIR
        moved = screw.s0 + Vector(*map(float, way[3:])) * (STIR * chain.length)
        screws.append(Screw(turned / norm(turned), moved))
    return replace(chain, screws=tuple(screws))


def _errors(way: Elimination, tips: Pose, q: Array) -> Array:
    """Errors (B,) of branches at known positions.

    That of the given joint by value and slope of the determinant, or that of the null vector and of what
    follows from it: they belong to no single branch where several have that angle in common.
    """
    D, x = way.displacement(tips), q[:, _joint(way)]
    table = np.array([[np.broadcast_to(entry, x.shape) for entry in part] for part in way.table(D)])
    around = np.concatenate([equal_angles(ANGLES)[:, None] + 0 * x, [x, x + STEP, x - STEP]])
    matrices = _at(table.swapaxes(0, 1), around)
    values = np.asarray(vanishing(list(matrices)))
    here, after, before = values[ANGLES:]
    scale = np.abs(values[:ANGLES]).max(axis=0) * ROUNDING
    slope = np.abs(after - before) / (2 * STEP)
    own = np.zeros((len(x), 12, 12))
    for i, row in enumerate(dialytic(list(matrices[:, ANGLES]))):
        for k, entry in enumerate(row):
            own[:, i, k] = entry
    sizes = np.linalg.svd(own, compute_uv=False)
    single = ROUNDING / np.maximum(np.minimum(sizes[:, -2] / sizes[:, 0], way.conditioning), 1e-300)
    return np.maximum((np.abs(here) + scale) / np.where(slope > 0, slope, 1e-300), single)


def _at(table: Array, x: Array) -> Array:
    """Matrices (54, ...) of the given joint's angles x (..., B) from their coefficients (54, 3, B)."""
    fixed, cosine, sine = (table[:, k].reshape(len(table), *(1,) * (x.ndim - 1), -1) for k in range(3))
    return np.asarray(fixed + np.cos(x) * cosine + np.sin(x) * sine)


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


def eliminated(chain: SerialChain, target: Array, guess: Array, beside: bool = False) -> Candidates:
    """The candidates of a limb that has an elimination: what the zeros of the determinant lead to.

    Args:
        chain: of the limb.
        target: exact poses of the tip (B, 4, 4).
        guess: (B, 6), to which the nearest branch comes first.
        beside: by the way of ``across``.
    """
    starts = range(0, max(len(target), 1), BLOCK)
    blocks = [_candidates(chain, target[i : i + BLOCK], guess[i : i + BLOCK], i, beside) for i in starts]
    return Candidates(*map(np.concatenate, zip(*blocks, strict=True)))


def _candidates(chain: SerialChain, target: Array, guess: Array, first: int, beside: bool) -> Candidates:
    """Those of a block of samples, from the number of the first one on."""
    table = run(equations(chain, beside), {"target": target})["table"]
    x = equal_angles(ANGLES)
    waves = np.stack([np.ones(ANGLES), np.cos(x), np.sin(x)], axis=1)
    matrices = (waves @ table.swapaxes(0, 1).reshape(3, -1)).reshape(ANGLES, len(target), -1)
    owner, zero = _zeros(run(values(), {"matrix": matrices})["value"][..., 0].T)
    circle = np.stack([np.cos(zero), np.sin(zero)], axis=1)
    given = {"target": target[owner], "guess": guess[owner], "circle": circle, "table": table[owner]}
    out = run(branch(chain, beside), given)
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
def equations(chain: SerialChain, beside: bool = False) -> Program:
    """The table of ``Elimination`` for a pose of the tip."""
    way = _way(chain, beside)
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
def branch(chain: SerialChain, beside: bool = False) -> Program:
    """The positions of a limb for one zero of the determinant."""
    way = _way(chain, beside)
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


def elimination_programs(chain: SerialChain) -> list[Program]:
    """What ``eliminated`` runs for a limb."""
    return [equations(chain), values(), zero(0), zero(1), branch(chain)]
