"""All positions of six revolute joints of any geometry: elimination in one of them.

With one joint given, the line of the axis three joints further on is what the two joints between make of it,
and also what the other two and the target make of it: fourteen linear equations in products of sines and
cosines (``carried_line``). Eight products are eliminated by constants of the limb; of the six equations left,
and these times one half-angle's tangent, the determinant vanishes where there is a solution. On the circle of
the given joint it is a trigonometric polynomial of degree 8: at most sixteen branches.

Source: Raghavan and Roth (1993), Manocha and Canny (1994); here the eliminated products are those of constant
coefficients, and the polynomial's zeros are sought on the circle, where all real ones lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.linear import determinant, null_vector, product
from screwkin.algebra.scalar import Scalar, atan2, minus, plus, structural, times
from screwkin.algebra.screws import Screw, carry, displacement
from screwkin.algebra.se3 import Pose, Rotation, Vector, cross, norm
from screwkin.ik.carried_line import CarriedLine, numbers
from screwkin.ik.subproblems import turn_onto
from screwkin.kinematics.serial_chain import SerialChain, per_chain

BRANCHES = 16
"""Largest number of solutions of six revolute joints (Primrose 1986)."""
ANGLES = 17
"""Values that determine the polynomial."""
PAIRS = 4
"""Vectors among a line's numbers, each with a pair of numbers across the axis of the given joint."""


@dataclass(frozen=True, eq=False)
class Elimination:
    """How a limb is solved.

    Attributes:
        chain: of the limb.
        backwards: it is walked from its tip.
        given: number of the joint in which is eliminated, as the chain is walked; 0 to 2.
        frame: on that joint's axis, z along it; lengths are divided by the limb's.
        screws: as the chain is walked, in that frame.
        null: (6, 14) combinations of a line's numbers that the next two joints cannot change.
        angles: (4, 14) cosine and sine of these two joints from such numbers.
        offset: (14,) their numbers' constant part.
        conditioning: least over largest singular value of what ``angles`` inverts; 0 where the line leaves
            these two joints open.
    """

    chain: SerialChain
    backwards: bool
    given: int
    frame: Pose
    screws: tuple[Screw, ...]
    null: Array
    angles: Array
    offset: Array
    conditioning: float

    @property
    def joint(self) -> int:
        """The joint in which is eliminated, by its number in the chain."""
        return 5 - self.given if self.backwards else self.given

    def displacement(self, target: Pose) -> Pose:
        """How far the last link is displaced as the chain is walked, in the frame of the elimination."""
        D = target @ self.chain.tip.inverse
        D = self.frame.inverse @ (D.inverse if self.backwards else D) @ self.frame
        return Pose(D.R, D.p / self.chain.length)

    def table(self, D: Pose) -> list[list[Scalar]]:
        """Three matrices (6, 9), row by row: coefficients of 1, cosine and sine of the given joint.

        Their columns are the powers of the tangents of two half-angles, see ``others``: those of the second
        one run faster.
        """
        v = self.given
        lines = [CarriedLine.of(self.screws[v + 3])]
        for step in self._others_and_target():
            if step is None:
                lines = [line.displaced(D) for line in lines]
            else:
                lines = [part for line in lines for part in line.rotating(_back(self.screws[step]))]
        columns = [numbers(line) for line in lines]
        null = [[float(x) for x in row] for row in self.null]
        constant = [[product(row[2 * PAIRS :], c[2 * PAIRS :]) for c in columns] for row in null]
        for row, out in zip(null, constant, strict=True):
            out[0] = minus(out[0], float(product(row, self.offset.tolist())))
        cosine = [[product(row[: 2 * PAIRS], c[: 2 * PAIRS]) for c in columns] for row in null]
        crossed = [[x for k in range(PAIRS) for x in (-row[2 * k + 1], row[2 * k])] for row in null]
        sine = [[product(row, c[: 2 * PAIRS]) for c in columns] for row in crossed]
        return [[x for row in part for x in _in_tangents(row)] for part in (constant, cosine, sine)]

    def _others_and_target(self) -> list[int | None]:
        """What the line is carried by on the far side: the two other joints, and the target (None)."""
        v = self.given
        return [*range(v + 4, 6), None, *range(v)]

    @property
    def others(self) -> tuple[int, int]:
        """The joints whose half-angles' tangents the table is in."""
        first, second = (k for k in self._others_and_target() if k is not None)
        return first, second

    def branch(self, D: Pose, c: Scalar, s: Scalar, table: Sequence[Scalar]) -> list[Scalar]:
        """The six angles, in the chain's order.

        Args:
            D: from ``displacement``.
            c: cosine of the given joint, a zero of the determinant.
            s: sine.
            table: the three matrices of ``table`` for that target, one after the other.
        """
        v = self.given
        fixed, cosine, sine = table[:54], table[54:108], table[108:]
        matrix = [k + c * a + s * b for k, a, b in zip(fixed, cosine, sine, strict=True)]
        null = null_vector(dialytic(matrix))
        first = _half_angle([null[3 * i : 3 * i + 3] for i in range(4)])
        second = _half_angle([null[j::3] for j in range(3)])
        q: dict[int, Scalar] = dict(zip(self.others, (first, second), strict=True))
        far = D
        before = [displacement(_back(self.screws[k]), q[k]) for k in range(v)]
        behind = [displacement(_back(self.screws[k]), q[k]) for k in range(v + 4, 6)]
        for step in behind[::-1]:
            far = far @ step
        for step in before:
            far = step @ far
        seen = numbers(CarriedLine.of(carry(far, self.screws[v + 3])))
        turned = [x for k in range(PAIRS) for x in _turned_back(c, s, seen[2 * k], seen[2 * k + 1])]
        apart = [
            minus(x, y) for x, y in zip([*turned, *seen[2 * PAIRS :]], self.offset.tolist(), strict=True)
        ]
        c1, s1, c2, s2 = (product([float(x) for x in row], apart) for row in self.angles)
        q |= {v: atan2(s, c), v + 1: atan2(s1, c1), v + 2: atan2(s2, c2)}
        near = displacement(self.screws[v], q[v]).R
        for k in (v + 1, v + 2):
            near = near @ displacement(self.screws[k], q[k]).R
        last = self.screws[v + 3].s
        aside = _across(last)
        q[v + 3] = turn_onto(last, aside, near.T @ (far.R @ aside))
        return [q[k] for k in (range(5, -1, -1) if self.backwards else range(6))]


