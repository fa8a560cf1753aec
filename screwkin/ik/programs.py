"""Kernels of limbs: closed-form inverse kinematics, of one limb or of the whole body.

What rounding leaves in doubt is marked, so that the algorithms of ``solve`` decide there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from screwkin.algebra import scalar
from screwkin.algebra.scalar import Scalar, abs_, where
from screwkin.algebra.screws import AT_REST, advance
from screwkin.algebra.se3 import NO_TWIST, UNTURNED, ZERO, Pose, Vector, dot
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, pose_input
from screwkin.errors import InputError
from screwkin.ik.closed import EXACT, closed_form
from screwkin.ik.point_limb import point_branches, shoulder_of
from screwkin.kinematics.serial_chain import Chain
from screwkin.kinematics.status import CLOSED, SINGULAR
from screwkin.mechanism.limb_motion import seen_screws
from screwkin.mechanism.limb_rates import doubtful, point_rates, pose_rates, split_of
from screwkin.mechanism.tip_motion import best_link
from screwkin.model.robot import Robot

DOUBT = 1e-8
"""Slack of a branch below which it is left to the algorithms that keep their digits there."""
WITHIN = 1e-9
"""Excess over a limit that counts as rounding, as in ``Chain.within``."""
FARTHER = 100.0
"""More than the nearness of two branches can differ."""
FOUND = (
    "found: 1 if there is a solution, 0 if there is none (then q is the guess), -1 if rounding leaves it open"
)


@kept
def limb_branches(robot: Robot, limb: str) -> Program:
    """All solutions of a limb's closed form, in the order of ``ik.solutions.ordered``."""
    chain = Chain.of(robot, limb)
    recorder = Recorder(
        identifier(robot.name, chain.limb, "ik"),
        f"All solutions of {chain.limb} of {robot.name} for a pose of its tip in the base frame: inside the"
        " limits first, then the nearest to a guess; NaN where there is none. error: what lacks to the pose"
        " [m and rad, norm]; kind: 2 inside the limits, 1 outside, 0 none; sure: 1 if rounding leaves nothing"
        " open.",
    )
    target, guess = pose_input(recorder, "T_base_tip"), recorder.input("guess", len(chain.names))
    near, rows, sure = [(scalar.sin(x), scalar.cos(x)) for x in guess], [], 1.0
    for *q, slack in closed_form(chain).formula(target):
        q, error = wrapped(chain, q), gap(chain, q, target)
        solves = error <= EXACT
        sure = where(((slack > DOUBT) & solves) | ((slack < -DOUBT) & ~solves), sure, 0.0)
        kind = where(solves, where(excess(chain, q)[0] <= WITHIN, 2.0, 1.0), 0.0)
        apart = sum(1.0 - cosine for cosine in cosines(q, near))
        none = kind < 0.5
        shown = [where(none, math.nan, x) for x in q]
        rows.append([apart - FARTHER * kind, kind, where(none, math.inf, error), *shown])
    rows = _sorted(rows)
    recorder.output("q", [x for _, _, _, *q in rows for x in q], len(rows), len(chain.names))
    recorder.output("error", [error for _, _, error, *_ in rows])
    recorder.output("kind", [kind for _, kind, *_ in rows])
    recorder.output("sure", [where(rows[0][1] > 0.5, sure, 0.0)])
    return recorder.program()


def _sorted(rows: Sequence[list[Scalar]]) -> list[list[Scalar]]:
    """The rows by their first scalar; equal ones keep their order, as neighbours only change places."""
    rows = list(rows)
    for last in range(1, len(rows)):
        for k in range(last, 0, -1):
            a, b = rows[k - 1], rows[k]
            swap = b[0] < a[0]
            rows[k - 1] = [where(swap, y, x) for x, y in zip(a, b, strict=True)]
            rows[k] = [where(swap, x, y) for x, y in zip(a, b, strict=True)]
    return rows


def cosines(q: Sequence[Scalar], near: Sequence[tuple[Scalar, Scalar]]) -> list[Scalar]:
    """Cosines of the angles' differences from others that are told by sine and cosine."""
    return [scalar.sin(x) * s + scalar.cos(x) * c for x, (s, c) in zip(q, near, strict=True)]


def excess(chain: Chain, q: Sequence[Scalar]) -> tuple[Scalar, Scalar]:
    """How far the joint furthest beyond its limits lies, below 0 inside; and its index in the robot."""
    joints = chain.joints
    worst, index = -math.inf, float(joints[0])
    for k, (x, low, high) in enumerate(zip(q, chain.lower.tolist(), chain.upper.tolist(), strict=True)):
        for here in [low - x] * math.isfinite(low) + [x - high] * math.isfinite(high):
            more = here > worst
            worst, index = where(more, here, worst), where(more, float(joints[k]), index)
    return worst, index


@kept
def limb_nearest(robot: Robot, limb: str) -> Program:
    """The solution of a limb's closed form that is nearest to a guess."""
    chain = Chain.of(robot, limb)
    recorder = Recorder(
        identifier(robot.name, chain.limb, "nearest"),
        f"The solution of {chain.limb} of {robot.name} nearest to a guess, for a pose of its tip in the base"
        f" frame; error: what lacks to the pose [m and rad, norm]; {FOUND}.",
    )
    target, guess = pose_input(recorder, "T_base_tip"), recorder.input("guess", len(chain.names))
    q, found = nearest_branch(chain, closed_form(chain).formula(target), guess)
    recorder.output("q", q)
    recorder.output("error", [gap(chain, q, target)])
    recorder.output("found", [found])
    return recorder.program()


