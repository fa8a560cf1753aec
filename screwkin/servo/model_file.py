"""What the file of a servo model says about its bus: vocabulary, and every fault of it at once.

    model = "MY-1"                        # aliases = ["MY1"]
    [sheet]                               # the maker's figures
    source = "where they stand"
    stall_torque = 1.5                    # N m, at this voltage; stall_current [A] where it is known
    no_load_rpm = 59.0
    voltage = 12.0
    [bus]
    source = "where its table stands"
    verified = true                       # whether its model number is known
    protocol = 1.0                        # 2.0, "FT-SCS"
    number = 12                           # of the model
    ticks = 1024                          # of the whole range
    range_deg = 300.0
    centre = 512
    speed_unit_rpm = 0.111
    load_unit = 0.0009775                 # share of the greatest torque
    baud = "divisor"                      # 2,000,000 / (value + 1); or a list: the rate of each value
    reads = ["sync", "bulk"]              # packets that several servos answer in turn
    ram_begins = 24                       # addresses before it outlast power
    modes = { joint = 3, velocity = 1 }   # values of operating_mode, where there is one
    [registers]                           # one row each; see ``profiles.Register``
    id = { address = 3, width = 1, high = 253, initial = 1 }
    …

``[motor]`` and what belongs to it is read by ``motors.library``. A file may hold either, or both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from typing import Any, Literal, get_args

from screwkin.errors import Fault, near
from screwkin.motors.library import name_faults
from screwkin.servo.protocols import CODECS

Sign = Literal["none", "twos", "bit-10", "bit-11", "bit-15", "from-2048"]
"""How a register holds negative values: not at all, as two's complement, by a bit, or as counts from 2048."""
Mode = Literal[
    "joint",
    "wheel",
    "multi-turn",
    "velocity",
    "pwm",
    "current",
    "extended position",
    "current-based position",
    "step",
    "unknown",
]
"""What a goal means to a servo; only in ``joint`` it is an angle within the servo's own limits."""
ALARMS = ("voltage", "overheat", "overload")
NEEDED_REGISTERS = (
    "id",
    "model_number",
    "baud_rate",
    "return_delay",
    "status_level",
    "angle_limit_low",
    "angle_limit_high",
    "voltage_limit_low",
    "voltage_limit_high",
    "temperature_limit",
    "shutdown",
    "torque_enable",
    "goal_position",
    "moving_speed",
    "torque_limit",
    "present_position",
    "present_speed",
    "present_load",
    "present_voltage",
    "present_temperature",
)
"""What the bus, the gate and the watchdogs read and write on every servo."""

_WIDTHS = (1, 2, 4)
_OF_THE_MODEL = ("tick", "speed", "load", "")
_SI = {"V": 1.0, "A": 1.0, "mA": 1e-3, "us": 1e-6, "ms": 1e-3, "%": 0.01, "degC": 1.0, "pwm": 1 / 885}
_UNIT = re.compile(rf"(\d+(?:\.\d+)?)?({'|'.join(_SI)})")


def unit_scale(unit: str) -> float:
    """SI value of one count of a register's unit, such as ``0.1V`` or ``2us``; 1 for those of the model."""
    if unit in _OF_THE_MODEL:
        return 1.0
    matched = _UNIT.fullmatch(unit)
    return float(matched[1] or 1.0) * _SI[matched[2]] if matched else math.nan


def value_range(width: int, sign: Sign) -> tuple[int, int]:
    """Least and greatest value that a register of so many bytes can hold."""
    if sign == "none":
        return 0, (1 << (8 * width)) - 1
    if sign == "twos":
        return -(1 << (8 * width - 1)), (1 << (8 * width - 1)) - 1
    if sign == "from-2048":
        return -2048, (1 << (8 * width)) - 2049
    most = (1 << int(sign.removeprefix("bit-"))) - 1
    return -most, most


