"""Joint rates of one limb from the motion of its tip, by reciprocal screws where the geometry allows.

Three axes of a limb that meet in a point do no work on forces through it; three parallel ones none on
moments across them nor on a force along them. So expressed, the other three joints are one system of three
equations and the three themselves another: two Cramer's rules instead of an elimination with pivots, and
formulas on any scalar. A limb without such axes is solved by orthogonal columns, without pivots either.

Source: Davies' method (paper A, eq. 10-11) block by block; reciprocal screws after Hunt (1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from screwkin.algebra.linear import cramer, orthogonal
from screwkin.algebra.scalar import Scalar, minus, times
from screwkin.algebra.se3 import Twist, Vector, dot
from screwkin.kinematics.axis_geometry import meeting, parallel
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.scaling import weighed


@dataclass(frozen=True)
class Split:
    """Three neighbouring axes from joint ``first`` on: meeting in ``point``, or parallel (zero pose)."""

    kind: Literal["meeting", "parallel"]
    first: int
    point: Vector

    @property
    def three(self) -> range:
        """Indices of the three joints."""
        return range(self.first, self.first + 3)


def split_of(chain: SerialChain) -> Split | None:
    """The split of a six-joint limb; None if no three neighbouring axes meet or are parallel."""
    if len(chain.screws) != 6 or not chain.turning.all():
        return None
    for k in range(4):
        point = meeting(chain, range(k, k + 3))
        if point is not None:
            return Split("meeting", k, point)
    for k in range(4):
        if parallel(chain, k, k + 1) and parallel(chain, k + 1, k + 2):
            return Split("parallel", k, chain.screws[k].s0)
    return None


def pose_rates(
    twists: Sequence[Twist], split: Split | None, wanted: Twist, length: float
) -> tuple[list[Scalar], Scalar]:
    """Rates of six joints whose screws add up to the wanted twist.

    Args:
        twists: the joints' screws, expressed at the split's point (or any point near the limb), any axes.
        split: of the limb, from ``split_of``.
        wanted: twist of the tip relative to the base, expressed likewise.
        length: of the limb [m]: it weighs velocities against angular ones.

    Returns:
        The six rates, and the determinant of the screws with velocities divided by ``length``.
    """
    if split is None:
        return orthogonal([weighed(t, length) for t in twists], weighed(wanted, length))
    three = list(split.three)
    others = [i for i in range(6) if i not in three]
    axis = twists[three[0]].omega

    def outer(t: Twist) -> Vector:
        """What the three cannot do: move the meeting point, or turn and move across their plane."""
        if split.kind == "meeting":
            return t.v / length
        return t.omega + axis * minus(dot(axis, t.v) / length, dot(axis, t.omega))

    def inner(t: Twist) -> Vector:
        """What only the three are left to do."""
        if split.kind == "meeting":
            return t.omega
        return t.v / length + axis * minus(dot(axis, t.omega), dot(axis, t.v) / length)

    rates, first = cramer([outer(twists[i]) for i in others], outer(wanted))
    for i, rate in zip(others, rates, strict=True):
        wanted = wanted - twists[i] * rate
    own, second = cramer([inner(twists[i]) for i in three], inner(wanted))
    rate_of = dict(zip([*others, *three], [*rates, *own], strict=True))
    return [rate_of[i] for i in range(6)], times(first, second)


def point_rates(twists: Sequence[Twist], wanted: Vector, length: float) -> tuple[list[Scalar], Scalar]:
    """Rates of three joints, screws expressed at a point, that move it as wanted; and their determinant."""
    return cramer([t.v / length for t in twists], wanted / length)
