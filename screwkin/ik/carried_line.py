"""A line, and a point on it, as fourteen numbers that every rigid displacement transforms linearly.

So a joint's displacement is of first degree in the cosine and sine of its angle: what chains make of a line
is a table of coefficients of products of sines and cosines, and angles can be eliminated by linear algebra.

Source: the fourteen equations of Raghavan and Roth (1993), here without Denavit-Hartenberg frames.
"""

from __future__ import annotations

from collections.abc import Callable

from screwkin.algebra.scalar import Scalar, plus, times
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Rotation, Vector, cross, dot, record


@record
class CarriedLine:
    """A unit direction l through a point p, or one coefficient of such a table.

    Attributes:
        one: 1; of the coefficients of sines and cosines 0.
        p: point.
        l: direction.
        moment: p x l.
        image: (p . p) l - 2 (p . l) p.
        square: p . p.
        along: p . l.
    """

    one: Scalar
    p: Vector
    l: Vector  # noqa: E741
    moment: Vector
    image: Vector
    square: Scalar
    along: Scalar

    @classmethod
    def of(cls, screw: Screw) -> CarriedLine:
        """The axis of a screw, through its s0."""
        p, s = screw.s0, screw.s
        square, along = dot(p, p), dot(p, s)
        return cls(1, p, s, cross(p, s), s * square - p * times(2, along), square, along)

    def shifted(self, a: Vector) -> CarriedLine:
        """Moved by a vector."""
        turned = cross(a, self.l)
        image = self.image + self.l * dot(a, a) - a * times(2, plus(dot(a, self.l), self.along))
        return CarriedLine(
            self.one,
            self.p + a * self.one,
            self.l,
            self.moment + turned,
            image - cross(a, self.moment) * 2,
            plus(self.square, plus(times(2, dot(a, self.p)), times(self.one, dot(a, a)))),
            plus(self.along, dot(a, self.l)),
        )

    def turned(self, R: Rotation) -> CarriedLine:
        """Rotated about the origin."""
        return self._by(lambda v: R @ v, 1)

    def _by(self, linear: Callable[[Vector], Vector], scalars: int) -> CarriedLine:
        """A linear map of the vectors; the scalars are those of the line (1), or gone (0)."""
        return CarriedLine(
            times(self.one, scalars),
            linear(self.p),
            linear(self.l),
            linear(self.moment),
            linear(self.image),
            times(self.square, scalars),
            times(self.along, scalars),
        )

    def displaced(self, D: Pose) -> CarriedLine:
        """Moved by a rigid displacement."""
        return self.turned(D.R).shifted(D.p)

    def rotating(self, screw: Screw) -> list[CarriedLine]:
        """Coefficients of 1, cos x and sin x when it turns about a screw's axis by x."""
        here, s = self.shifted(-screw.s0), screw.s
        fixed = here._by(lambda v: s * dot(s, v), 1)
        level = here._by(lambda v: v - s * dot(s, v), 0)
        across = here._by(lambda v: cross(s, v), 0)
        return [part.shifted(screw.s0) for part in (fixed, level, across)]


def numbers(line: CarriedLine) -> list[Scalar]:
    """The fourteen numbers: x and y of four vectors, then their z, then the scalars."""
    vectors = line.p, line.l, line.moment, line.image
    pairs = [x for v in vectors for x in (v.x, v.y)]
    return [*pairs, *(v.z for v in vectors), line.square, line.along]