def bus_faults(table: Mapping[str, Any]) -> Iterator[Fault]:
    """Every fault of ``[sheet]``, ``[bus]`` and ``[registers]``, and of the names at the top."""
    yield from name_faults(table)
    for section, kinds, needed in (("sheet", _SHEET, _SHEET_NEEDED), ("bus", _BUS, _BUS_NEEDED)):
        yield from _section_faults(f"[{section}]", table.get(section), kinds, needed)
    rows = table.get("registers")
    if not isinstance(rows, Mapping):
        yield Fault("[registers]", "", "is missing", "Write one row for each register")
        return
    sound = []
    for name, row in rows.items():
        faults = list(_row_faults(name, row))
        yield from faults
        sound += [] if faults else [(row["address"], row["address"] + row["width"], name)]
    for (_, end, one), (begin, _, other) in pairwise(sorted(sound)):
        if begin < end:
            yield Fault("[registers]", other, f"lies within {one}", "Correct address or width of one of them")
    for name in NEEDED_REGISTERS:
        if name not in rows:
            yield Fault("[registers]", name, "is missing", "Write { address = …, width = … }")
    bus = table.get("bus")
    if isinstance(bus, Mapping) and bool(bus.get("modes")) != ("operating_mode" in rows):
        fix = "Write both modes and the register operating_mode, or neither"
        yield Fault("[bus]", "modes", f"is {bus.get('modes')!r}", fix)
    for key, name in (("indirect", "firmware"), ("fast_sync_read", "firmware"), ("unlocked_to_last", "lock")):
        if isinstance(bus, Mapping) and bus.get(key) and name not in rows:
            yield Fault("[registers]", name, f"is missing, and [bus] has {key}", f"Write {name}, or no {key}")


def _section_faults(
    place: str, given: object, kinds: Mapping[str, _Kind], needed: tuple[str, ...]
) -> Iterator[Fault]:
    if not isinstance(given, Mapping):
        yield Fault(place, "", "is missing", f"Write at least {', '.join(needed)} there")
        return
    for key in needed:
        if key not in given:
            yield Fault(place, key, "is missing", f"Write {kinds[key][1]}")
    for key, value in given.items():
        if key not in kinds:
            yield Fault(place, key, "is unknown", f"{near(key, kinds)}Known are {', '.join(kinds)}")
        elif not kinds[key][0](value):
            yield Fault(place, key, f"is {value!r}", f"Write {kinds[key][1]}")


def _row_faults(name: str, row: object) -> Iterator[Fault]:
    place = f"[registers] {name}"
    faults = list(_section_faults(place, row, _ROW, ("address", "width")))
    yield from faults
    if faults or not isinstance(row, Mapping):
        return
    least, most = value_range(row["width"], row.get("sign", "none"))
    low, high = row.get("low", 0), row.get("high", most)
    initial = row.get("initial", 0)
    if not least <= low <= high <= most:
        fix = f"Write bounds within {least} to {most}, what {row['width']} bytes hold"
        yield Fault(place, "high", f"is {high}, low is {low}", fix)
    elif not (low <= initial <= high or "initial" not in row):
        yield Fault(place, "initial", f"is {initial}", f"Write {low} to {high}")


def _integer(value: object, low: float = -math.inf, high: float = math.inf) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high


