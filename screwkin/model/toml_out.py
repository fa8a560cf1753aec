"""A robot written as a table: the text reads back to the same robot, number for number.

Formulas and mirrored limbs are written out, as numbers and rows of their own: parameters are not written.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import IDENTITY, UNTURNED, ZERO, Pose, Rotation, Vector, leaves
from screwkin.errors import InputError
from screwkin.model.coupled import coupling_of
from screwkin.model.mesh_files import short_path
from screwkin.model.records import (
    CoupledJoint,
    Joint,
    Limb,
    Link,
    Posture,
    RobotRecord,
    Shape,
    open_scalars,
)
from screwkin.model.values import COUPLINGS

_UNLIMITED = {"lower": -math.inf, "upper": math.inf, "velocity": math.inf, "effort": math.inf}
_GIMBAL = 1e-9  # cosine of the pitch below which roll and yaw turn about the same axis


def robot_toml(robot: RobotRecord, folder: Path | None = None) -> str:
    """The text of a table for a robot of numbers.

    Args:
        robot: any robot.
        folder: where the table will lie: meshes in it or in the folder above have paths from there.

    Raises:
        InputError: the robot holds symbols.
    """
    for x in open_scalars(robot):
        raise InputError(f"the robot holds the symbol {x}; load it with numbers to write it")
    return table_text(table_data(robot, folder))


def table_data(robot: RobotRecord, folder: Path | None = None) -> dict[str, Any]:
    """The table of a robot as nested dictionaries, as a TOML reader would return them; see ``robot_toml``."""
    head = {
        "name": robot.name,
        "description": robot.description,
        "source": robot.source,
        "base_link": robot.base_link,
        "base": robot.base,
    }
    origins = {joint.child: joint.screw.s0 for joint in robot.tree}
    data: dict[str, Any] = {
        "robot": {key: value for key, value in head.items() if value},
        "link": [_link(link, origins.get(link.name, ZERO), folder) for link in robot.links],
        "joint": [_joint(joint) for joint in robot.tree],
        "closure": [_row(closure) for closure in robot.closures],
        "frame": [_row(frame) for frame in robot.frames],
        "limb": [_limb(limb) for limb in robot.limbs],
        "sole": [_row(sole) for sole in robot.soles],
        "waist": {} if robot.waist is None else _frame(robot.waist),
        "posture": [_posture(posture, robot) for posture in robot.postures],
        "servos": dict(robot.servos),
    }
    return {key: value for key, value in data.items() if value}


def table_text(data: Mapping[str, Any]) -> str:
    """TOML text of a table's nested dictionaries: a block for every row, what lies within it inline."""
    loose = {
        key: value for key, value in data.items() if not isinstance(value, Mapping) and not _are_rows(value)
    }
    blocks = [_block("", loose)] if loose else []
    for key, value in data.items():
        if key in loose:
            continue
        rows = value if isinstance(value, list) else [value]
        title = f"[[{toml_key(key)}]]" if isinstance(value, list) else f"[{toml_key(key)}]"
        blocks += [_block(title, row) for row in rows]
    return "\n".join(blocks)


def rpy_of(R: Rotation) -> tuple[float, float, float]:
    """Roll, pitch, yaw with R = Rz(yaw) Ry(pitch) Rx(roll); yaw = 0 where the pitch is a right angle."""
    x, y, z = ([float(c) for c in column] for column in (R.x, R.y, R.z))
    level = math.hypot(x[0], x[1])
    pitch = math.atan2(-x[2], level)
    if level < _GIMBAL:
        return math.atan2(-z[1], y[1]), pitch, 0.0
    return math.atan2(y[2], z[2]), pitch, math.atan2(x[1], x[0])


def _are_rows(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(row, Mapping) for row in value)


def _block(title: str, values: Mapping[str, Any]) -> str:
    return (
        "\n".join([title, *(f"{toml_key(key)} = {toml_value(value)}" for key, value in values.items())])
        + "\n"
    )


