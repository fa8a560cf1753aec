"""A robot written as a table: the text reads back to the same robot, number for number.

Formulas and mirrored limbs are written out, as numbers and rows of their own: parameters are not kept.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from screwkin.algebra.scalar import Scalar, is_symbolic
from screwkin.algebra.se3 import UNTURNED, ZERO, Pose, Rotation, Vector, leaves
from screwkin.errors import InputError
from screwkin.model.robot import Closure, Joint, Limb, Link, Robot, Sole
from screwkin.model.values import COUPLINGS

_GIMBAL = 1e-9  # cosine of the pitch below which roll and yaw turn about the same axis


def robot_toml(robot: Robot) -> str:
    """The text of a table for a robot of numbers.

    Raises:
        InputError: the robot holds symbols.
    """
    head = {
        "name": robot.name,
        "description": robot.description,
        "source": robot.source,
        "base_link": robot.base_link,
        "base": robot.base,
    }
    origins = {joint.child: joint.screw.s0 for joint in robot.joints}
    blocks = [_block("[robot]", {key: value for key, value in head.items() if value})]
    blocks += [_block("[[link]]", _link(link, origins.get(link.name, ZERO))) for link in robot.links]
    blocks += [_block("[[joint]]", _joint(joint)) for joint in robot.joints]
    blocks += [_block("[[closure]]", _closure(closure)) for closure in robot.closures]
    blocks += [_block("[[limb]]", _limb(limb)) for limb in robot.limbs]
    blocks += [_block("[[sole]]", _sole(sole)) for sole in robot.soles]
    if robot.waist is not None:
        blocks.append(_block("[waist]", _frame(robot.waist)))
    for posture in robot.postures:
        q = {name: value for name, value in zip(robot.joint_names, posture.q, strict=True) if value}
        blocks.append(
            _block("[[posture]]", {"name": posture.name, "base_height": posture.base_height, "q": q})
        )
    if robot.servos:
        blocks.append(_block("[servos]", robot.servos))
    return "\n".join(blocks)


def rpy_of(R: Rotation) -> tuple[float, float, float]:
    """Roll, pitch, yaw with R = Rz(yaw) Ry(pitch) Rx(roll); yaw = 0 where the pitch is a right angle."""
    x, y, z = ([float(c) for c in column] for column in (R.x, R.y, R.z))
    level = math.hypot(x[0], x[1])
    pitch = math.atan2(-x[2], level)
    if level < _GIMBAL:
        return math.atan2(-z[1], y[1]), pitch, 0.0
    return math.atan2(y[2], z[2]), pitch, math.atan2(x[1], x[0])


def _block(title: str, values: Mapping[str, Any]) -> str:
    return "\n".join([title, *(f"{_key(key)} = {_value(value)}" for key, value in values.items())]) + "\n"


def _link(link: Link, origin: Vector) -> dict[str, Any]:
    row: dict[str, Any] = {"name": link.name, "mass": link.mass}
    if link.mass:
        row["com"] = link.com
    i = link.inertia
    moments = {"xx": i.xx, "yy": i.yy, "zz": i.zz, "xy": i.xy, "xz": i.xz, "yz": i.yz}
    if link.mass or any(moments.values()):
        row["inertia"] = {name: x for name, x in moments.items() if x or name in ("xx", "yy", "zz")}
    if leaves(link.frame) != leaves(Pose(UNTURNED, origin)):
        row["frame"] = link.frame
    if link.boxes:
        row["boxes"] = [{"center": box.center, "size": box.size} for box in link.boxes]
    return row


def _joint(joint: Joint) -> dict[str, Any]:
    screw = joint.screw
    row = {
        "name": joint.name,
        "parent": joint.parent,
        "child": joint.child,
        "type": joint.type,
        "s": screw.s,
        "s0": screw.s0,
    }
    if joint.type == "helical":
        row["pitch"] = screw.pitch
    limits = {"lower": joint.lower, "upper": joint.upper, "velocity": joint.velocity, "effort": joint.effort}
    return {**row, **{key: x for key, x in limits.items() if math.isfinite(x)}}


def _closure(closure: Closure) -> dict[str, Any]:
    return {
        "name": closure.name,
        "link_a": closure.link_a,
        "frame_a": closure.frame_a,
        "link_b": closure.link_b,
        "frame_b": closure.frame_b,
    }


def _limb(limb: Limb) -> dict[str, Any]:
    row: dict[str, Any] = {"name": limb.name, "kind": limb.kind, "link": limb.link, "tip": limb.tip}
    row["frame"] = limb.frame
    if limb.chain != COUPLINGS:
        row["chain"] = limb.chain
    return row


def _sole(sole: Sole) -> dict[str, Any]:
    return {"limb": sole.limb, "corners": sole.corners}


def _frame(pose: Pose) -> dict[str, Any]:
    turned = leaves(pose.R) != leaves(UNTURNED)
    return {"xyz": pose.p, **({"rpy": rpy_of(pose.R)} if turned else {})}


def _value(value: Any) -> str:
    """A value as TOML, tables inline."""
    if isinstance(value, Pose):
        return _value(_frame(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_pairs(value)) + " }" if value else "{}"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Vector | Sequence):
        return "[" + ", ".join(map(_value, value)) + "]"
    if hasattr(value, "isoformat"):  # a date or time of [servos]
        return str(value.isoformat())
    return _number(value)


def _pairs(table: Mapping[str, Any]) -> Iterator[str]:
    return (f"{_key(key)} = {_value(value)}" for key, value in table.items())


def _key(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    return key if plain.isascii() and plain.isalnum() else _value(key)


def _number(x: Scalar) -> str:
    """Shortest text that reads back to the same number; no negative zero."""
    if is_symbolic(x):
        raise InputError(f"the robot holds the symbol {x}; load it with numbers to write it")
    return str(x) if isinstance(x, int) else repr(float(x) + 0.0)
