"""Closed form of a limb whose first three axes meet in a point and whose last two do: Pieper's case.

The distance from hip to ankle gives the knee, the hip as the foot sees it gives the ankle, and what turn is
left is the hip's. At most eight branches, whatever the directions and order of the axes.

Source: Pieper (1968).
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar, least, minus, times
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Vector, dot, rotate
from screwkin.ik.family import Formulas
from screwkin.ik.subproblems import level_turns, three_turns, two_turns
from screwkin.kinematics.axis_geometry import joint_list, meeting, parallel
from screwkin.kinematics.serial_chain import SerialChain


def recognise(chain: SerialChain) -> Formulas | list[str]:
    """The branches of a chain with a spherical hip, a knee and a universal ankle, or what it lacks."""
    if faults := spherical_hip_faults(chain):
        return faults
    hip, ankle = meeting(chain, (0, 1, 2)), meeting(chain, (4, 5))
    assert hip is not None
    assert ankle is not None
    return Formulas(lambda D: spherical_hip_branches(chain.screws, hip, ankle, D))


def spherical_hip_faults(chain: SerialChain) -> list[str]:
    """What keeps the chain from being a spherical hip, knee and universal ankle."""
    faults = [
        f"the axes of {joint_list(chain, pair)} are parallel"
        for pair in ((0, 1), (1, 2), (4, 5))
        if parallel(chain, *pair)
    ]
    faults += [
        f"the axes of {joint_list(chain, joints)} do not meet in a point"
        for joints in ((0, 1, 2), (4, 5))
        if not faults and meeting(chain, joints) is None
    ]
    return faults


def spherical_hip_branches(
    screws: Sequence[Screw], hip: Vector, ankle: Vector, D: Pose
) -> list[tuple[Scalar, ...]]:
    """All eight sets of joint positions that displace the tip link by D from its zero pose.

    Args:
        screws: six revolute axes in the zero pose; the first three through ``hip``, the last two through
            ``ankle``.
        hip: point [m].
        ankle: point [m].
        D: wanted displacement; out of reach, the limb is stretched (or folded) towards it.

    Returns:
        Six angles a set, and how far inside reach it is (see ``subproblems.level_turns``).
    """
    s1, s2, s3, s4, s5, s6 = (screw.s for screw in screws)
    knee = screws[3].s0
    thigh, shank = hip - knee, ankle - knee
    seen = D.inverse @ hip - ankle
    # D4 D5 D6 takes the hip as the foot sees it to the hip: |R4^T thigh - shank| = |seen|.
    level = times(minus(dot(thigh, thigh) + dot(shank, shank), dot(seen, seen)), 0.5)
    branches = []
    *bends, reach = level_turns(s4, thigh, shank, level)
    for back in bends:
        bent = rotate(s4, back) @ thigh - shank
        for q5, q6, ankle_slack in two_turns(s5, s6, seen, bent):
            foot = rotate(s4, -back) @ rotate(s5, q5) @ rotate(s6, q6)
            for q1, q2, q3, hip_slack in three_turns(s1, s2, s3, D.R @ foot.T):
                slack = least(reach, least(ankle_slack, hip_slack))
                branches.append((q1, q2, q3, -back, q5, q6, slack))
    return branches
