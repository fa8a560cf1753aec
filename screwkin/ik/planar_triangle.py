"""Three parallel axes as a planar triangle: hip pitch, knee and ankle pitch."""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar, minus, times
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Vector, dot, rotate
from screwkin.ik.subproblems import level_turns, turn_onto


def part_across(normal: Vector, a: Vector) -> Vector:
    """The part of a in the plane with that unit normal."""
    return a - normal * dot(normal, a)


def planar_branches(screws: Sequence[Screw], E: Pose) -> list[tuple[Scalar, Scalar, Scalar, Scalar]]:
    """Both triples of positions of three parallel revolute axes that make the planar displacement E.

    The fourth scalar tells how far inside reach they are (see ``subproblems.level_turns``).

    Args:
        screws: the axes in the zero pose, no two neighbours on one line.
        E: wanted displacement; what it has out of the plane is ignored. Out of reach, the triangle is
            stretched (or folded) towards it.
    """
    hip, knee, ankle = screws
    upper = part_across(hip.s, knee.s0 - hip.s0)
    lower = part_across(hip.s, ankle.s0 - knee.s0)
    wanted = part_across(hip.s, E @ ankle.s0 - hip.s0)
    # |upper + R4 lower| = |wanted|
    level = times(minus(minus(dot(wanted, wanted), dot(upper, upper)), dot(lower, lower)), 0.5)
    branches = []
    *bends, slack = level_turns(knee.s, lower, upper, level)
    for bend in bends:
        turned = rotate(knee.s, bend)
        lift = turn_onto(hip.s, upper + turned @ lower, wanted)
        rest = (rotate(hip.s, lift) @ turned).T @ E.R
        branches.append((lift, bend, turn_onto(ankle.s, upper, rest @ upper), slack))
    return branches
