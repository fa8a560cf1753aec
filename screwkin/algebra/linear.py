"""Small linear systems as formulas on any scalar: Cramer's rule and orthogonal columns."""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra import scalar
from screwkin.algebra.scalar import Scalar, minus, plus, times
from screwkin.algebra.se3 import Vector, cross, dot


def cramer(columns: Sequence[Vector], wanted: Vector) -> tuple[list[Scalar], Scalar]:
    """Coefficients of three vectors whose combination is the wanted one, and their determinant."""
    a, b, c = columns
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    volume = dot(a, bc)
    return [dot(wanted, bc) / volume, dot(wanted, ca) / volume, dot(wanted, ab) / volume], volume


def orthogonal(columns: Sequence[Sequence[Scalar]], wanted: Sequence[Scalar]) -> tuple[list[Scalar], Scalar]:
    """Coefficients of n independent columns that combine to the wanted one, and the columns' volume.

    Modified Gram-Schmidt with the wanted column carried along, which is as accurate as an elimination with
    pivots (Bjorck 1967); of too many rows the least squares.
    """
    columns, rest, volume = [list(c) for c in columns], list(wanted), 1
    shares: list[list[Scalar]] = []
    right: list[Scalar] = []
    for k, column in enumerate(columns):
        size = scalar.sqrt(product(column, column))
        unit = [x / size for x in column]
        shares.append([product(unit, other) for other in columns[k + 1 :]])
        for j, share in enumerate(shares[-1]):
            columns[k + 1 + j] = _less(columns[k + 1 + j], unit, share)
        along = product(unit, rest)
        rest = _less(rest, unit, along)
        shares[-1].insert(0, size)
        right.append(along)
        volume = times(volume, size)
    solution: list[Scalar] = []
    for k in reversed(range(len(columns))):
        size, *others = shares[k]
        known = product(others, solution)
        solution.insert(0, minus(right[k], known) / size)
    return solution, volume


def product(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Scalar product of two vectors of any size."""
    total: Scalar = 0
    for x, y in zip(a, b, strict=True):
        total = plus(total, times(x, y))
    return total


def _less(a: Sequence[Scalar], unit: Sequence[Scalar], share: Scalar) -> list[Scalar]:
    return [minus(x, times(u, share)) for x, u in zip(a, unit, strict=True)]
