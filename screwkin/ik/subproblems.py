"""Turns about known axes that take known vectors where they belong: the bricks of every closed-form limb.

Formulas on any scalar. Where a wanted place is out of reach the turn that comes nearest is given.

Source: Paden (1986), Kahan; in the form of Elias and Wen (2025), "IK-Geo", for axes of any directions.
"""

from __future__ import annotations

from screwkin.algebra.scalar import (
    Scalar,
    arc,
    atan2,
    is_symbolic,
    larger,
    least,
    minus,
    plus,
    root,
    sqrt,
    times,
    where,
)
from screwkin.algebra.se3 import Rotation, Vector, cross, dot, rotate


def turn_onto(s: Vector, a: Vector, b: Vector) -> Scalar:
    """Angle about the unit vector s that takes a nearest to b."""
    return atan2(dot(s, cross(a, b)), minus(dot(a, b), times(dot(s, a), dot(s, b))))


def level_turns(s: Vector, a: Vector, m: Vector, level: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """The two angles about s at which a, turned, has the scalar product ``level`` with m, and their slack.

    The slack says how far inside reach they are: 1 at best, 0 where both angles are one or none is
    determined, negative out of reach, where both are the angle of the largest or smallest product.
    """
    fixed = times(dot(m, s), dot(s, a))
    along, across, wanted = minus(dot(m, a), fixed), dot(m, cross(s, a)), minus(level, fixed)
    size = sqrt(plus(times(along, along), times(across, across)))
    square, whole = times(minus(size, wanted), plus(size, wanted)), times(dot(a, a), dot(m, m))
    if is_symbolic(square):
        middle, aside = atan2(across, along), atan2(root(square), wanted)
        return middle + aside, middle - aside, square / whole
    inverse = 1 / where(size > 0, size, 1.0)  # both points are so far from the origin
    middle = arc(across * inverse, where(size > 0, along * inverse, 1.0))
    aside = arc(root(square) * inverse, larger(least(wanted * inverse, 1.0), -1.0))
    return middle + aside, middle - aside, square / where(whole > 0, whole, 1.0)


def two_turns(s1: Vector, s2: Vector, a: Vector, b: Vector) -> list[tuple[Scalar, Scalar, Scalar]]:
    """Both pairs of angles with R(s1) R(s2) a = b, for vectors of one length, and their slack."""
    *seconds, slack = level_turns(s2, a, s1, dot(s1, b))
    return [(turn_onto(s1, rotate(s2, second) @ a, b), second, slack) for second in seconds]


def three_turns(
    s1: Vector, s2: Vector, s3: Vector, R: Rotation
) -> list[tuple[Scalar, Scalar, Scalar, Scalar]]:
    """Both triples of angles with R(s1) R(s2) R(s3) = R, neighbouring axes not parallel, and their slack.

    Where s1 and the turned s3 fall together only the sum or difference of first and third is determined.
    """
    triples = []
    for first, second, slack in two_turns(s1, s2, s3, R @ s3):
        rest = (rotate(s1, first) @ rotate(s2, second)).T @ R
        triples.append((first, second, turn_onto(s3, s2, rest @ s2), slack))
    return triples
