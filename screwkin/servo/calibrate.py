"""Zero offsets and directions of servos, measured and written into the text of a robot's table."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace

from screwkin.errors import InputError, UnknownNameError
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot
from screwkin.servo.servo_map import ServoMap

_HEADER = re.compile(r"^\s*\[", re.MULTILINE)


def zeros(servos: ServoMap, angles: Mapping[str, float], q: Sequence[float]) -> dict[str, float]:
    """Zero offsets [rad] by joint: servo angle = direction * joint angle + zero.

    Args:
        servos: their directions.
        angles: measured angles of the servos from their centres [rad], by joint.
        q: the joint angles [rad] at which the robot stands, in the order of its joints.

    Raises:
        InputError: a servo stands more than half a turn from where it should; its direction may be wrong.
    """
    zeros = {
        servo.joint: angles[servo.joint] - servo.direction * angle
        for servo, angle in zip(servos.joints, q, strict=True)
    }
    wrong = [f"{joint} by {zero:.2f} rad" for joint, zero in zeros.items() if abs(zero) > math.pi]
    if wrong:
        raise InputError(
            f"servos are off by more than half a turn: {', '.join(wrong)}; is the robot in that posture?"
        )
    return {joint: round(zero, 6) for joint, zero in zeros.items()}


def calibrated(robot: Robot, zero: Mapping[str, float], flip: Sequence[str] = ()) -> str:
    """The text of the robot's table with other zero offsets, and with the directions of some joints turned.

    Everything else stays as it is, comments included. The offsets are those for the directions that are
    written.

    Raises:
        UnknownNameError: no such joint. InputError: the table is written in a way that cannot be edited.
    """
    for joint in (*zero, *flip):
        if joint not in robot.joint_names:
            raise UnknownNameError("joint", joint, robot.joint_names)
    direction = {str(joint): int(d) for joint, d in robot.servos.get("direction", {}).items()}
    direction |= {joint: -direction.get(joint, 1) for joint in flip}
    text = robot.text
    wanted = {**robot.servos, "zero": dict(zero)}
    if flip:
        wanted["direction"] = direction
        text = _with_section(text, "direction", direction)
    text = _with_section(text, "zero", zero)
    try:
        again = parse_robot(text, robot.path or robot.name)
    except InputError as error:
        again = replace(robot, servos={})
        reason = f" ({error})"
    else:
        reason = ""
    if dict(again.servos) != wanted:
        lines = "\n".join(f"{joint} = {value!r}" for joint, value in zero.items())
        raise InputError(
            f"{robot.path}: [servos] is written in a way that cannot be edited{reason}; "
            "write there yourself:\n"
            f"[servos.zero]\n{lines}"
        )
    return text


def turned(robot: Robot, flip: Sequence[str]) -> Robot:
    """The robot with the directions of some joints turned."""
    direction = dict(robot.servos.get("direction", {}))
    direction |= {joint: -direction.get(joint, 1) for joint in flip}
    return replace(robot, servos={**robot.servos, "direction": direction})


def _with_section(text: str, key: str, values: Mapping[str, float]) -> str:
    """The text without ``servos.key`` in whatever form, and with it as a section at the end."""
    section = re.search(rf"^[ \t]*\[servos\.{key}\][^\n]*\n?", text, re.MULTILINE)
    if section:
        following = _HEADER.search(text, section.end())
        end = following.start() if following else len(text)
        text = text[: section.start()] + text[end:]
    servos = re.search(r"^[ \t]*\[servos\][^\n]*\n?", text, re.MULTILINE)
    if servos and key in tomllib.loads(text).get("servos", {}):
        following = _HEADER.search(text, servos.end())
        end = following.start() if following else len(text)
        body = re.sub(rf"^[ \t]*{key}[ \t]*=[^\n]*\n?", "", text[servos.end() : end], flags=re.MULTILINE)
        text = text[: servos.end()] + body + text[end:]
    lines = "".join(f"{joint} = {value!r}\n" for joint, value in values.items())
    return text.rstrip("\n") + f"\n\n[servos.{key}]\n{lines}"
