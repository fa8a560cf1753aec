"""Where an offset hip can hold the parallel axes of a leg: three equations and one quartic.

The direction n of the parallel axes obeys three linear equations, whose coefficients turn with the first
joint only: seen from joint 2, it keeps its angle to that axis; seen from the foot, to the last axis; and no
motion about it changes where the last axis lies along it. That n is a unit vector is then one quartic in
tan(q1/2), whether axes meet or not.

Source: derived here; it is the subproblem 6 of Elias and Wen (2025), "IK-Geo", by one direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from screwkin.algebra.scalar import Scalar, minus, plus, root, times, where
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Vector, cross, dot, norm, record


@record
class Turning:
    """A vector that turns with an angle x:  fixed + cos x * along + sin x * across."""

    fixed: Vector
    along: Vector
    across: Vector

    def at(self, c: Scalar, s: Scalar) -> Vector:
        """The vector at the angle with that cosine and sine."""
        return self.fixed + self.along * c + self.across * s

    def slope(self, c: Scalar, s: Scalar) -> Vector:
        """Its derivative by the angle."""
        return self.across * c - self.along * s

    def through(self, linear: Any) -> Turning:
        """A linear map of it."""
        return Turning(linear(self.fixed), linear(self.along), linear(self.across))


def turning(s: Vector, a: Vector) -> Turning:
    """The vector a turned about the unit vector s."""
    fixed = s * dot(s, a)
    return Turning(fixed, a - fixed, cross(s, a))


@record
class HipEquations:
    """``axis . n = level``, ``reach . n = offset``, ``ankle . n = tilt`` for the parallel axes' direction n.

    ``axis`` (of joint 2) and ``reach`` (from it to the foot's last axis) turn with the first joint.
    """

    axis: Turning
    level: Scalar
    reach: Turning
    offset: Scalar
    ankle: Vector
    tilt: Scalar

    @classmethod
    def of(cls, screws: Sequence[Screw], D: Pose) -> HipEquations:
        """The equations of a limb that displaces its tip link by D."""
        first, second, pitch, last = screws[0], screws[1], screws[2], screws[5]
        offset_hip = turning(first.s, second.s0 - first.s0)
        foot = D @ last.s0 - first.s0
        return cls(
            turning(first.s, second.s),
            dot(second.s, pitch.s),
            Turning(foot - offset_hip.fixed, -offset_hip.along, -offset_hip.across),
            dot(pitch.s, last.s0 - second.s0),
            D.R @ last.s,
            dot(last.s, pitch.s),
        )

    def solution(self) -> tuple[Turning, list[Scalar]]:
        """N and d with n = N/d: Cramer's rule for the three equations.

        N = level (reach x ankle) + offset (ankle x axis) + tilt (axis x reach), d = ankle . (axis x reach).
        In axis x reach the hip's own part turns rigidly: both are of first degree in cos q1 and sin q1.
        """
        axis, reach = self.axis, self.reach
        plane = Turning(
            # along x along = across x across, and along x across = -across x along: no second degree is left
            cross(axis.fixed, reach.fixed) + cross(axis.across, reach.across),
            cross(axis.fixed, reach.along) + cross(axis.along, reach.fixed),
            cross(axis.fixed, reach.across) + cross(axis.across, reach.fixed),
        )
        N = _sum(
            reach.through(lambda v: cross(v, self.ankle) * self.level),
            axis.through(lambda v: cross(self.ankle, v) * self.offset),
            plane.through(lambda v: v * self.tilt),
        )
        return N, [dot(self.ankle, v) for v in (plane.fixed, plane.along, plane.across)]

    def quartic(self) -> tuple[Scalar, ...]:
        """Coefficients of 1, cos q1, sin q1, cos 2 q1, sin 2 q1 of |N|^2 - d^2, zero where |n| = 1."""
        return unit_quartic(*self.solution())


def unit_quartic(N: Turning, d: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Coefficients of 1, cos x, sin x, cos 2x, sin 2x of |N|^2 - d^2, for d = d0 + d1 cos x + d2 sin x."""
    one = minus(dot(N.fixed, N.fixed), times(d[0], d[0]))
    cosine = times(2, minus(dot(N.fixed, N.along), times(d[0], d[1])))
    sine = times(2, minus(dot(N.fixed, N.across), times(d[0], d[2])))
    cosine2 = minus(dot(N.along, N.along), times(d[1], d[1]))
    sine2 = minus(dot(N.across, N.across), times(d[2], d[2]))
    mixed = minus(dot(N.along, N.across), times(d[1], d[2]))
    mean, difference = plus(cosine2, sine2) / 2, minus(cosine2, sine2) / 2
    return plus(one, mean), cosine, sine, difference, mixed


def _sum(a: Turning, b: Turning, c: Turning) -> Turning:
    return Turning(a.fixed + b.fixed + c.fixed, a.along + b.along + c.along, a.across + b.across + c.across)


def pitch_directions(equations: HipEquations, c: Scalar, s: Scalar) -> list[Vector]:
    """The two unit vectors that obey the best conditioned two of the three equations, where q1 is known."""
    axis, ankle = equations.axis.at(c, s), equations.ankle
    reach, offset = equations.reach.at(c, s), equations.offset
    size = norm(reach)
    size = where(size > 0, size, 1.0)
    reach, offset = reach / size, offset / size
    pairs = [
        (axis, equations.level, ankle, equations.tilt),
        (reach, offset, ankle, equations.tilt),
        (axis, equations.level, reach, offset),
    ]
    solutions = [_on_two_cones(*pair) for pair in pairs]
    weight, *best = solutions[0]
    for other, *found in solutions[1:]:
        better = other > weight
        weight = where(better, other, weight)
        best = [chosen(better, new, old) for new, old in zip(found, best, strict=True)]
    return best


def _on_two_cones(a: Vector, alpha: Scalar, b: Vector, beta: Scalar) -> tuple[Scalar, Vector, Vector]:
    """Squared sine between unit vectors a and b; both unit n with a . n = alpha and b . n = beta."""
    between = dot(a, b)
    square = minus(1, times(between, between))
    safe = where(square > 1e-300, square, 1.0)
    within = a * ((alpha - times(between, beta)) / safe) + b * ((beta - times(between, alpha)) / safe)
    rest = 1 - dot(within, within)
    out = cross(a, b) * root(rest / safe)
    return square, within + out, within - out


def chosen(condition: Any, a: Vector, b: Vector) -> Vector:
    """a where the condition holds, else b."""
    return Vector(*(where(condition, x, y) for x, y in zip(a, b, strict=True)))
