"""What is wrong with a robot built from records: written as a table, it goes through the checks of a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import Pose, as_array
from screwkin.errors import Fault, TableError
from screwkin.model.reading import checked_table
from screwkin.model.records import (
    Closure,
    CoupledJoint,
    Frame,
    Joint,
    Limb,
    Link,
    Posture,
    RobotRecord,
    Sole,
    is_open,
    open_scalars,
)
from screwkin.model.schema import label
from screwkin.model.sound import certified
from screwkin.model.toml_out import table_data
from screwkin.model.values import UNIT_TOLERANCE

_KINDS: Mapping[str, tuple[str, type]] = {
    "link": ("links", Link),
    "joint": ("joints", Joint),
    "coupled": ("coupled", CoupledJoint),
    "closure": ("closures", Closure),
    "frame": ("frames", Frame),
    "limb": ("limbs", Limb),
    "sole": ("soles", Sole),
    "posture": ("postures", Posture),
}


def check_records(robot: RobotRecord) -> bool:
    """Refuse what a table of the same content would be refused for; components that are symbols pass.

    Returns:
        True if every component is known to be a number.

    Raises:
        TableError: lists all faults.
    """
    if certified(robot):
        return True
    if faults := record_faults(robot):
        raise TableError(robot.path or f"robot {robot.name!r}", faults)
    return False


def record_faults(robot: RobotRecord) -> list[Fault]:
    """All faults of a robot's records; of one with symbols, those of kinds, names and connections."""
    faults = [fault for table in _KINDS for fault in _table_faults(robot, table)]
    if robot.waist is not None:
        wrong = [*_misfits(robot.waist, Pose, "")] or [*_skewed(robot.waist, "")]
        faults += [Fault("[waist]", place.lstrip("."), found, fix) for place, found, fix in wrong]
    if faults:
        return faults
    symbolic = any(True for _ in open_scalars(robot))
    table = checked_table(table_data(RobotRecord(**_numeric(vars_of(robot)))))
    return list(table.structural if symbolic else table.faults)


def vars_of(robot: RobotRecord) -> dict[str, Any]:
    """The fields of a robot's record by name, without what is cached beside them."""
    return {f.name: getattr(robot, f.name) for f in fields(RobotRecord)}


def _numeric(value: Any) -> Any:
    """The same records with 1.0 for every symbol: names and connections are left to be checked."""
    if is_dataclass(value) and not isinstance(value, type):
        return type(value)(**{f.name: _numeric(getattr(value, f.name)) for f in fields(value)})
    if isinstance(value, tuple):
        return tuple(map(_numeric, value))
    if isinstance(value, dict):
        return {key: _numeric(item) for key, item in value.items()}
    if isinstance(value, np.generic):
        return value.item()
    return 1.0 if is_open(value) else value


def _table_faults(robot: RobotRecord, table: str) -> Iterator[Fault]:
    """Components that are no records of the right class, or do not fit one another."""
    key, kind = _KINDS[table]
    rows = getattr(robot, key)
    if not isinstance(rows, tuple):
        yield Fault("robot", key, f"is a {type(rows).__name__}", f"Give a tuple of {kind.__name__} records")
        return
    title = "limb" if table == "sole" else "name"
    for i, row in enumerate(rows):
        first = len(robot.joints) if table == "coupled" else 0
        where = label("joint" if first else table, first + i, {title: getattr(row, title, None)})
        wrong = [*_misfits(row, kind, "")] or [*_discord(robot, row)]
        yield from (Fault(where, place.lstrip("."), found, fix) for place, found, fix in wrong)


def _discord(robot: RobotRecord, row: Any) -> Iterator[tuple[str, str, str]]:
    """What a table cannot say and records can: a posture for other joints, a prismatic joint with a pitch."""
    if isinstance(row, Posture) and len(row.q) != len(robot.joints):
        yield "q", f"has {len(row.q)} positions", f"Give one for each of the {len(robot.joints)} joints"
    if isinstance(row, Joint) and row.type == "prismatic" and not row.screw.is_translation:
        yield "screw.pitch", f"{row.screw.pitch} on a prismatic joint", "Give the pitch INFINITE"
    if isinstance(row, CoupledJoint):
        for key in ("ratio", "offset"):
            if is_open(getattr(row, key)):
                yield key, f"is {getattr(row, key)}", "Give a number: couplings hold no symbols"
    for f in fields(row):
        if isinstance(getattr(row, f.name), Pose):
            yield from _skewed(getattr(row, f.name), f.name)
    for i, shape in enumerate(row.shapes if isinstance(row, Link) else ()):
        yield from _skewed(shape.pose, f"shapes[{i}].pose")


def _skewed(pose: Pose, key: str) -> Iterator[tuple[str, str, str]]:
    if any(True for _ in open_scalars(pose)):
        return
    R = as_array(pose.R)
    if np.abs(R @ R.T - np.eye(3)).max() > UNIT_TOLERANCE or np.linalg.det(R) < 0:
        yield key, "is no rotation", "Give orthonormal columns, right-handed"


@cache
def _hints(cls: type) -> dict[str, Any]:
    return get_type_hints(cls)


def _misfits(value: Any, hint: Any, key: str) -> Iterator[tuple[str, str, str]]:
    """Key, what stands there and what should, for every component that is not of its kind."""
    if hint in (Scalar, float):
        if not isinstance(value, int | float | np.number) and not is_open(value):
            yield key, f"found {value!r}", "Give a number"
    elif hint is bool:
        if not isinstance(value, bool):
            yield key, f"found {value!r}", "Give True or False"
    elif hint is str or get_origin(hint) is Literal:
        if not isinstance(value, str):
            yield key, f"found {value!r}", "Give a text"
    elif get_origin(hint) is UnionType:  # a record, or none
        if value is not None:
            yield from _misfits(value, get_args(hint)[0], key)
    elif get_origin(hint) is tuple:
        if not isinstance(value, tuple):
            yield key, f"is a {type(value).__name__}", "Give a tuple"
        else:
            for i, item in enumerate(value):
                yield from _misfits(item, get_args(hint)[0], f"{key}[{i}]")
    elif not isinstance(value, hint):
        yield key, f"found {value!r}", f"Give a {hint.__name__}"
    else:
        for f in fields(hint):
            yield from _misfits(getattr(value, f.name), _hints(hint)[f.name], f"{key}.{f.name}")