def _link(link: Link, origin: Vector, folder: Path | None) -> dict[str, Any]:
    row: dict[str, Any] = {"name": link.name, "mass": link.mass}
    if link.mass or leaves(link.com) != leaves(link.frame.p):
        row["com"] = list(link.com)
    i = link.inertia
    moments = {"xx": i.xx, "yy": i.yy, "zz": i.zz, "xy": i.xy, "xz": i.xz, "yz": i.yz}
    if link.mass or any(moments.values()):
        row["inertia"] = {name: x for name, x in moments.items() if x or name in ("xx", "yy", "zz")}
    if leaves(link.frame) != leaves(Pose(UNTURNED, origin)):
        row["frame"] = _frame(link.frame)
    if link.boxes:
        row["boxes"] = _plain(link.boxes)
    if link.shapes:
        row["shapes"] = [_shape(shape, folder) for shape in link.shapes]
    if link.spring is not None:
        row["spring"] = _row(link.spring)
    return row


def _shape(shape: Shape, folder: Path | None) -> dict[str, Any]:
    row: dict[str, Any] = {"role": shape.role}
    if shape.kind == "mesh":
        row["mesh"] = short_path(shape.file, folder) if folder else shape.file
        if any(factor != 1 for factor in shape.size):
            row["scale"] = list(shape.size)
    else:
        row[shape.kind] = shape.size[0] if len(shape.size) == 1 else list(shape.size)
    if leaves(shape.pose) != leaves(IDENTITY):
        row["frame"] = _frame(shape.pose)
    if shape.colour:
        row["colour"] = list(shape.colour)
    return row


def _joint(joint: Joint) -> dict[str, Any]:
    screw = joint.screw
    row: dict[str, Any] = {
        "name": joint.name,
        "parent": joint.parent,
        "child": joint.child,
        "type": joint.type,
        "s": list(screw.s),
        "s0": list(screw.s0),
    }
    if joint.type == "helical" or (joint.type == "revolute" and screw.pitch != 0):
        row["pitch"] = screw.pitch
    limits = {key: getattr(joint, key) for key in _UNLIMITED}
    row |= {key: x for key, x in limits.items() if x != _UNLIMITED[key]}
    if joint.passive:
        row["passive"] = True
    row |= {key: x for key in ("stiffness", "rest", "damping") if (x := getattr(joint, key))}
    if isinstance(joint, CoupledJoint):
        row["mimic"] = coupling_of(joint)
    return row


def _limb(limb: Limb) -> dict[str, Any]:
    return {key: value for key, value in _row(limb).items() if key != "chain" or value != list(COUPLINGS)}


def _posture(posture: Posture, robot: RobotRecord) -> dict[str, Any]:
    q = {joint.name: value for joint, value in zip(robot.joints, posture.q, strict=True) if value}
    return {"name": posture.name, "base_height": posture.base_height, "q": q}


def _row(record: Any) -> dict[str, Any]:
    """A record as a row of the same keys."""
    return {f.name: _plain(getattr(record, f.name)) for f in fields(record)}


def _plain(value: Any) -> Any:
    if isinstance(value, Vector):
        return list(value)
    if isinstance(value, Pose):
        return _frame(value)
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return _row(value) if is_dataclass(value) else value


def _frame(pose: Pose) -> dict[str, Any]:
    turned = leaves(pose.R) != leaves(UNTURNED)
    return {"xyz": list(pose.p), **({"rpy": list(rpy_of(pose.R))} if turned else {})}


def toml_value(value: Any) -> str:
    """A value as TOML, tables inline."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_pairs(value)) + " }" if value else "{}"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if hasattr(value, "isoformat"):  # a date or time of [servos]
        return str(value.isoformat())
    return _number(value)


def _pairs(table: Mapping[str, Any]) -> Iterator[str]:
    return (f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items())


def toml_key(key: str) -> str:
    """A key as TOML, in quotes where it must be."""
    plain = key.replace("_", "").replace("-", "")
    return key if plain.isascii() and plain.isalnum() else toml_value(key)


def _number(x: Scalar) -> str:
    """Shortest text that reads back to the same number; no negative zero."""
    return str(x) if isinstance(x, int) else repr(float(x) + 0.0)
