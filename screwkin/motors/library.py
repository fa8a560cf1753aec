"""Figures of servo models: bundled ones by name, a user's own by the path of a TOML file.

model = "XL330-M288"
aliases = ["XL330"]
source = "who measured it"
identified = true
registers = "AX-12A"             # the model whose registers the bus finds there, if it has none of its own

[motor]                          # see ``Motor``; what is left out is its default
constant = 0.38                  # N m/A
…
[motor.friction]                 # see ``Friction``
coulomb = 0.0089
[ranges]                         # least and greatest value of figures that are not certain
constant = [0.3, 0.5]

``[sheet]``, ``[bus]`` and ``[registers]`` say how a bus talks to it; see ``servo.model_file``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, fields, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from screwkin.errors import Fault, InputError, TableError, UnknownNameError, near
from screwkin.files import text_sha256
from screwkin.model.robot import Robot
from screwkin.model.servo_models import bundled_tables, is_file, model_table
from screwkin.model.servo_section import IN_SERVOS
from screwkin.motors.records import Friction, Motor, MotorModel

POSITIVE = ("constant", "resistance", "voltage", "gain", "kp", "max_duty", "max_current", "speed", "shape")
_TOP = ("model", "aliases", "source", "identified", "registers", "motor", "ranges", "sheet", "bus")
_FIGURES = tuple(f.name for f in fields(Motor) if f.name != "friction")
_COEFFICIENTS = tuple(f.name for f in fields(Friction))
_NEEDED = tuple(f.name for f in fields(Motor) if f.default is MISSING and f.default_factory is MISSING)


@cache
def motor_models() -> tuple[str, ...]:
    """Names of the bundled models, in order of the alphabet."""
    return tuple(sorted(model.model for model in _bundled()))


def load_motor(name_or_path: str | Path, folder: Path | None = None) -> MotorModel:
    """The figures of a servo model, by its name or alias (case does not matter) or by the path of its file.

    Args:
        name_or_path: a name, or a path that ends in ``.toml``.
        folder: where relative paths begin, besides the working folder.

    Raises:
        UnknownNameError: neither a model nor a file. TableError: every fault of the file.
    """
    name = str(name_or_path).strip()
    if is_file(name):
        return _model(*model_table(name, folder))
    for model in _bundled():
        if name.lower() in {known.lower() for known in (model.model, *model.aliases)}:
            return model
    raise UnknownNameError("servo model with figures of its motor", name, motor_models())


def motors_of(robot: Robot) -> tuple[Motor, ...]:
    """The motor of every joint, in table order, as ``[servos]`` of the robot's table names its model.

    Raises:
        InputError: the table names no model for a joint. UnknownNameError, TableError: see ``load_motor``.
    """
    return tuple(
        _with_supply(load_motor(name, table_folder(robot)).motor, robot.servos)
        for name in model_of_every_joint(robot)
    )


def names_motors(robot: Robot) -> bool:
    """Whether the table names servo models that all have figures of their motors.

    Raises:
        UnknownNameError, TableError: a model's file is missing, or has faults.
    """
    try:
        names = model_of_every_joint(robot)
    except InputError:
        return False  # it names none for some joint
    return all(has_motor(name, table_folder(robot)) for name in dict.fromkeys(names))


def has_motor(model: str, folder: Path | None = None) -> bool:
    """Whether the model of a name or a path has figures of its motor.

    Raises:
        UnknownNameError, TableError: its file is missing, or has faults.
    """
    if is_file(model):
        return "motor" in model_table(model, folder)[0] and bool(load_motor(model, folder))
    return any(model.strip().lower() in map(str.lower, (m.model, *m.aliases)) for m in _bundled())


def table_folder(robot: Robot) -> Path | None:
    """The folder of a robot's table, where paths in it begin."""
    return Path(robot.path).parent if robot.path else None


def motors_named(robot: Robot, name: str) -> tuple[Motor, ...]:
    """The same model in every joint of a robot.

    Raises:
        UnknownNameError, TableError: see ``load_motor``.
    """
    return (_with_supply(load_motor(name, table_folder(robot)).motor, robot.servos),) * len(robot.joints)


def motors_sha256(motors: Sequence[Motor]) -> str:
    """SHA-256 of all figures of motors, in their order."""
    return text_sha256(json.dumps([asdict(motor) for motor in motors], sort_keys=True))


def motor_text(model: MotorModel) -> str:
    """The file of a model, which ``load_motor`` reads again."""
    friction = model.motor.friction
    lines = [
        f"model = {_quoted(model.model)}",
        f"aliases = [{', '.join(map(_quoted, model.aliases))}]",
        f"source = {_quoted(model.source)}",
        f"identified = {str(model.identified).lower()}",
        *([f"registers = {_quoted(model.registers)}"] if model.registers else []),
        "",
        "[motor]",
        *(f"{name} = {_number(getattr(model.motor, name))}" for name in _FIGURES),
        "",
        "[motor.friction]",
        *(f"{name} = {_number(getattr(friction, name))}" for name in _COEFFICIENTS),
    ]
    if model.ranges:
        rows = (f"{name} = [{_number(a)}, {_number(b)}]" for name, (a, b) in model.ranges.items())
        lines += ["", "[ranges]", *rows]
    return "\n".join(lines) + "\n"