@kept
def solvable(robot: Robot, tip: str, pose: bool) -> bool:
    """True if a limb's pose (or its tip's position) has a closed form."""
    chain = Chain.of(robot, tip)
    if not pose:
        return shoulder_of(chain) is not None
    try:
        closed_form(chain)
    except InputError:
        return False
    return True


@kept
def whole_body(robot: Robot, targets: tuple[tuple[str, bool], ...]) -> Program:
    """Joint positions that put several tips where they are wanted, each limb by its closed form.

    Args:
        robot: limbs that share no joints.
        targets: tips, and whether it is a pose (4, 4) that is wanted of each, or a position (3,).
    """
    recorder = Recorder(
        identifier(robot.name, "pose"),
        f"Joint positions of {robot.name} nearest to a guess that put base and tips where they are wanted,"
        " world frame; for each target error: what lacks to it [m and rad, norm]; beyond: how far the joint"
        " furthest beyond its limits lies, below 0 inside; worst: its index; sure: 1 if rounding leaves"
        " nothing open.",
    )
    T, guess = pose_input(recorder, "T_world_base"), recorder.input("guess", len(robot.joints))
    back, q = T.inverse, list(guess)
    told: dict[str, list[Scalar]] = {"error": [], "beyond": [], "worst": [], "sure": []}
    for tip, pose in targets:
        chain = Chain.of(robot, tip)
        name = identifier("target", tip)
        if pose:
            target = back @ pose_input(recorder, name)
            branches = closed_form(chain).formula(target)
        else:
            wanted = T.R.T @ (Vector(*recorder.input(name, 3)) - T.p)
            target, shoulder = Pose(UNTURNED, wanted), shoulder_of(chain)
            assert shoulder is not None
            branches = point_branches(chain.screws, shoulder, chain.tip.p, wanted)
        own, found = nearest_branch(chain, branches, [guess[i] for i in chain.joints])
        for i, x in zip(chain.joints, own, strict=True):
            q[i] = x
        error, (beyond, worst) = gap(chain, own, target, pose), excess(chain, own)
        regular = abs_(limb_determinant(robot, chain, own)) > doubtful(chain, SINGULAR)
        sure = (found > 0.5) & (error <= CLOSED * 1e-2) & regular
        for values, value in zip(told.values(), (error, beyond, worst, where(sure, 1.0, 0.0)), strict=True):
            values.append(value)
    recorder.output("q", q)
    for group, values in told.items():
        recorder.output(group, values)
    return recorder.program()


def nearest_branch(
    chain: Chain, branches: Sequence[Sequence[Scalar]], guess: Sequence[Scalar]
) -> tuple[list[Scalar], Scalar]:
    """Angles of the solution nearest to the guess, and whether it is one: 1, 0 (then the guess), -1 in doubt.

    Nearness is the sum of (1 - cos) over the joints. It needs no angles: only one branch's are computed.
    """
    near = [(scalar.sin(x), scalar.cos(x)) for x in guess]
    best: list[Scalar] = [-50.0, *(x for pair in near for x in pair)]
    rival: Scalar = -50.0
    for *q, slack in branches:
        pairs = [(scalar.sin(x), scalar.cos(x)) for x in q]
        alike = sum(cosines(q, near))
        here = [where(slack > DOUBT, alike, -100.0), *(x for pair in pairs for x in pair)]
        rival = where((abs_(slack) <= DOUBT) & (alike > rival), alike, rival)
        better = here[0] > best[0]
        best = [where(better, new, old) for new, old in zip(here, best, strict=True)]
    score, *flat = best
    q = [scalar.arc(s, c) for s, c in zip(flat[::2], flat[1::2], strict=True)]
    none = (score < -40.0) & (rival < -40.0)
    return wrapped(chain, q), where(none, 0.0, where(rival + 1e-6 > score, -1.0, 1.0))


def wrapped(chain: Chain, q: Sequence[Scalar]) -> list[Scalar]:
    """Angles in (-pi, pi], or one turn off where only that is within the limits (``Chain.wrapped``)."""
    turn, told = 2 * math.pi, []
    for x, low, high in zip(q, chain.lower.tolist(), chain.upper.tolist(), strict=True):
        x = scalar.arc(scalar.sin(x), scalar.cos(x))
        if high > math.pi:
            x = where((x < low) & (x + turn <= high), x + turn, x)
        if low < -math.pi:
            x = where((x > high) & (x - turn >= low), x - turn, x)
        told.append(x)
    return told


def gap(chain: Chain, q: Sequence[Scalar], target: Pose, pose: bool = True) -> Scalar:
    """What lacks to a pose [m and rad, norm] or to its position; small angles by their chord."""
    D = AT_REST
    for screw, x in zip(chain.screws, q, strict=True):
        D = advance(D, screw, x)
    miss = D @ chain.tip.p - target.p
    if not pose:
        return scalar.sqrt(dot(miss, miss))
    R = D.R @ chain.tip.R
    columns = zip((R.x, R.y, R.z), (target.R.x, target.R.y, target.R.z), strict=True)
    chord = sum(dot(a - b, a - b) for a, b in columns) * 0.5
    return scalar.sqrt(chord + dot(miss, miss))


def limb_determinant(robot: Robot, chain: Chain, q: Sequence[Scalar]) -> Scalar:
    """Determinant of a limb's screws, with velocities divided by its length (``limb_rates``)."""
    split = split_of(chain)
    twists = seen_screws(chain, split, q, best_link(robot, chain.limb))
    if len(twists) == 3:
        return point_rates(twists, ZERO, chain.length)[1]
    return pose_rates(twists, split, NO_TWIST, chain.length)[1]
