"""What must hold within ``[servos]`` of a robot's table, whatever the bus; its keys: ``servo.servo_map``."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

from screwkin.errors import Fault, near
from screwkin.model.expression import listed
from screwkin.model.servo_models import is_model, model_names

PLACE = "[servos]"
IN_SERVOS = {"gain": "kp", "voltage": "voltage", "lag": "lag"}
"""Keys that stand for figures of all motors (see ``motors``)."""
KEYS = (
    "model",
    "models",
    "protocol",
    "baud",
    "ids",
    "direction",
    "zero",
    "range_deg",
    "stiffness",
    *IN_SERVOS,
)


@dataclass(frozen=True)
class Mounted:
    """Joints as ``[servos]`` may name them.

    driven: names of those with motors. still: of those without one. complete: whether each of ``driven``
    needs an id: a bus needs them all, a table may be read before the last servo is mounted.
    """

    driven: Sequence[str]
    still: Sequence[str] = ()
    complete: bool = True


def servo_faults(servos: Mapping[str, Any], joints: Mounted) -> Iterator[Fault]:
    """Faults of what stands in the section; what a bus needs besides may be missing."""
    for key in servos:
        if key not in KEYS:
            yield Fault(PLACE, key, "is unknown", f"{near(key, KEYS)}Known are {', '.join(KEYS)}")
    models = servos.get("models", {})
    of_joints = {f"models.{joint}": model for joint, model in models.items()} if _is_table(models) else {}
    for key, model in {**({"model": servos["model"]} if "model" in servos else {}), **of_joints}.items():
        if not is_model(model):
            question = near(model, model_names()) if isinstance(model, str) else ""
            yield Fault(
                PLACE, key, f"{model!r} is unknown", f"{question}Known are {', '.join(model_names())}"
            )
    for key in ("models", "ids", "direction", "zero"):
        if not _is_table(table := servos.get(key, {})):
            yield Fault(PLACE, key, f"{table!r} is no table", f"Write {key} = {{ JOINT = VALUE, … }}")
        else:
            yield from _joint_faults(key, table, joints)
            yield from (Fault(PLACE, *fault) for fault in _CHECKS[key](table))
    ids = servos.get("ids")
    missing = [name for name in joints.driven if name not in ids] if _is_table(ids) else []
    if missing and joints.complete:
        yield Fault(PLACE, "ids", f"has none for {', '.join(missing)}", "Give every joint an id")
    degrees = servos.get("range_deg", 300.0)
    if not (is_number(degrees) and 0 < degrees <= 360):
        yield Fault(PLACE, "range_deg", f"is {degrees!r}", "Write a number of degrees up to 360")
    for key in IN_SERVOS:
        value = servos.get(key, 1.0)
        if not (is_number(value) and (value > 0 or (value == 0 and key == "lag"))):
            least = "of at least 0" if key == "lag" else "above 0"
            yield Fault(PLACE, key, f"is {value!r}", f"Write a finite number {least}")
    yield from _stiffness_faults(servos.get("stiffness", 1.0), joints)


def is_number(value: Any) -> bool:
    """Whether a value of a table is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_table(value: Any) -> TypeGuard[Mapping[str, Any]]:
    return isinstance(value, Mapping)


def _joint_faults(key: str, table: Mapping[str, Any], joints: Mounted) -> Iterator[Fault]:
    """Names that are those of no joint with a motor."""
    known = ", ".join(joints.driven)
    for joint in table:
        if joint in joints.still:
            yield Fault(PLACE, f"{key}.{joint}", "is turned by no motor", f"Joints with motors are {known}")
        elif joint not in joints.driven:
            fix = f"{near(joint, joints.driven)}Joints are {known}"
            yield Fault(PLACE, f"{key}.{joint}", "is no joint", fix)


def _id_faults(ids: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    bearers: dict[int, list[str]] = {}
    for joint, number in ids.items():
        if not (isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= 252):
            yield f"ids.{joint}", f"is {number!r}", "Write an integer from 0 to 252"
        else:
            bearers.setdefault(number, []).append(joint)
    for number, joints in bearers.items():
        if len(joints) > 1:
            yield "ids", f"{number} is given to {', '.join(joints)}", "Give every servo an id of its own"


def _direction_faults(table: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    for joint, value in table.items():
        if not is_number(value) or value not in (1, -1):
            yield f"direction.{joint}", f"is {value!r}", "Write 1 or -1"


def _zero_faults(table: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    for joint, value in table.items():
        if not (is_number(value) and abs(value) <= math.pi):
            yield f"zero.{joint}", f"is {value!r}", "Write an angle in rad, -pi to pi"


def _stiffness_faults(stiffness: Any, joints: Mounted) -> Iterator[Fault]:
    known = (*joints.driven, *joints.still, "default")
    given = (
        {f"stiffness.{name}": value for name, value in stiffness.items()}
        if _is_table(stiffness)
        else {"stiffness": stiffness}
    )
    for key, value in given.items():
        name = key.partition(".")[2]
        if name and name not in known:
            yield Fault(PLACE, key, "is no joint", f"{near(name, known)}Joints: {listed(known)}")
        elif not (is_number(value) and value > 0):
            yield Fault(PLACE, key, f"is {value!r}", "Write a positive number in N m/rad")


_CHECKS: Mapping[str, Callable[[Mapping[str, Any]], Iterator[tuple[str, str, str]]]] = {
    "models": lambda table: iter(()),
    "ids": _id_faults,
    "direction": _direction_faults,
    "zero": _zero_faults,
}
