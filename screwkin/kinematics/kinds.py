"""The kinds of a formula's arguments and results: how records of scalars lie in arrays."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Wrench
from screwkin.algebra.se3 import ZERO, Pose, Rotation, Twist, Vector, leaves
from screwkin.compiler.records import identifier, matrix
from screwkin.errors import InputError, UnknownNameError
from screwkin.kinematics.arrays import Argument
from screwkin.model.robot import Robot

Joints = Annotated[Sequence[Scalar], "joints"]
"""One scalar for every joint, in table order."""
Number = Annotated[Scalar, "number"]
"""One scalar."""
TipTwists = Annotated[Mapping[str, Twist], "tips"]
"""A twist [omega; v of the tip's origin] by the name of its tip; of a velocity alone, omega ``is ZERO``."""
TipNumbers = Annotated[Sequence[Scalar], "tip numbers"]
"""One scalar for every tip, in the order of limbs."""
TipWrenches = Annotated[Sequence[Wrench], "tip wrenches"]
"""One wrench for every tip, in the order of limbs."""
Columns = Annotated[list[Any], "columns"]
"""A result: a matrix by its columns, each a list, a vector or a twist."""

Parts = Callable[[Any, str, Any], tuple[tuple[Argument, ...], list[Any]]]


@dataclass(frozen=True)
class Kind:
    """How an argument lies in arrays.

    Attributes:
        text: its shape in a docstring.
        shape: trailing shape for a robot.
        record: the record of its arrays' scalars.
        parts: of an argument that is a mapping, the arrays that it consists of, for a robot or mechanism.
    """

    text: str
    shape: Callable[[Robot], tuple[int, ...]]
    record: Callable[[Sequence[Argument], Sequence[list[Scalar]]], Any]
    parts: Parts | None = None


def _pose(x: Sequence[Scalar]) -> Pose:
    return Pose(Rotation(*(Vector(x[c], x[4 + c], x[8 + c]) for c in range(3))), Vector(x[3], x[7], x[11]))


def _twist(x: Sequence[Scalar]) -> Twist:
    return Twist(Vector(*x[:3]) if len(x) == 6 else ZERO, Vector(*x[-3:]))


def _wrench(x: Sequence[Scalar]) -> Wrench:
    return Wrench(Vector(*x[:3]), Vector(*x[3:]))


def _wrenches(x: Sequence[Scalar]) -> list[Wrench]:
    return [_wrench(x[k : k + 6]) for k in range(0, len(x), 6)]


def _one(record: Callable[[Sequence[Scalar]], Any]) -> Callable[..., Any]:
    return lambda arguments, scalars: record(scalars[0])


def _tip_arrays(subject: Any, name: str, value: Any) -> tuple[tuple[Argument, ...], list[Any]]:
    """Twists of the tips that are given; for a program (True) six numbers from six joints on, else three.

    Of a mechanism also those of its further chains.
    """
    robot: Robot = getattr(subject, "robot", subject)
    added = [chain.name for chain in getattr(subject, "added", ())]
    if value is not True:
        if type(value) is not dict and not isinstance(value, Mapping):
            raise InputError(f"{name} is a mapping from names of tips to arrays, not {type(value).__name__}")
        known = (*robot.tip_names, *added)
        for tip in value:
            if tip not in known:
                raise UnknownNameError("tip", str(tip), known)
    arguments: list[Argument] = []
    arrays: list[Any] = []
    names: set[str] = set()
    joints = {limb.tip: len(robot.path_to(limb.link)) for limb in robot.limbs} | dict.fromkeys(added, 6)
    for tip, count in joints.items():
        if value is True:
            size = 6 if count >= 6 else 3
        elif tip in value:
            size = 3 if _length(value[tip]) == 3 else 6
            arrays.append(value[tip])
        else:
            continue
        argument = _tip_argument(name, tip, size, 0)
        if argument.name in names:  # tips that differ in signs only
            argument = _tip_argument(name, tip, size, len(names))
        names.add(argument.name)
        arguments.append(argument)
    return tuple(arguments), arrays


@cache
def _tip_argument(name: str, tip: str, size: int, number: int) -> Argument:
    """One and the same for the same tip: it is part of what programs are looked up by."""
    known = identifier("twist", tip, *([str(number)] if number else []))
    return Argument(known, f"{name}[{tip!r}]", (size,), of=tip)


def _length(value: Any) -> int:
    """Of the last axis; 0 of what is no array."""
    if type(value) is np.ndarray and value.ndim:
        return value.shape[-1]
    try:
        return int(np.shape(value)[-1])
    except (ValueError, IndexError):
        return 0


def _tip_records(arguments: Sequence[Argument], scalars: Sequence[list[Scalar]]) -> dict[str, Twist]:
    return {a.of: _twist(x) for a, x in zip(arguments, scalars, strict=True)}


KINDS: dict[Any, Kind] = {
    Pose: Kind("(..., 4, 4)", lambda robot: (4, 4), _one(_pose)),
    Vector: Kind("(..., 3)", lambda robot: (3,), _one(lambda x: Vector(*x))),
    Twist: Kind("(..., 6)", lambda robot: (6,), _one(_twist)),
    Wrench: Kind("(..., 6)", lambda robot: (6,), _one(_wrench)),
    TipNumbers: Kind("(..., tips)", lambda robot: (len(robot.limbs),), _one(list)),
    TipWrenches: Kind("(..., tips, 6)", lambda robot: (len(robot.limbs), 6), _one(_wrenches)),
    Joints: Kind("(..., n)", lambda robot: (len(robot.joints),), _one(list)),
    Number: Kind("(...)", lambda robot: (), _one(lambda x: x[0])),
    TipTwists: Kind("by tip (..., 6)", lambda robot: (), _tip_records, _tip_arrays),
}
"""By annotation. An argument of any other annotation is a choice: a value that is part of the program."""
STATE = ("T_world_base", "q")
"""The arguments that arrive together, as a ``State``."""


def without_none(annotation: Any) -> Any:
    """An annotation without its None."""
    if get_origin(annotation) in (Union, UnionType):
        options = [option for option in get_args(annotation) if option is not type(None)]
        return options[0] if len(options) == 1 else annotation
    return annotation


def shape_and_scalars(value: Any) -> tuple[tuple[int, ...], list[Scalar]]:
    """Shape and scalars, row by row, of a result.

    A pose is (4, 4), a list of poses (k, 4, 4), a list of scalars (k,), a list of columns, which are twists,
    vectors or lists, a matrix; any other record, or a tuple of records and scalars, the row of its scalars.
    """
    if isinstance(value, Pose):
        return (4, 4), matrix(value)
    if isinstance(value, list):
        if value and isinstance(value[0], Pose):
            return (len(value), 4, 4), [x for pose in value for x in matrix(pose)]
        if value and isinstance(value[0], list | Twist | Vector):
            columns = [column if isinstance(column, list) else leaves(column) for column in value]
            return (len(columns[0]), len(columns)), [x for row in zip(*columns, strict=True) for x in row]
        return (len(value),), value
    flat = [x for part in (value if isinstance(value, tuple) else (value,)) for x in leaves(part)]
    return (len(flat),), flat


def documented(text: str, kinds: Mapping[str, Kind]) -> str:
    """A formula's docstring with the shapes of its arrays: of the state, and in front of every argument."""
    state = "    state: T_world_base (..., 4, 4), the base's pose [m]; q (..., n) joint positions [rad or m]."
    text = re.sub(r"\n( *)state: *\n", lambda m: f"\n{m[1]}{state.strip()}\n", text)
    for name, kind in kinds.items():
        if name not in STATE:
            text = re.sub(rf"\n( +){name}: ", rf"\n\1{name}: {kind.text} ", text)
    return text
