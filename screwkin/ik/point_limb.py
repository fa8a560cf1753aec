"""Closed form of a three-joint limb that puts its tip at a point: an arm with two axes through its shoulder.

The distance from shoulder to hand gives the elbow, and two turns take the hand where it belongs: at most four
branches, whatever the directions of the axes.
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar, least, minus, times
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Vector, dot, rotate
from screwkin.ik.family import Formulas
from screwkin.ik.subproblems import level_turns, two_turns
from screwkin.kinematics.axis_geometry import joint_list, meeting, parallel
from screwkin.kinematics.serial_chain import SerialChain


def recognise(chain: SerialChain) -> Formulas | list[str]:
    """The branches of a chain whose first two axes meet in a shoulder, or why there are none."""
    if parallel(chain, 0, 1):
        return [f"the axes of {joint_list(chain, (0, 1))} are parallel"]
    shoulder = meeting(chain, (0, 1))
    if shoulder is None:
        return [f"the axes of {joint_list(chain, (0, 1))} do not meet in a point"]
    return Formulas(lambda wanted: point_branches(chain.screws, shoulder, chain.tip.p, wanted))


def point_branches(
    screws: Sequence[Screw], shoulder: Vector, tip: Vector, wanted: Vector
) -> list[tuple[Scalar, ...]]:
    """The four sets of joint positions that bring the tip to a point, with their slack.

    Args:
        screws: three revolute axes in the zero pose, the first two through ``shoulder``.
        shoulder: point [m].
        tip: in the zero pose [m].
        wanted: where the tip belongs [m]; out of reach, the limb is stretched (or folded) towards it.

    Returns:
        Three angles a set, and how far inside reach it is (see ``subproblems.level_turns``).
    """
    first, second, elbow = screws
    upper, fore, far = shoulder - elbow.s0, tip - elbow.s0, wanted - shoulder
    # |R3 fore - upper| = |far|
    level = times(minus(dot(upper, upper) + dot(fore, fore), dot(far, far)), 0.5)
    *bends, reach = level_turns(elbow.s, fore, upper, level)
    branches = []
    for bend in bends:
        arm = rotate(elbow.s, bend) @ fore - upper
        for q1, q2, slack in two_turns(first.s, second.s, arm, far):
            branches.append((q1, q2, bend, least(reach, slack)))
    return branches
