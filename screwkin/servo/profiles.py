"""Servo models as data: registers, units, and the pair of functions between SI and what a register holds.

A model is one file, see ``model_file``; the bundled ones stand in ``motors/models``. The names of registers
are the same for all models, whatever the maker calls them, so that the same code drives each: ``max_torque``
is also the maker's PWM Limit, ``torque_limit`` its Goal PWM, ``moving_speed`` its Profile Velocity,
``present_load`` what it measures the load by, be that its Present Current. Ticks, speed units and load units
occur only here and in what stands on the bus; everything above is in rad, rad/s and shares of the greatest
torque.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from screwkin.errors import InputError, TableError, UnknownNameError
from screwkin.model.servo_models import bundled_tables, is_file, model_table
from screwkin.motors.library import load_motor, motor_models
from screwkin.servo.model_file import Mode, Sign, bus_faults, unit_scale, value_range
from screwkin.servo.packets import ProtocolName

NO_SPEED_LIMIT = 0
"""What ``moving_speed`` holds when the servo may go as fast as it can."""

_RPM = 2 * math.pi / 60  # rad/s
_DIVISOR_CLOCK = 2_000_000
_ALARM_BITS = {"voltage": 0, "overheat": 2, "overload": 5}
_FROM_250 = 250  # baud_rate values that some models have besides the divisors


@dataclass(frozen=True)
class Register:
    """A place of the register table: ``width`` bytes at ``address``, the low byte first.

    ``low`` and ``high`` bound the value (after its sign is decoded); ``sign`` says how negative values are
    written, see ``model_file.Sign``. ``unit`` is what one count is: the model's ``tick``, ``speed`` or
    ``load``, or a number and a unit.
    """

    name: str
    address: int
    width: int
    access: Literal["r", "rw"] = "rw"
    unit: str = ""
    low: int = 0
    high: int = 0
    initial: int = 0
    sign: Sign = "none"

    @cached_property
    def end(self) -> int:
        """The address after its last byte."""
        return self.address + self.width

    @cached_property
    def sign_bit(self) -> int:
        """The bit that makes a value negative, 0 if none does."""
        return 1 << int(self.sign[4:]) if self.sign.startswith("bit-") else 0


@dataclass(frozen=True)
class Indirect:
    """A table within the table: address n of ``count``, 2 bytes wide, says what byte n of the data is.

    ``firmware`` is the first that has it at these places.
    """

    addresses: int
    data: int
    count: int
    firmware: int = 0


@dataclass(frozen=True)
class Profile:
    """A servo model. Angles are measured from the servo's centre, positive towards greater ticks.

    ``number`` is what its ``model_number`` register holds, 0 where it is not published.

    ``range_deg / ticks`` is one tick; the greatest tick is ``ticks - 1``. Speed unit in rad/s, load unit as a
    share of the greatest torque, no-load speed in rad/s, stall torque in N m, nominal voltage in V, stall
    current in A, 0 where it is not published.

    ``modes`` are the values of its ``operating_mode`` register, empty where it has none; ``indirect`` its
    table of indirect addresses; ``fast_sync_read`` the first firmware with that instruction;
    ``multi_turn`` which value of both angle limits lets it turn over several turns; ``alarms`` the bits of
    its shutdown and hardware error registers; ``reverse_bit`` that of ``drive_mode`` by which it turns the
    other way; a position shown is the true one plus ``homing_sign`` times ``homing_offset``;
    ``shutdown_clears`` is the register that a shutdown sets to 0; ``unlocked_to_last``: what is written to
    its lasting registers is forgotten with the power unless ``lock`` is 0 meanwhile (elsewhere a ``lock`` of
    1 refuses them until the power goes off); ``source`` is where its table stands, ``sheet`` where its
    figures do.
    """

    model: str
    number: int
    protocol: ProtocolName
    ticks: int
    range_deg: float
    centre: int
    speed_unit: float
    load_unit: float
    no_load_speed: float
    stall_torque: float
    voltage: float
    has_sync_read: bool
    has_bulk_read: bool
    verified: bool
    ram_begins: int
    baud_table: tuple[int, ...]
    registers: Mapping[str, Register]
    aliases: tuple[str, ...] = field(default=())
    modes: Mapping[Mode, int] = field(default_factory=lambda: MappingProxyType({}))
    indirect: Indirect | None = None
    fast_sync_read: int | None = None
    multi_turn: Literal["", "greatest", "zero"] = ""
    alarms: Mapping[str, int] = field(default_factory=lambda: MappingProxyType(_ALARM_BITS))
    reverse_bit: int = 0
    homing_sign: int = 1
    shutdown_clears: Literal["torque_limit", "torque_enable", "nothing"] = "torque_limit"
    unlocked_to_last: bool = False
    stall_current: float = 0.0
    baud_from_250: tuple[int, ...] = ()
    source: str = ""
    sheet: str = ""

    @cached_property
    def tick(self) -> float:
        """One tick [rad]."""
        return math.radians(self.range_deg) / self.ticks

    @property
    def lower(self) -> float:
        """The least angle from the centre that a goal can hold [rad]."""
        return (0 - self.centre) * self.tick

    @property
    def upper(self) -> float:
        """The greatest angle from the centre that a goal can hold [rad]."""
        return (self.ticks - 1 - self.centre) * self.tick

    @property
    def size(self) -> int:
        """Bytes of the register table."""
        return max(register.end for register in self.registers.values())

    def register(self, name: str) -> Register:
        """The register of that name.

        Raises:
            UnknownNameError: this model has none.
        """
        if name not in self.registers:
            raise UnknownNameError(f"register of {self.model}", name, tuple(self.registers))
        return self.registers[name]


@cache
def profile_models() -> tuple[str, ...]:
    """Models that have a profile."""
    return tuple(profile.model for profile in _profiles())


def load_profile(model: str, folder: Path | None = None) -> Profile:
    """The profile of a servo model; case and the maker's aliases do not matter.

    A user's own file has ``[registers]`` of its own (see ``model_file``), or names with
    ``registers = "AX-12A"`` the model whose registers the bus finds in it.

    Args:
        model: a name, or a path that ends in ``.toml``.
        folder: where relative paths begin, besides the working folder.

    Raises:
        UnknownNameError: there is no such model, or only its motor is known; it lists those there are.
        TableError: the faults of the user's file.
    """
    wanted, file = model.strip().lower(), is_file(model)
    if file:
        table, where = model_table(model, folder)
        if isinstance(table.get("registers"), Mapping) or "bus" in table:
            return _profile(table, where)
        wanted = load_motor(model, folder).registers.lower()
    for profile in _profiles():
        if wanted in {name.lower() for name in (profile.model, *profile.aliases)}:
            return profile
    simulated = file or wanted in map(str.lower, motor_models())
    what = "register table of servo model (its motor can only be simulated)" if simulated else "servo model"
    raise UnknownNameError(what, model, profile_models())


def ticks_from_radians(profile: Profile, angle: float) -> int:
    """The position register for an angle from the servo's centre [rad], rounded to the nearest tick.

    Raises:
        InputError: no number, or outside what the servo can turn.
    """
    if not math.isfinite(angle):
        raise InputError(f"an angle for a {profile.model} is {angle!r}; give a finite number in rad")
    ticks = round(angle / profile.tick) + profile.centre
    if not 0 <= ticks < profile.ticks:
        raise InputError(
            f"angle {angle:.4f} rad ({math.degrees(angle):.2f} deg, tick {ticks}) is outside the range of a "
            f"{profile.model}: {profile.lower:.4f} to {profile.upper:.4f} rad from its centre "
            f"(ticks 0 to {profile.ticks - 1})"
        )
    return ticks


def radians_from_ticks(profile: Profile, ticks: int) -> float:
    """The angle from the servo's centre [rad] of a position; readings may lie beyond the range of goals."""
    return (ticks - profile.centre) * profile.tick


