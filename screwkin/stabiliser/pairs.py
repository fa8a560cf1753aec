"""Scalars of any kind, in pairs on the floor and in records: what a stabiliser is written in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, TypeVar

from screwkin.algebra.scalar import Scalar, cos, larger, least, sin, where

Pair = tuple[Scalar, Scalar]
T = TypeVar("T")
HALVINGS = 5
TERMS = 14


def clipped(x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """x, or the nearer end of [low, high]."""
    return least(larger(x, low), high)


def exponential(x: Scalar) -> Scalar:
    """e^x of |x| up to 16, to 1e-13: a series of x/32, squared five times."""
    small = x * 2.0**-HALVINGS
    total: Scalar = 1.0
    for k in range(TERMS, 0, -1):
        total = 1.0 + total * small * (1.0 / k)
    for _ in range(HALVINGS):
        total = total * total
    return total


def logarithm(x: Scalar) -> Scalar:
    """ln x of x within [1/2, 2], to 1e-15: 2 artanh((x - 1)/(x + 1))."""
    z = (x - 1.0) / (x + 1.0)
    z2 = z * z
    total: Scalar = 0.0
    for k in range(29, 0, -2):
        total = 1.0 / k + total * z2
    return 2.0 * z * total


def pair_turned(p: Pair, angle: Scalar) -> Pair:
    """A vector turned by an angle."""
    c, s = cos(angle), sin(angle)
    return c * p[0] - s * p[1], s * p[0] + c * p[1]


def pair_sum(a: Pair, b: Pair, factor: Scalar = 1.0) -> Pair:
    """a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1]


def pair_difference(a: Pair, b: Pair) -> Pair:
    """a - b."""
    return a[0] - b[0], a[1] - b[1]


def pair_within(p: Pair, low: Pair, high: Pair) -> Pair:
    """p in a box, or the nearest point of it."""
    return clipped(p[0], low[0], high[0]), clipped(p[1], low[1], high[1])


def either(condition: Scalar, a: Sequence[Scalar], b: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """a where the condition holds, else b, scalar by scalar."""
    return tuple(where(condition, x, y) for x, y in zip(a, b, strict=True))


def row(record: Any) -> list[Scalar]:
    """The scalars of a record of scalars and tuples of them, in the order of its fields."""
    values = (getattr(record, f.name) for f in fields(record))
    return [x for value in values for x in (value if isinstance(value, tuple) else (value,))]


def of_row(kind: type[T], scalars: Sequence[Scalar]) -> T:
    """The record of that kind with the scalars of ``row``."""
    rest, values = iter(scalars), {}
    for f in fields(kind):  # type: ignore[arg-type]
        size = SIZES[str(f.type)]
        taken = tuple(next(rest) for _ in range(size))
        values[f.name] = taken if size > 1 else taken[0]
    return kind(**values)


def scalars_in(kind: type) -> int:
    """How many scalars a record of that kind has."""
    return sum(SIZES[str(f.type)] for f in fields(kind))


SIZES = {"Scalar": 1, "Pair": 2, "Place": 3}
"""Scalars of a field, by its annotation."""
