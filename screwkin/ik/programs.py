"""Programs of limbs with closed forms: all branches in order, or the one nearest to a guess.

One rule orders branches everywhere: those inside the limits first, then the nearest to the guess. A program
certifies its answer only where rounding cannot change a decision; ``ik.branches`` decides the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from screwkin.algebra import scalar
from screwkin.algebra.scalar import Scalar, abs_, larger, where
from screwkin.algebra.se3 import NO_TWIST, ZERO, Pose, Vector
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import identifier, pose_input
from screwkin.ik.all_branches import branch_programs, has_branches
from screwkin.ik.closed import EXACT, recognised
from screwkin.ik.rank import (
    INSIDE,
    Pairs,
    key_of,
    sines,
    solution_kind,
    within_limits,
    worst_excess,
    wrapped_angles,
)
from screwkin.kinematics.arrays import Argument
from screwkin.kinematics.door import Door
from screwkin.kinematics.limits import CUT, TURN, turn_within
from screwkin.kinematics.rigid import nearest_pose
from screwkin.kinematics.serial_chain import SerialChain, miss, per_chain
from screwkin.kinematics.status import SINGULAR
from screwkin.mechanism.limb_motion import seen_screws
from screwkin.mechanism.limb_rates import point_rates, pose_rates, split_of
from screwkin.mechanism.linkages import crossed_linkages
from screwkin.model.records import LIMIT_TOLERANCE
from screwkin.model.robot import Robot

CLEAR = 1e-8
"""Slack of a branch from which its sign alone says whether it is a solution."""
TIE = 1e-9
"""Difference of the sums of (1 - cos) above which one branch is nearer to the guess than another."""
NEAR_LIMIT = 1e-10
"""Excess [rad] closer than this to the tolerance of limits is not decided by a program."""


@per_chain
def limb_branches(chain: SerialChain, position: bool) -> Door:
    """All solutions of a limb's closed form, in the order of ``ik.solutions.ordered``."""
    form = recognised(chain, position)
    assert form is not None
    what = "position" if position else "pose"
    recorder = Recorder(
        identifier(chain.limb, "ik", what),
        f"All solutions of {chain.limb} for a {what} of its tip in the base frame: inside the limits first,"
        " then the nearest to a guess; NaN where there is none. error: norm of the residual [m and rad];"
        " kind: 2 inside the limits, 1 outside, 0 none; certified: 1 if rounding leaves nothing open.",
    )
    arguments = _arguments(chain, "T_base_tip", position)
    target = _target(recorder, arguments[0])
    near = sines(within_limits(chain, recorder.input("guess", len(chain.names))))
    rows, certified = [], 1.0
    for *angles, slack in form.formula(target):
        q = wrapped_angles(chain, angles)
        error = miss(chain, angles, target)
        worst = worst_excess(chain, q)
        solves = error <= EXACT
        clear = (slack > CLEAR) & solves & (abs_(worst - LIMIT_TOLERANCE) > NEAR_LIMIT)
        certified = where(clear | ((slack < -CLEAR) & ~solves), certified, 0.0)
        rows.append([key_of(angles, near, solution_kind(worst, solves)), error, *q])
    rows = _sorted(rows)
    kinds = [where(key < -1.5 * INSIDE, 2.0, where(key < -0.5 * INSIDE, 1.0, 0.0)) for key, *_ in rows]
    for one, other in pairwise(rows):
        certified = where((other[0] - one[0] > TIE) | (other[0] > -0.5 * INSIDE), certified, 0.0)
    absent = [kind < 0.5 for kind in kinds]
    shown = [where(none, math.nan, x) for none, (_, _, *q) in zip(absent, rows, strict=True) for x in q]
    recorder.output("q", shown, len(rows), len(chain.names))
    errors = [where(none, math.inf, error) for none, (_, error, *_) in zip(absent, rows, strict=True)]
    recorder.output("error", errors)
    recorder.output("kind", kinds)
    recorder.output("certified", [where(kinds[0] > 0.5, certified, 0.0)])
    return Door(recorder, arguments)


def _arguments(chain: SerialChain, target: str, position: bool) -> list[Argument]:
    """Target and guess of a limb, as messages call them."""
    shape = (3,) if position else (4, 4)
    return [Argument("target", target, shape, not position), Argument("guess", "guess", (len(chain.names),))]


