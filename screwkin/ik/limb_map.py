"""Program of workspace maps: how a limb puts its tip at a point with the orientation of the zero pose.

The tip's orientation is a constant, so it folds away; of all branches of the closed form one is chosen, and
only of that one the conditioning is computed. What rounding could decide is not certified; ``ik.reach``
then falls back on other solvers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from screwkin.algebra import scalar
from screwkin.algebra.scalar import Scalar, abs_, larger, where
from screwkin.algebra.screws import Screw, carry
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, dot
from screwkin.algebra.singular_values import TRUSTED, Extremes, extreme_singular_values
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier
from screwkin.ik.closed import closed_form
from screwkin.ik.rank import cosines, wrapped_angles
from screwkin.kinematics.limits import beyond
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.limb_motion import displacements_seen_from
from screwkin.model.robot import Robot

CLEAR = 1e-7
"""Slack of a branch from which its sign alone decides whether it is a solution."""
NEAR = 1e-7
"""Angles [rad] closer to a limit, or to each other where the larger decides, are not certified."""
ALIKE = 1e-9
"""Difference of the sums of (1 - cos) below which two branches are equally near to the guess."""
WELL = 1e-3
"""Inverse condition number below which a sample is not certified: its solution needs polishing."""
ERROR = 1e-10
"""Error of a solution [m and rad, norm], over the inverse condition number, that counts as rounding."""
INSIDE, OUTSIDE = 50.0, -50.0
"""Above and below these stand the keys of branches inside the limits, and of those that are no solutions."""
FAR = 40.0
"""An angle beyond all others [rad]; a joint without limits lies so far inside."""
LIMITS = 2.0
"""First cause that is a limit, two for every joint."""


@dataclass(frozen=True)
class _Branch:
    """A branch: its angles, how good a choice it is, and the limit that it violates most.

    Attributes:
        q: angles inside (-pi, pi], or one turn off.
        key: the larger, the better: inside the limits above 50, the nearest to the guess best; then the
            least beyond the limits; below -50 where it is no solution.
        cause: 0 inside the limits, 1 no solution, then lower and upper limit of every joint.
        clear: condition: rounding decides neither whether it is a solution nor if it is inside.
    """

    q: Sequence[Scalar]
    key: Scalar
    cause: Scalar
    clear: Scalar


@kept
def limb_map(robot: Robot, limb: str, guess: tuple[float, ...], length: float) -> Program:
    """Program: what decides whether a limb reaches a point, and how well it is conditioned there.

    Args:
        robot: the robot.
        limb: one with a closed form.
        guess: joint positions; of the solutions inside the limits the nearest is taken.
        length: by which velocities are divided in the condition number [m].
    """
    chain = SerialChain.of(robot, limb)
    recorder = Recorder(
        identifier(robot.name, chain.limb, "map"),
        f"Where {chain.limb} of {robot.name} puts its tip at a point of the base frame, oriented as in the"
        " zero pose. cause: 0 reached, 1 out of reach, then lower and upper limit of every joint; inverse:"
        " inverse condition number of the tip's Jacobian; certified: 1 if rounding decides nothing about"
        " cause and joint positions, and about the condition number.",
    )
    point, level = Vector(*recorder.input("point", 3)), replace(chain, tip=Pose(UNTURNED, chain.tip.p))
    target, near = Pose(UNTURNED, point), [(scalar.sin(x), scalar.cos(x)) for x in guess]
    branches = [_judged(level, branch, near) for branch in closed_form(level).formula(target)]
    best, clear = _chosen(branches)
    values, error = _conditioning(level, best.q, target, length, _best_link(level, length))
    inverse = values.least / values.largest
    inside = best.key > INSIDE
    exact = (error <= ERROR * inverse) & ((inverse >= WELL) | ~inside)
    recorder.output("cause", [best.cause])
    recorder.output("q", best.q)
    recorder.output("inverse", [inverse])
    certified = clear & _decided(level, best) & (exact | (best.key < OUTSIDE))
    flags = certified, values.error <= TRUSTED
    recorder.output("certified", [where(flag, 1.0, 0.0) for flag in flags])
    return recorder.program()


def _judged(chain: SerialChain, branch: Sequence[Scalar], near: Sequence[tuple[Scalar, Scalar]]) -> _Branch:
    """A branch (angles, slack) against the limits and the sines and cosines of the guess."""
    *angles, slack = branch
    q = wrapped_angles(chain, angles)
    excess: Scalar = -FAR
    limit: Scalar = LIMITS
    for joint, x in enumerate(q):
        here, upper = _beyond(chain, joint, x)
        worse = here > excess
        excess = where(worse, here, excess)
        limit = where(worse, where(upper, LIMITS + 2 * joint + 1, LIMITS + 2 * joint), limit)
    alike = sum(cosines(q, near))
    valid, inside = slack > 0, excess <= 0
    key = where(valid, where(inside, 2 * INSIDE + alike, -excess), 2 * OUTSIDE)
    cause = where(valid, where(inside, 0.0, limit), 1.0)
    return _Branch(q, key, cause, (abs_(slack) > CLEAR) & (~valid | (abs_(excess) > NEAR)))


def _beyond(chain: SerialChain, joint: int, x: Scalar) -> tuple[Scalar, Scalar]:
    """How far an angle lies beyond the limits of its joint, negative inside; and if beyond the upper one."""
    low, high = float(chain.lower[joint]), float(chain.upper[joint])
    if math.isinf(low) or math.isinf(high):
        unlimited = math.isinf(low) and math.isinf(high)
        return (-FAR, False) if unlimited else (beyond(x, low, high), math.isinf(low))
    return beyond(x, low, high), x > (low + high) / 2


def _chosen(branches: Sequence[_Branch]) -> tuple[_Branch, Scalar]:
    """The best branch, and a condition: no other one is as good to rounding and has another cause."""
    best, clear, second = branches[0], branches[0].clear, 4.0 * OUTSIDE
    for branch in branches[1:]:
        better = branch.key > best.key
        second = where(better, best.key, larger(branch.key, second))
        q = [where(better, new, old) for new, old in zip(branch.q, best.q, strict=True)]
        key, cause = where(better, branch.key, best.key), where(better, branch.cause, best.cause)
        best, clear = _Branch(q, key, cause, clear), clear & branch.clear
    clear &= (second < best.key - ALIKE) | (best.key < INSIDE)
    for branch in branches:
        other = (branch.cause < best.cause) | (best.cause < branch.cause)
        clear &= (branch.key < best.key - NEAR) | ~other
    return best, clear


def _decided(chain: SerialChain, best: _Branch) -> Scalar:
    """Condition: if limits cut the best branch off, one of them is clearly the worst."""
    first: Scalar = -FAR
    second: Scalar = -FAR
    for joint, x in enumerate(best.q):
        here, _ = _beyond(chain, joint, x)
        second = larger(second, where(here > first, first, here))
        first = larger(first, here)
    return (second < first - NEAR) | (best.cause < LIMITS)


def _conditioning(
    chain: SerialChain, q: Sequence[Scalar], target: Pose, length: float, link: int
) -> tuple[Extremes, Scalar]:
    """Singular values of the tip's Jacobian in the axes of a link, and the residual of the tip's pose."""
    seen = displacements_seen_from(chain.screws, q, link)
    tip, wanted = seen[-1] @ chain.tip.p, seen[0] @ target.p
    columns = []
    for place, screw in zip(seen, chain.screws, strict=False):
        moved = carry(place, screw)
        twist = Screw(moved.s, moved.s0 - tip, moved.pitch).twist
        columns.append([*twist.omega, *(x / length for x in twist.v)])
    here, there = seen[-1].R, seen[0].R @ target.R
    axes = zip((here.x, here.y, here.z), (there.x, there.y, there.z), strict=True)
    turn = sum(dot(a - b, a - b) for a, b in axes)
    return extreme_singular_values(columns), scalar.sqrt(turn * 0.5 + dot(tip - wanted, tip - wanted))


def _best_link(chain: SerialChain, length: float) -> int:
    """After how many joints the link stands in whose axes the singular values take least operations."""

    def cost(link: int) -> int:
        recorder = Recorder("trial", "")
        q, target = recorder.input("q", len(chain.screws)), Pose(UNTURNED, chain.tip.p)
        values, _ = _conditioning(chain, q, target, length, link)
        recorder.output("values", [values.least, values.largest, values.error])
        return recorder.program().operations

    return min(range(len(chain.screws) + 1), key=cost)
