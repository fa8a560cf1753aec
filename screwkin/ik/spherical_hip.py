"""Closed form of a limb whose first three axes meet in a point: Pieper's case.

Where the other three take the hip, as the foot sees it, gives their angles, and what turn is left is the
hip's. At most eight branches, whatever the directions and order of the axes.

Source: Pieper (1968).
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar, least
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Vector, rotate
from screwkin.ik.family import Formulas
from screwkin.ik.point_turns import PointTurns, point_turns
from screwkin.ik.subproblems import three_turns
from screwkin.kinematics.axis_geometry import joint_list, meeting, parallel
from screwkin.kinematics.serial_chain import SerialChain


def recognise(chain: SerialChain) -> Formulas | list[str]:
    """The branches of a chain with a spherical hip, or why there are none."""
    faults = [
        f"the axes of {joint_list(chain, pair)} are parallel"
        for pair in ((0, 1), (1, 2))
        if parallel(chain, *pair)
    ]
    if faults:
        return faults
    hip = meeting(chain, (0, 1, 2))
    if hip is None:
        return [f"the axes of {joint_list(chain, (0, 1, 2))} do not meet in a point"]
    turns = point_turns(chain, (3, 4, 5), hip)
    if isinstance(turns, str):
        return [turns]
    return Formulas(lambda D: spherical_hip_branches(chain.screws, hip, turns, D))


def spherical_hip_branches(
    screws: Sequence[Screw], hip: Vector, turns: PointTurns, D: Pose
) -> list[tuple[Scalar, ...]]:
    """All eight sets of joint positions that displace the tip link by D from its zero pose.

    Args:
        screws: six revolute axes in the zero pose; the first three through ``hip``.
        hip: point [m].
        turns: of the last three joints, which take a point to the hip.
        D: wanted displacement; out of reach, the limb is stretched (or folded) towards it.

    Returns:
        Six angles a set, and how far inside reach it is (see ``subproblems.level_turns``).
    """
    s1, s2, s3, s4, s5, s6 = (screw.s for screw in screws)
    branches = []
    for q4, q5, q6, reach in turns(D.inverse @ hip):
        foot = rotate(s4, q4) @ rotate(s5, q5) @ rotate(s6, q6)
        for q1, q2, q3, slack in three_turns(s1, s2, s3, D.R @ foot.T):
            branches.append((q1, q2, q3, q4, q5, q6, least(reach, slack)))
    return branches