def speed_from_rate(profile: Profile, rate: float) -> int:
    """The speed register for a speed limit [rad/s], rounded to the nearest unit, at least 1.

    A register of 0 means no limit, so a small rate gives 1 and a rate of 0 is refused; who wants no limit
    writes ``NO_SPEED_LIMIT``.

    Raises:
        InputError: no number, not positive, or above what the register can hold.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise InputError(
            f"a speed limit for a {profile.model} is {rate!r} rad/s; give a positive number "
            "(0 would mean no limit)"
        )
    speed = max(1, round(rate / profile.speed_unit))
    high = profile.register("moving_speed").high
    if speed > high:
        raise InputError(
            f"speed limit {rate:.4g} rad/s ({speed} units) is outside the range of a {profile.model}: "
            f"{profile.speed_unit:.4g} to {high * profile.speed_unit:.4g} rad/s (1 to {high} units)"
        )
    return speed


def rate_from_speed(profile: Profile, speed: int) -> float:
    """The rate [rad/s] of a speed in units, sign decoded (see ``decode``)."""
    return speed * profile.speed_unit


def decode(register: Register, raw: int) -> int:
    """The value of what a register holds on the bus, its sign decoded.

    On servos with a bit for the direction, it stands for clockwise: towards smaller ticks, negative here.
    """
    if register.sign == "none":
        return raw
    if register.sign == "twos" and raw >= 1 << (8 * register.width - 1):
        return raw - (1 << (8 * register.width))
    if register.sign == "from-2048":
        return raw - 2048
    if bit := register.sign_bit:
        return -(raw & ~bit) if raw & bit else raw
    return raw


def encode(register: Register, value: int) -> int:
    """What a register holds on the bus for a value: the inverse of ``decode``.

    Raises:
        InputError: outside the register's range.
    """
    if not register.low <= value <= register.high:
        raise InputError(
            f"register {register.name} cannot hold {value}; its range is {register.low} to {register.high}"
        )
    if register.sign == "from-2048":
        return value + 2048
    if bit := register.sign_bit:
        return bit | -value if value < 0 else value
    return value % (1 << (8 * register.width))


def physical(profile: Profile, name: str, raw: int) -> float:
    """What a register holds on the bus, in rad, rad/s, share of the greatest torque, V, A, s, degree Celsius.

    Raises:
        UnknownNameError: the model has no such register.
    """
    register = profile.register(name)
    value = decode(register, raw)
    if register.unit == "tick":
        return radians_from_ticks(profile, value) if name.endswith("position") else value * profile.tick
    if register.unit == "speed":
        return rate_from_speed(profile, value)
    if register.unit == "load":
        return value * profile.load_unit
    return value * unit_scale(register.unit)


def baud_from_register(profile: Profile, value: int) -> int:
    """The baud rate that a ``baud_rate`` register stands for.

    Raises:
        InputError: the model does not know the value.
    """
    if profile.baud_from_250 and 0 <= value - _FROM_250 < len(profile.baud_from_250):
        return profile.baud_from_250[value - _FROM_250]
    if not profile.baud_table:
        return _DIVISOR_CLOCK // (value + 1)
    if not 0 <= value < len(profile.baud_table):
        raise InputError(f"{profile.model} knows no baud rate {value}; 0 to {len(profile.baud_table) - 1}")
    return profile.baud_table[value]


def register_from_baud(profile: Profile, baud: int) -> int:
    """The ``baud_rate`` register whose rate is within 3 % of ``baud``: what both ends of a line tolerate.

    Raises:
        InputError: the model has none.
    """
    values = range(len(profile.baud_table) or profile.register("baud_rate").high + 1)
    best = min(values, key=lambda value: abs(baud_from_register(profile, value) - baud))
    nearest = baud_from_register(profile, best)
    if abs(nearest - baud) > 0.03 * baud:
        raise InputError(f"a {profile.model} cannot talk at {baud} baud; nearest is {nearest}")
    return best


@cache
def _profiles() -> tuple[Profile, ...]:
    profiles = [_profile(table, where) for table, where in bundled_tables() if "bus" in table]
    return tuple(sorted(profiles, key=lambda profile: profile.model))


def _profile(table: Mapping[str, Any], where: str) -> Profile:
    """The profile that a file says, if it has no faults."""
    if faults := list(bus_faults(table)):
        raise TableError(where, faults)
    sheet, bus = dict(table["sheet"]), dict(table["bus"])
    reads, baud = bus.pop("reads", ()), bus.pop("baud")
    return Profile(
        model=table["model"],
        aliases=tuple(table.get("aliases", ())),
        sheet=sheet.pop("source"),
        no_load_speed=sheet.pop("no_load_rpm") * _RPM,
        speed_unit=bus.pop("speed_unit_rpm") * _RPM,
        has_sync_read="sync" in reads,
        has_bulk_read="bulk" in reads,
        verified=bus.pop("verified", True),
        baud_table=() if baud == "divisor" else tuple(baud),
        baud_from_250=tuple(bus.pop("baud_from_250", ())),
        modes=MappingProxyType(bus.pop("modes", {})),
        alarms=MappingProxyType(bus.pop("alarms", _ALARM_BITS)),
        indirect=Indirect(**bus.pop("indirect")) if "indirect" in bus else None,
        registers=MappingProxyType({name: _register(name, row) for name, row in table["registers"].items()}),
        **sheet,
        **bus,
    )


def _register(name: str, row: Mapping[str, Any]) -> Register:
    _, most = value_range(row["width"], row.get("sign", "none"))
    low, high = row.get("low", 0), row.get("high", most)
    return Register(name, **{"low": low, "high": high, "initial": min(max(0, low), high), **row})
