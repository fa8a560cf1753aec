"""Small linear systems as formulas on any scalar: Cramer's rule, orthogonal columns, reflections."""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra import scalar
from screwkin.algebra.scalar import Scalar, abs_, larger, minus, plus, times, where
from screwkin.algebra.se3 import Vector, cross, dot

TINY = 1e-40
"""What stands for a pivot that vanishes: far below rounding, and no inverse square of it overflows."""


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


def triangular(rows: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    """The triangle R (row k from column k on) of a square matrix, by Householder's reflections.

    All but the last column are reflected, which needs no pivots; structural zeros below the diagonal fold.
    """
    columns = [list(column) for column in zip(*rows, strict=True)]
    triangle = []
    for _ in columns[1:]:
        head, *others = columns
        size = scalar.sqrt(product(head, head))
        corner = where(head[0] < 0, size, -size)
        mirror = [minus(head[0], corner), *head[1:]]
        square = size * (size + abs_(head[0]))
        factor = where(square > 0, 1.0, 0.0) / where(square > 0, square, 1.0)
        columns, row = [], [corner]
        for column in others:
            share = times(product(mirror, column), factor)
            first, *rest = _less(column, mirror, share)
            row.append(first)
            columns.append(rest)
        triangle.append(row)
    return [*triangle, columns[0]]


def determinant(rows: Sequence[Sequence[Scalar]]) -> Scalar:
    """Determinant of a square matrix; every reflection of ``triangular`` changes its sign."""
    value: Scalar = 1
    for row in triangular(rows):
        value = times(value, row[0])
    return value if len(rows) % 2 else -value


def null_vector(rows: Sequence[Sequence[Scalar]]) -> list[Scalar]:
    """A vector, of any length, that a singular square matrix takes to zero: one inverse iteration."""
    triangle = triangular(rows)
    diagonal = [where(abs_(row[0]) > TINY, row[0], TINY) for row in triangle]
    forward: list[Scalar] = []
    for k, pivot in enumerate(diagonal):
        known = product([triangle[i][k - i] for i in range(k)], forward)
        forward.append(minus(1.0, known) / pivot)
    vector: list[Scalar] = []
    for k in reversed(range(len(rows))):
        vector.insert(0, minus(forward[k], product(triangle[k][1:], vector)) / diagonal[k])
    largest = vector[0] * vector[0]
    for x in vector[1:]:
        largest = larger(x * x, largest)
    size = 1 / scalar.sqrt(largest)
    return [x * size for x in vector]


def product(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Scalar product of two vectors of any size."""
    total: Scalar = 0
    for x, y in zip(a, b, strict=True):
        total = plus(total, times(x, y))
    return total


def _less(a: Sequence[Scalar], unit: Sequence[Scalar], share: Scalar) -> list[Scalar]:
    return [minus(x, times(u, share)) for x, u in zip(a, unit, strict=True)]
