"""Small linear systems as formulas on any scalar: Cramer's rule, orthogonal columns, reflections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from screwkin.algebra import scalar
from screwkin.algebra.scalar import Scalar, abs_, larger, minus, over, plus, times, where
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
    """Coefficients of n independent columns that combine to the wanted one, and the columns' volume."""
    system = Orthogonal.of(columns)
    return system.solve(wanted), system.volume


@dataclass(frozen=True)
class Orthogonal:
    """Independent columns made orthogonal once, for any number of wanted ones.

    Modified Gram-Schmidt with the wanted column carried along, which is as accurate as an elimination with
    pivots (Bjorck 1967); of too many rows the least squares.

    Attributes:
        units: the orthogonal columns, of length 1.
        shares: of every column its size, then what of the later ones lies along it.
        volume: product of the sizes.
    """

    units: list[list[Scalar]]
    shares: list[list[Scalar]]
    volume: Scalar

    @classmethod
    def of(cls, columns: Sequence[Sequence[Scalar]]) -> Orthogonal:
        """Of columns of equal length, at least as long as they are many."""
        left, volume = [list(c) for c in columns], 1
        units: list[list[Scalar]] = []
        shares: list[list[Scalar]] = []
        for k, column in enumerate(left):
            size = scalar.sqrt(product(column, column))
            unit = [over(x, size) for x in column]
            along = [product(unit, other) for other in left[k + 1 :]]
            for j, share in enumerate(along):
                left[k + 1 + j] = _less(left[k + 1 + j], unit, share)
            units.append(unit)
            shares.append([size, *along])
            volume = times(volume, size)
        return cls(units, shares, volume)

    def solve(self, wanted: Sequence[Scalar]) -> list[Scalar]:
        """Coefficients of the columns that combine to the wanted one."""
        rest = list(wanted)
        right: list[Scalar] = []
        for unit in self.units:
            along = product(unit, rest)
            rest = _less(rest, unit, along)
            right.append(along)
        solution: list[Scalar] = []
        for k in reversed(range(len(right))):
            size, *others = self.shares[k]
            solution.insert(0, over(minus(right[k], product(others, solution)), size))
        return solution


def definite(rows: Sequence[Sequence[Scalar]], wanted: Sequence[Scalar]) -> list[Scalar]:
    """x of A x = b for a symmetric positive definite A, by L' D L from the last row up.

    Where the rows are a mass matrix, joints of a tree come after those that carry them, so that what is 0
    in structure remains 0 (Featherstone 2008, section 6.5).
    """
    A, size = [list(row) for row in rows], len(rows)
    factors: list[list[Scalar]] = [[] for _ in rows]
    for k in reversed(range(size)):
        factors[k] = [over(A[k][i], A[k][k]) for i in range(k)]
        for i in range(k):
            for j in range(i + 1):
                A[i][j] = A[j][i] = minus(A[i][j], times(factors[k][i], A[k][j]))
    x = list(wanted)
    for k in reversed(range(size)):
        for i in range(k):
            x[i] = minus(x[i], times(factors[k][i], x[k]))
    for k in range(size):
        x[k] = minus(over(x[k], A[k][k]), product(factors[k], x[:k]))
    return x


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
