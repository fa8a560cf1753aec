"""Three turns that take a point to its place: knee and ankle of a limb with a spherical hip.

The last turn moves the point on a circle, from another circle the first one takes points to the place, and
the middle one joins points that lie equally high along its axis and equally far from it. Both conditions are
linear in cosine and sine of the two outer angles: one quartic; or, where neighbouring axes meet or are
parallel, one angle after the other. At most four ways.

Source: Pieper (1968); subproblem 5 of Elias and Wen (2025), "IK-Geo", here for axes of any directions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from screwkin.algebra.quartic import circle_points
from screwkin.algebra.scalar import Scalar, atan2, least, minus, plus, times
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Vector, cross, dot, norm, rotate
from screwkin.ik.hip_equations import Turning, turning, unit_quartic
from screwkin.ik.subproblems import level_turns, turn_onto
from screwkin.kinematics.axis_geometry import ALIKE, apart, joint_list, meeting, parallel
from screwkin.kinematics.serial_chain import SerialChain

Way = tuple[Scalar, Scalar, Scalar, Scalar]
"""Three angles and their slack: negative out of reach, near 0 where two ways nearly fall together."""
PointTurns = Callable[[Vector], list[Way]]
"""From a point to the four ways in which three turns take it to its place."""
Screws = tuple[Screw, Screw, Screw]
SKEW = 1e-3
"""Distance of axes times the sine of their angle, over the limb's length, from which the quartic serves.

Below it roots come in pairs that nearly fall together.
"""


def point_turns(chain: SerialChain, joints: tuple[int, int, int], place: Vector) -> PointTurns | str:
    """How three neighbouring joints of a chain take points to a place.

    Args:
        chain: of the limb.
        joints: their numbers.
        place: where the points belong [m].

    Returns:
        A function on any scalar, or why there is none.
    """
    first, middle, last = (chain.screws[k] for k in joints)
    start, end = joints[:2], joints[1:]
    for pair in (start, end):
        if parallel(chain, *pair) and apart(chain, *pair) <= ALIKE * chain.length:
            return f"the axes of {joint_list(chain, pair)} fall together"
    if parallel(chain, *start) and parallel(chain, *end):
        return f"the axes of {joint_list(chain, joints)} are parallel"
    forth, back = (first, middle, last), (_back(last), _back(middle), _back(first))
    meet = meeting(chain, end)
    if meet is not None or parallel(chain, *end):
        return lambda point: _one_by_one(forth, meet, point, place)
    meet = meeting(chain, start)
    if meet is not None or parallel(chain, *start):
        return lambda point: _swapped(_one_by_one(back, meet, place, point))
    if norm(cross(first.s, place - first.s0)) <= ALIKE * chain.length:
        return f"the axis of {chain.names[joints[0]]} meets them in that point too"
    if max(skew := [_skew(middle, other) / chain.length for other in (first, last)]) < SKEW:
        return f"two axes of {joint_list(chain, joints)} nearly meet or are nearly parallel"
    if skew[0] > skew[1]:
        return lambda point: _swapped(_by_quartic(back, place, point))
    return lambda point: _by_quartic(forth, point, place)


def _back(screw: Screw) -> Screw:
    return Screw(-screw.s, screw.s0)


def _skew(a: Screw, b: Screw) -> float:
    return abs(float(dot(cross(a.s, b.s), b.s0 - a.s0)))


def _swapped(ways: Sequence[Way]) -> list[Way]:
    return [(q1, q2, q3, slack) for q3, q2, q1, slack in ways]


def _one_by_one(screws: Screws, meet: Vector | None, point: Vector, place: Vector) -> list[Way]:
    """The ways where the last two axes meet in a point, or are parallel (None).

    The last two turns change neither the distance from where their axes meet, nor the height along parallel
    ones, which gives the first angle.
    """
    first, middle, last = screws
    thigh, other = place - first.s0, first.s0 - middle.s0
    if meet is None:
        shank, side, aside = middle.s, last.s0 - middle.s0, point - last.s0
        level = dot(middle.s, point - first.s0)
    else:
        shank, side, aside = meet - first.s0, middle.s, point - meet
        level = times(minus(dot(thigh, thigh) + dot(shank, shank), dot(aside, aside)), 0.5)
    ways = []
    *bends, reach = level_turns(first.s, thigh, shank, level)
    for bend in bends:
        if meet is None:
            bent = rotate(first.s, bend) @ thigh + other
            level = times(minus(dot(bent, bent), dot(aside, aside) + dot(side, side)), 0.5)
        else:
            bent = rotate(first.s, bend) @ thigh - shank
            level = dot(side, bent)
        *turns, slack = level_turns(last.s, aside, side, level)
        for turn in turns:
            turned = rotate(last.s, turn) @ aside
            turned = turned + side if meet is None else turned
            ways.append((-bend, turn_onto(middle.s, turned, bent), turn, least(reach, slack)))
    return ways


def _by_quartic(screws: Screws, point: Vector, place: Vector) -> list[Way]:
    """The ways where the last two axes are skew."""
    first, middle, last = screws
    s, near, far = middle.s, first.s0 - middle.s0, last.s0 - middle.s0
    thigh, foot = place - first.s0, point - last.s0
    a, b = turning(-first.s, thigh), turning(last.s, foot)
    squares = minus(dot(thigh, thigh) + dot(near, near), dot(foot, foot) + dot(far, far))
    gap = Vector(
        plus(dot(s, near + a.fixed), -dot(s, far + b.fixed)),
        plus(dot(near, a.fixed) - dot(far, b.fixed), times(squares, 0.5)),
        0,
    )
    known = Turning(gap, *(Vector(dot(s, v), dot(near, v), 0) for v in (a.along, a.across)))
    (m11, m21), (m12, m22) = ((dot(s, v), dot(far, v)) for v in (b.along, b.across))
    solved = known.through(lambda v: Vector(m22 * v.x - m12 * v.y, m11 * v.y - m21 * v.x, 0))
    size = m11 * m22 - m12 * m21
    ways = []
    for root in circle_points(unit_quartic(solved, (size, 0, 0))):
        turn = solved.at(root.c, root.s) * size
        q6 = atan2(turn.y, turn.x)
        q5 = turn_onto(s, far + rotate(last.s, q6) @ foot, near + a.at(root.c, root.s))
        ways.append((atan2(root.s, root.c), q5, q6, root.slack))
    return ways
