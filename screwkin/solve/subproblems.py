"""Turns about known axes that take known vectors where they belong: the bricks of every closed-form limb.

Formulas on any scalar. Where a wanted place is out of reach the turn that comes nearest is given.

Source: Paden (1986), Kahan; in the form of Elias and Wen (2025), "IK-Geo", for axes of any directions.
"""

from __future__ import annotations

from screwkin.scalar import Scalar, atan2, is_symbolic, minus, plus, sqrt, times, where
from screwkin.se3 import Rotation, Vector, cross, dot, rotate


def root(x: Scalar) -> Scalar:
    """Square root, 0 (with a finite gradient) where x is negative; of symbols the plain one."""
    if is_symbolic(x):
        return sqrt(x)
    positive = x > 0
    return where(positive, sqrt(where(positive, x, 1.0)), 0.0)


def turn_onto(s: Vector, a: Vector, b: Vector) -> Scalar:
    """Angle about the unit vector s that takes a nearest to b."""
    return atan2(dot(s, cross(a, b)), minus(dot(a, b), times(dot(s, a), dot(s, b))))


def turns_to_level(s: Vector, a: Vector, m: Vector, level: Scalar) -> tuple[Scalar, Scalar]:
    """The two angles about s at which a, turned, has the scalar product ``level`` with m.

    Out of reach both are the angle of the largest or smallest product.
    """
    fixed = times(dot(m, s), dot(s, a))
    along, across, wanted = minus(dot(m, a), fixed), dot(m, cross(s, a)), minus(level, fixed)
    size = sqrt(plus(times(along, along), times(across, across)))
    square = times(minus(size, wanted), plus(size, wanted))
    middle = atan2(across, along)
    aside = atan2(root(square), wanted)
    return middle + aside, middle - aside


def two_turns(s1: Vector, s2: Vector, a: Vector, b: Vector) -> list[tuple[Scalar, Scalar]]:
    """Both pairs of angles with R(s1) R(s2) a = b, for vectors of one length."""
    return [
        (turn_onto(s1, rotate(s2, second) @ a, b), second) for second in turns_to_level(s2, a, s1, dot(s1, b))
    ]


def three_turns(s1: Vector, s2: Vector, s3: Vector, R: Rotation) -> list[tuple[Scalar, Scalar, Scalar]]:
    """Both triples of angles with R(s1) R(s2) R(s3) = R, neighbouring axes not parallel.

    Where s1 and the turned s3 fall together only the sum or difference of first and third is determined.
    """
    triples = []
    for first, second in two_turns(s1, s2, s3, R @ s3):
        rest = (rotate(s1, first) @ rotate(s2, second)).T @ R
        triples.append((first, second, turn_onto(s3, s2, rest @ s2)))
    return triples