@cache
def _bundled() -> tuple[MotorModel, ...]:
    return tuple(_model(table, where) for table, where in bundled_tables() if "motor" in table)


def model_of_every_joint(robot: Robot) -> tuple[str, ...]:
    """The servo model of every joint, in table order, as ``[servos]`` of the robot's table names it.

    Raises:
        InputError: the table names no model for a joint.
    """
    models, common = robot.servos.get("models", {}), robot.servos.get("model")
    chosen = {
        name: models.get(name, common) if isinstance(models, Mapping) else common
        for name in robot.joint_names
    }
    missing = [name for name, model in chosen.items() if not isinstance(model, str)]
    if missing or not chosen:
        raise InputError(
            f"{robot.name} names no servo model for {', '.join(missing) or 'any joint'}; write model under "
            "[servos] of its table"
        )
    return tuple(map(str, chosen.values()))


def _with_supply(motor: Motor, servos: Mapping[str, Any]) -> Motor:
    """The motor with the gain, supply and lag that the robot's table gives.

    Raises:
        InputError: one of them is no number, or negative.
    """
    given = {name: servos[key] for key, name in IN_SERVOS.items() if key in servos}
    faults = list(_number_faults("[servos]", given, _FIGURES))
    if faults:
        raise InputError("; ".join(map(str, faults)))
    return replace(motor, **given)


def _model(table: Mapping[str, Any], where: str) -> MotorModel:
    faults = list(_faults(table))
    if faults:
        raise TableError(where, faults)
    figures = dict(table["motor"])
    friction = Friction(**figures.pop("friction", {}))
    return MotorModel(
        str(table["model"]),
        tuple(map(str, table.get("aliases", ()))),
        str(table.get("source", "")),
        table.get("identified") is True,
        Motor(**figures, friction=friction),
        MappingProxyType({name: (float(a), float(b)) for name, (a, b) in table.get("ranges", {}).items()}),
        table["registers"] if isinstance(table.get("registers"), str) else "",
    )


def name_faults(table: Mapping[str, Any]) -> Iterator[Fault]:
    """Faults of what stands at the top of a model's file, before its sections."""
    for key in table:
        if key not in _TOP:
            yield Fault("", key, "is unknown", f"{near(key, _TOP)}Known are {', '.join(_TOP)}")
    if not (isinstance(table.get("model"), str) and table["model"].strip()):
        yield Fault("", "model", f"is {table.get('model')!r}", "Write the name of the servo model")
    aliases = table.get("aliases", [])
    if not (isinstance(aliases, list) and all(isinstance(alias, str) for alias in aliases)):
        yield Fault("", "aliases", f"is {aliases!r}", "Write a list of names")


def _faults(table: Mapping[str, Any]) -> Iterator[Fault]:
    """Every fault of a model's file."""
    yield from name_faults(table)
    motor = table.get("motor")
    if not isinstance(motor, Mapping):
        yield Fault("[motor]", "", "is missing", f"Write at least {', '.join(_NEEDED)} there")
        return
    friction = motor.get("friction", {})
    if not isinstance(friction, Mapping):
        yield Fault("[motor]", "friction", f"is {friction!r}", "Write a table [motor.friction]")
        friction = {}
    for name in _NEEDED:
        if name not in motor:
            yield Fault("[motor]", name, "is missing", "Write a number")
    yield from _number_faults("[motor]", {k: v for k, v in motor.items() if k != "friction"}, _FIGURES)
    yield from _number_faults("[motor.friction]", friction, _COEFFICIENTS)
    ranges = table.get("ranges", {})
    for name, ends in ranges.items() if isinstance(ranges, Mapping) else ():
        pair = isinstance(ends, list) and len(ends) == 2 and all(map(_is_number, ends))
        if name not in (*_FIGURES, *_COEFFICIENTS) or not pair:
            yield Fault("[ranges]", name, f"is {ends!r}", "Write NAME = [LEAST, GREATEST] of a figure")


def _number_faults(place: str, given: Mapping[str, Any], known: tuple[str, ...]) -> Iterator[Fault]:
    for name, value in given.items():
        if name not in known:
            yield Fault(place, name, "is unknown", f"{near(name, known)}Known are {', '.join(known)}")
        elif not (_is_number(value) or (name == "max_current" and value == math.inf)):
            yield Fault(place, name, f"is {value!r}", "Write a finite number")
        elif value < 0 or (value == 0 and name in POSITIVE):
            least = "above 0" if name in POSITIVE else "of at least 0"
            yield Fault(place, name, f"is {value!r}", f"Write a number {least}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _number(value: Any) -> str:
    return repr(float(value))


def _quoted(text: str) -> str:
    escaped = "".join(c if c.isprintable() else " " for c in text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