def _target(recorder: Recorder, argument: Argument) -> Pose | Vector:
    """An input that is a position, or a pose, whose rotation is made exact to the last digit."""
    scalars = recorder.input(argument.name, *argument.shape)
    return nearest_pose(scalars) if argument.rigid else Vector(*scalars)


def _sorted(rows: Sequence[list[Scalar]]) -> list[list[Scalar]]:
    """The rows by their first scalar, by a merge exchange network; equal ones in any order.

    Source: Batcher (1968); Knuth, The Art of Computer Programming, 5.2.2, algorithm M.
    """
    rows, count, p = list(rows), len(rows), 1
    while p < count:
        apart = p
        while apart:
            for first in range(apart % p, count - apart, 2 * apart):
                for k in range(first, min(first + apart, count - apart)):
                    if k // (2 * p) == (k + apart) // (2 * p):
                        rows[k], rows[k + apart] = _in_order(rows[k], rows[k + apart])
            apart //= 2
        p *= 2
    return rows


def _in_order(a: list[Scalar], b: list[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
    """Two rows, that with the smaller first scalar first."""
    swap = b[0] < a[0]
    first = [where(swap, y, x) for x, y in zip(a, b, strict=True)]
    return first, [where(swap, x, y) for x, y in zip(a, b, strict=True)]


@per_chain
def limb_pose(chain: SerialChain, position: bool) -> Door:
    """The one solution of a limb that ``solve_pose`` takes, for a target in the world."""
    recorder = Recorder(
        identifier(chain.limb, "pose", "position" if position else "pose"),
        f"Joint positions of {chain.limb} that put its tip at a target in the world frame: nearest to a guess"
        " within the limits, else nearest to it. error: norm of the residual [m and rad]; inside: 1 if within"
        " the limits; certified: 1 if rounding leaves nothing open and the limb is not singular.",
    )
    base = Argument("T_world_base", "targets['base']", (4, 4), rigid=True)
    arguments = [base, *_arguments(chain, "target", position)]
    T, wanted = (_target(recorder, argument) for argument in arguments[:2])
    assert isinstance(T, Pose)
    here = T.R.T @ (wanted - T.p) if isinstance(wanted, Vector) else T.inverse @ wanted
    guess = recorder.input("guess", len(chain.names))
    q, angles, inside, clear, _ = _nearest(chain, here, guess)
    error = miss(chain, angles, here)
    regular = abs_(limb_determinant(chain, angles)) > determinant_bound(chain, SINGULAR)
    recorder.output("q", q)
    recorder.output("error", [error])
    recorder.output("inside", [where(inside, 1.0, 0.0)])
    recorder.output("certified", [where(clear & (error <= EXACT) & regular, 1.0, 0.0)])
    return Door(recorder, arguments)


def limb_nearest(robot: Robot, limb: str) -> Program:
    """The solution of a limb's closed form for a pose of its tip in the base frame; it is exported to C."""
    chain = SerialChain.of(robot, limb)
    recorder = Recorder(
        identifier(robot.name, chain.limb, "nearest"),
        f"The solution of {chain.limb} of {robot.name} for a pose of its tip in the base frame: nearest to a"
        " guess within the limits, else nearest to it; error: norm of the residual [m and rad];"
        " found: 1 if there is a solution, 0 if there is none (then q is the guess), -1 if rounding leaves it"
        " open.",
    )
    target, guess = pose_input(recorder, "T_base_tip"), recorder.input("guess", len(chain.names))
    q, _, _, clear, none = _nearest(chain, target, guess)
    recorder.output("q", [where(none, old, new) for old, new in zip(guess, q, strict=True)])
    recorder.output("error", [miss(chain, q, target)])
    recorder.output("found", [where(none, 0.0, where(clear, 1.0, -1.0))])
    return recorder.program()


def _nearest(
    chain: SerialChain, target: Pose | Vector, guess: Sequence[Scalar]
) -> tuple[list[Scalar], list[Scalar], Scalar, Scalar, Scalar]:
    """The best branch: its positions; the same less whole turns, whose sines and cosines are known.

    And conditions: inside the limits, clear, and no branch at all.

    Nearness is the sum of cosines over the joints, and limits are arcs of the circle: neither needs angles,
    so that only one branch's are computed.
    """
    form = recognised(chain, isinstance(target, Vector))
    assert form is not None
    held = within_limits(chain, guess)
    near = sines(held)
    none, least_key = -4.0 * INSIDE, -3.0 * INSIDE
    best: list[Scalar] = [none, *(x for pair in near for x in pair)]
    second: Scalar = none
    for *angles, slack in form.formula(target):
        pairs = sines(angles)
        alike = sum(s * a + c * b for (s, c), (a, b) in zip(pairs, near, strict=True))
        inside, decided = _inside(chain, pairs)
        clear = (slack > CLEAR) & decided
        key = alike + where(inside, INSIDE, 0.0)
        shown = where(clear, key, none)
        unclear = (abs_(slack) <= CLEAR) | ((slack > CLEAR) & ~decided)
        better = shown > best[0]
        second = larger(second, larger(where(better, best[0], shown), where(unclear, alike + INSIDE, none)))
        here = [shown, *(x for pair in pairs for x in pair)]
        best = [where(better, new, old) for new, old in zip(here, best, strict=True)]
    score, *flat = best
    ends = zip(held, flat[::2], flat[1::2], near, chain.lower.tolist(), chain.upper.tolist(), strict=True)
    q = []
    for start, s, c, (a, b), low, high in ends:
        away = scalar.arc(s * b - c * a, c * b + s * a)
        away = where(away <= CUT - math.pi, away + TURN, away)
        q.append(turn_within(start + away, low, high))
    angles = [scalar.arc(s, c) for s, c in zip(flat[::2], flat[1::2], strict=True)]
    inside = score > 0.5 * INSIDE
    clear = (score > least_key) & (score - second > TIE)
    return q, angles, inside, clear, (score < least_key) & (second < least_key)


def _inside(chain: SerialChain, pairs: Pairs) -> tuple[Scalar, Scalar]:
    """Conditions: angles given by sine and cosine are within the limits; rounding cannot change that."""
    inside, decided = None, None
    for (s, c), low, high in zip(pairs, chain.lower.tolist(), chain.upper.tolist(), strict=True):
        half = (high - low) / 2 + LIMIT_TOLERANCE
        if half >= math.pi:
            continue
        middle = (low + high) / 2
        margin = c * math.cos(middle) + s * math.sin(middle) - math.cos(half)
        here, sure = margin >= 0, abs_(margin) > max(NEAR_LIMIT * math.sin(half), 1e-14)
        inside = here if inside is None else inside & here
        decided = sure if decided is None else decided & sure
    if inside is None:
        s, _ = pairs[0]
        return s * s >= 0, s * s >= 0
    return inside, decided


def determinant_bound(chain: SerialChain, tolerance: float) -> float:
    """Determinant of a limb's screws above which their least singular value is above a tolerance.

    The product of the other n - 1 singular values is at most that of a matrix with its Frobenius norm shared
    equally, and the norm is bounded by how far every axis can be from the tip.
    """
    n = len(chain.screws)
    square = sum((n > 3) + (lever / chain.length) ** 2 for lever in chain.levers)
    return float(tolerance * (square / (n - 1)) ** ((n - 1) / 2))


def limb_determinant(chain: SerialChain, q: Sequence[Scalar]) -> Scalar:
    """Determinant of a limb's screws, with velocities divided by its length (``limb_rates``)."""
    split = split_of(chain)
    if len(chain.screws) == 3:
        return point_rates(seen_screws(chain, split, q, 2), ZERO, chain.length)[1]
    joints = split.first + 1 if split else 3
    return pose_rates(seen_screws(chain, split, q, joints), split, NO_TWIST, chain.length)[1]


def limb_programs(chain: SerialChain) -> list[Program]:
    """The programs of a limb's closed forms or branches: what ``limb_ik`` and ``solve_pose`` run."""
    kinds = [position for position in (False, True) if recognised(chain, position)]
    closed = [make(chain, position).guarded for position in kinds for make in (limb_branches, limb_pose)]
    if False in kinds or not has_branches(chain):
        return closed
    return [*closed, *branch_programs(chain)]


def limb_programs_of(robot: Robot, free: Mapping[str, tuple[str, ...]] | None = None) -> list[Program]:
    """The programs worth preparing for inverse kinematics: of limbs whose branches are known.

    Args:
        robot: the robot.
        free: by tip, rotations that follow.
    """
    limbs = [limb for limb in robot.limbs if not crossed_linkages(robot, limb.name)]
    chains = [SerialChain.of(robot, limb.name, (free or {}).get(limb.tip, ())) for limb in limbs]
    return [program for chain in chains for program in limb_programs(chain)]