def _positive(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf


def _rates(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(_integer(rate, 1) for rate in value)


def _numbers(names: tuple[str, ...], high: float) -> Callable[[object], bool]:
    """Whether a value is a table of some of the names, each with an integer of its own."""
    return lambda value: (
        isinstance(value, Mapping)
        and set(value) <= set(names)
        and all(_integer(number, 0, high) for number in value.values())
        and len(set(value.values())) == len(value)
    )


_Kind = tuple[Callable[[object], bool], str]
_TEXT: _Kind = (lambda value: isinstance(value, str) and bool(value.strip()), "a text")
_ABOVE_0: _Kind = (_positive, "a number above 0")
_WHOLE: _Kind = (lambda value: _integer(value, 0, 0xFFFF), "an integer from 0 to 65535")
_ANY: _Kind = (_integer, "an integer")
_SHEET_NEEDED = ("source", "stall_torque", "no_load_rpm", "voltage")
_SHEET: Mapping[str, _Kind] = {
    "source": _TEXT,
    "stall_torque": _ABOVE_0,
    "stall_current": _ABOVE_0,
    "no_load_rpm": _ABOVE_0,
    "voltage": _ABOVE_0,
}
_BUS_NEEDED = (
    "source",
    "protocol",
    "number",
    "ticks",
    "range_deg",
    "centre",
    "speed_unit_rpm",
    "load_unit",
    "baud",
    "ram_begins",
)
_MODES = tuple(mode for mode in get_args(Mode) if mode != "unknown")
_INDIRECT = ("addresses", "data", "count")
_BUS: Mapping[str, _Kind] = {
    "source": _TEXT,
    "verified": (lambda value: isinstance(value, bool), "true or false"),
    "protocol": (
        lambda value: isinstance(value, float | int | str) and value in CODECS,
        " or ".join(f'"{name}"' if isinstance(name, str) else str(name) for name in CODECS),
    ),
    "number": _WHOLE,
    "ticks": (lambda value: _integer(value, 2, 0xFFFF), "an integer above 1"),
    "range_deg": (lambda value: _positive(value) and float(str(value)) <= 360, "a number of degrees to 360"),
    "centre": _WHOLE,
    "speed_unit_rpm": _ABOVE_0,
    "load_unit": _ABOVE_0,
    "baud": (lambda value: value == "divisor" or _rates(value), '"divisor" or a list of rates'),
    "baud_from_250": (_rates, "the rates of the values from 250 on"),
    "reads": (
        lambda value: isinstance(value, list) and all(kind in ("sync", "bulk") for kind in value),
        'a list of "sync" and "bulk"',
    ),
    "ram_begins": _WHOLE,
    "modes": (
        lambda value: _numbers(_MODES, 255)(value) and isinstance(value, Mapping) and "joint" in value,
        f"joint and others of {', '.join(_MODES)}, each with its number",
    ),
    "multi_turn": (lambda value: value in ("greatest", "zero"), '"greatest" or "zero": both angle limits'),
    "alarms": (
        lambda value: _numbers(ALARMS, 7)(value) and isinstance(value, Mapping) and len(value) == len(ALARMS),
        f"the bits of {', '.join(ALARMS)}",
    ),
    "indirect": (
        lambda value: (
            isinstance(value, Mapping)
            and set(_INDIRECT) <= set(value) <= {*_INDIRECT, "firmware"}
            and all(map(_integer, value.values()))
        ),
        f"{', '.join(_INDIRECT)}; and firmware, the first that has it there",
    ),
    "fast_sync_read": (lambda value: _integer(value, 1, 255), "the first firmware that has it"),
    "reverse_bit": (lambda value: _integer(value, 0, 7), "the bit of drive_mode that reverses"),
    "shutdown_clears": (
        lambda value: value in ("torque_limit", "torque_enable", "nothing"),
        '"torque_limit", "torque_enable" or "nothing": what a shutdown sets to 0',
    ),
    "unlocked_to_last": (lambda value: isinstance(value, bool), "true or false"),
    "homing_sign": (lambda value: value in (1, -1), "1 or -1"),
}
_ROW: Mapping[str, _Kind] = {
    "address": _WHOLE,
    "width": (lambda value: _integer(value) and value in _WIDTHS, "1, 2 or 4"),
    "access": (lambda value: value in ("r", "rw"), '"r" or "rw"'),
    "unit": (
        lambda value: isinstance(value, str) and not math.isnan(unit_scale(value)),
        f"tick, speed, load, or a number and one of {', '.join(_SI)}, such as 0.1V",
    ),
    "sign": (lambda value: value in get_args(Sign), " or ".join(f'"{sign}"' for sign in get_args(Sign))),
    "low": _ANY,
    "high": _ANY,
    "initial": _ANY,
}