def dialytic(table: Sequence[Scalar]) -> list[list[Scalar]]:
    """The matrix (12, 12) of six equations (6, 9), and of these times the first tangent."""
    rows = [list(table[k : k + 9]) for k in range(0, 54, 9)]
    return [[*row, 0, 0, 0] for row in rows] + [[0, 0, 0, *row] for row in rows]


def vanishing(table: Sequence[Scalar]) -> Scalar:
    """What vanishes where the given joint has the angle of a solution, for its matrix (6, 9)."""
    return determinant(dialytic(table))


def _back(screw: Screw) -> Screw:
    return Screw(-screw.s, screw.s0)


def _turned_back(c: Scalar, s: Scalar, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
    return plus(times(c, x), times(s, y)), minus(times(c, y), times(s, x))


def _in_tangents(row: Sequence[Scalar]) -> list[Scalar]:
    """Coefficients (9) of products of 1, cosine, sine as those of powers of half-angles' tangents."""
    rows = [_powers(*row[3 * i : 3 * i + 3]) for i in range(3)]
    columns = [_powers(*column) for column in zip(*rows, strict=True)]
    return [x for power in zip(*columns, strict=True) for x in power]


def _powers(one: Scalar, cosine: Scalar, sine: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    return plus(one, cosine), times(2, sine), minus(one, cosine)


def _half_angle(powers: Sequence[Sequence[Scalar]]) -> Scalar:
    """The angle of whose half the tangent leads from every vector to the next one."""
    low, mixed, high = (
        sum(product(a, b) for a, b in zip(one, other, strict=True))
        for one, other in (
            (powers[:-1], powers[:-1]),
            (powers[:-1], powers[1:]),
            (powers[1:], powers[1:]),
        )
    )
    return atan2(2 * mixed, low - high)


def _across(s: Vector) -> Vector:
    """A unit vector across a constant one."""
    parts = [abs(x) for x in s]
    k = parts.index(min(parts))
    aside = cross(s, Vector(*(float(i == k) for i in range(3))))
    return aside / norm(aside)


@per_chain
def eliminations(chain: SerialChain) -> tuple[Elimination, ...]:
    """The six ways to eliminate: in every joint."""
    walks = ((False, chain), (True, chain.reversed))
    return tuple(
        _elimination(chain, walked.screws, backwards, given)
        for backwards, walked in walks
        for given in (2, 1, 0)
    )


def _elimination(chain: SerialChain, walked: Sequence[Screw], backwards: bool, given: int) -> Elimination:
    axis = walked[given]
    x = _across(axis.s)
    frame = Pose(Rotation(x, cross(axis.s, x), axis.s), axis.s0)
    screws = tuple(_plain(carry(frame.inverse, screw), chain.length) for screw in walked)
    lines = [CarriedLine.of(screws[given + 3])]
    for k in (given + 2, given + 1):
        lines = [part for line in lines for part in line.rotating(screws[k])]
    table = np.array([[float(x) for x in numbers(line)] for line in lines]).T
    U, sizes, _ = np.linalg.svd(table[:, 1:])
    conditioning = float(sizes[-1] / sizes[0])
    # the first of the two joints runs faster: columns 1, 2 are its cosine and sine, columns 3, 6 the other's
    angles = np.linalg.pinv(table[:, 1:])[[0, 1, 2, 5]]
    return Elimination(chain, backwards, given, frame, screws, U[:, 8:].T, angles, table[:, 0], conditioning)


def _plain(screw: Screw, length: float) -> Screw:
    """A screw with lengths over the limb's, and what rounding leaves of zero and one as structure."""

    def plain(x: Scalar) -> Scalar:
        near = round(float(x))
        return structural(float(near) if abs(x - near) <= 1e-15 else float(x))

    return Screw(Vector(*map(plain, screw.s)), Vector(*(plain(x / length) for x in screw.s0)))
