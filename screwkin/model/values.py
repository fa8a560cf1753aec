"""Values of a table's keys as they are read: numbers, vectors, axes, names, virtual chains.

Arithmetic is evaluated on the way, over the names that come as the validation's context: first those for the
mechanism's numbers (floats or symbols), then their numeric values, for limits and postures.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated

from pydantic import PlainValidator, ValidationInfo
from pydantic_core import PydanticCustomError

from screwkin.algebra.scalar import Scalar, is_symbolic, structural
from screwkin.algebra.se3 import Vector
from screwkin.model.expression import ExpressionError, UnresolvedError, evaluate, listed

UNIT_TOLERANCE = 1e-9
"""How far from 1 the length of an axis may be: what nine written digits cannot miss."""

COUPLINGS = ("px", "py", "pz", "rx", "ry", "rz")
"""Couplings of a virtual chain: translations along and rotations about x, y, z."""

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
"""What the name of a link, joint, limb or posture looks like."""


def _wrong(found: str, fix: str, unresolved: bool = False) -> PydanticCustomError:
    """A fault on its way through pydantic; an unresolved one is reported at its parameter instead."""
    return PydanticCustomError("fault", "fault", {"found": found, "fix": fix, "unresolved": unresolved})


def _number(value: object, info: ValidationInfo) -> Scalar:
    """A number of the mechanism; exactly 0, 1 or -1 becomes structure."""
    names, _ = info.context or ({}, {})
    return _evaluated(value, names)


def _value(value: object, info: ValidationInfo) -> float:
    """A number that stays a number in the symbolic twin: limits and postures."""
    _, numbers = info.context or ({}, {})
    return float(_evaluated(value, numbers))


def _evaluated(value: object, names: Mapping[str, Scalar]) -> Scalar:
    try:
        result = evaluate(value, names)
    except UnresolvedError as error:
        raise _wrong(error.found, error.fix, unresolved=True) from None
    except ExpressionError as error:
        raise _wrong(error.found, error.fix) from None
    return result if is_symbolic(result) else structural(result)


def _vector(value: object, info: ValidationInfo) -> Vector:
    if not isinstance(value, list) or len(value) != 3:
        raise _wrong(f"{value!r} is no vector", "Write three numbers, as [x, y, z]")
    return Vector(*(_number(component, info) for component in value))


def _unit(value: object, info: ValidationInfo) -> Vector:
    axis = _vector(value, info)
    if any(is_symbolic(c) for c in axis):
        return axis  # its numeric twin has been checked
    length = math.hypot(*axis)
    if length == 0:
        raise _wrong("s is the zero vector", "Write the unit vector of the joint's axis")
    if abs(length - 1) > UNIT_TOLERANCE:
        normalised = ", ".join(f"{c / length:.10g}" for c in axis)
        given = ", ".join(f"{c:g}" for c in axis)
        raise _wrong(f"({given}) has norm {length:.10g}, expected 1", f"Write s = [{normalised}]")
    return axis


def _positive_vector(value: object, info: ValidationInfo) -> Vector:
    size = _vector(value, info)
    if any(not is_symbolic(c) and c <= 0 for c in size):
        raise _wrong(f"edges {value!r}", "Write three positive lengths, as [lx, ly, lz]")
    return size


def _factors(value: object, info: ValidationInfo) -> Vector:
    factors = _vector(value, info)
    if any(factor == 0 for factor in factors):
        raise _wrong(f"factors {value!r}", "Write three factors other than 0, as [x, y, z]")
    return factors


def _length(value: object, info: ValidationInfo) -> Scalar:
    length = _number(value, info)
    if not is_symbolic(length) and length <= 0:
        raise _wrong(f"{length:g} is not positive", "Write a positive length in m")
    return length


def _lengths(value: object, info: ValidationInfo) -> tuple[Scalar, ...]:
    if not isinstance(value, list) or len(value) != 2:
        raise _wrong(f"{value!r} is no pair", "Write [radius, length] in m")
    return tuple(_length(item, info) for item in value)


def _colour(value: object, info: ValidationInfo) -> tuple[float, ...]:
    numbers = tuple(float(c) for c in _vector(value, info))
    if not all(0 <= c <= 1 for c in numbers):
        raise _wrong(f"{value!r} is no colour", "Write [red, green, blue] in [0, 1]")
    return numbers


def _mass(value: object, info: ValidationInfo) -> Scalar:
    mass = _number(value, info)
    if not is_symbolic(mass) and mass < 0:
        raise _wrong(f"mass {mass:g} is negative", "Write a mass >= 0 in kg")
    return mass


def _positive(value: object, info: ValidationInfo) -> float:
    number = _value(value, info)
    if number <= 0:
        raise _wrong(f"{number:g} is not positive", "Write a positive number, or leave it out for no limit")
    return number


def _place(value: object, info: ValidationInfo) -> Vector:
    """A vector that stays one of numbers in the symbolic twin."""
    if not isinstance(value, list) or len(value) != 3:
        raise _wrong(f"{value!r} is no vector", "Write three numbers, as [x, y, z]")
    return Vector(*(_value(component, info) for component in value))


def _moments(value: object, info: ValidationInfo) -> tuple[float, ...]:
    moments = value if isinstance(value, list) else [value]
    if len(moments) not in (1, 2):
        raise _wrong(f"{value!r} is no pair", "Write one second moment in m^4, or two: [about, across]")
    return tuple(_positive(item, info) for item in moments)


def _name(value: object) -> str:
    if not isinstance(value, str) or not NAME.fullmatch(value):
        fix = "Write letters, digits, _ and -, beginning with a letter"
        raise _wrong(f"{value!r} is not a name", fix)
    return value


def _chain(value: object) -> tuple[str, ...]:
    whole = listed(COUPLINGS)
    if not isinstance(value, list) or not value or any(c not in COUPLINGS for c in value):
        raise _wrong(f"{value!r} is no virtual chain", f"List couplings from floor to tip, out of {whole}")
    if len(set(value)) < len(value):
        raise _wrong(f"{value!r} has a coupling twice", f"List each of {whole} at most once")
    return tuple(value)


Name = Annotated[str, PlainValidator(_name)]
Number = Annotated[Scalar, PlainValidator(_number)]
Mass = Annotated[Scalar, PlainValidator(_mass)]
Value = Annotated[float, PlainValidator(_value)]
Positive = Annotated[float, PlainValidator(_positive)]
Point = Annotated[Vector, PlainValidator(_vector)]
Unit = Annotated[Vector, PlainValidator(_unit)]
Factors = Annotated[Vector, PlainValidator(_factors)]
Length = Annotated[Scalar, PlainValidator(_length)]
Lengths = Annotated[tuple[Scalar, ...], PlainValidator(_lengths)]
Place = Annotated[Vector, PlainValidator(_place)]
Moments = Annotated[tuple[float, ...], PlainValidator(_moments)]
Colour = Annotated[tuple[float, ...], PlainValidator(_colour)]
Size = Annotated[Vector, PlainValidator(_positive_vector)]
Chain = Annotated[tuple[str, ...], PlainValidator(_chain)]
