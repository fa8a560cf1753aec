"""What the registers of a servo must hold for a goal to mean what the robot's table means by it.

A servo in another mode, reversed, offset, geared down, limited or weakened by its own registers takes a goal
for something else, or does not reach it. A servo that does not shut itself down, or does not answer, is not
safe to play on. What is right follows from the profile (a servo as it comes from the maker) and the robot's
table: the positions and the torque that the gate may ask of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from screwkin.servo.gate import Bounds
from screwkin.servo.modes import mode_registers, servo_mode
from screwkin.servo.profiles import Profile

_AS_MADE: Mapping[str, str] = {
    "torque_control": "its goals are currents",
    "drive_mode": "it turns the other way, or takes speeds for times",
    "homing_offset": "its zero is elsewhere",
    "multi_turn_offset": "its zero is elsewhere",
    "resolution_divider": "its ticks are coarser",
    "acceleration": "it approaches goals by a ramp of its own",
    "shutdown": "it shuts itself down for other reasons",
    "alarm_led": "it shows other alarms",
    "status_level": "it does not answer everything",
}
"""Registers that hold what the maker put there, and what a servo does with another value."""
FIRST = ("status_level", "operating_mode", "drive_mode")
"""Written first: without answers nothing is confirmed, and a change of mode sets others."""
_NO_SECOND_ID = 253
_DELAY = 250  # the return delay that plays are planned with: 500 microseconds


@dataclass(frozen=True)
class Wanted:
    """A register that must hold ``low`` to ``high``, else gets ``written``; ``why``: what is wrong then."""

    register: str
    low: int
    high: int
    written: int
    why: str

    def allows(self, value: int) -> bool:
        """Whether a value is right."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Difference:
    """A register of a servo that holds something else than the robot's table wants; ``mend``: what to do."""

    joint: str
    id: int
    register: str
    found: str
    expected: str
    mend: str
    why: str = ""

    def __str__(self) -> str:
        who = f"{self.joint} (servo {self.id})" if self.joint else f"servo {self.id}"
        why = f" ({self.why})" if self.why else ""
        return f"{who}: {self.register} is {self.found}, expected {self.expected}{why}; {self.mend}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return asdict(self)


def wanted(bounds: Bounds, k: int) -> tuple[Wanted, ...]:
    """What the registers of the servo of joint k must hold, in the order in which they are to be written.

    Args:
        bounds: of the robot, with the whole torque of its table.
        k: of the joint.
    """
    profile = bounds.profiles[k]
    rows = [row for row in _rows(bounds, k) if row.register in profile.registers]
    return tuple(sorted(rows, key=lambda row: row.register not in FIRST))


def _rows(bounds: Bounds, k: int) -> Iterator[Wanted]:
    profile = bounds.profiles[k]

    def made(name: str) -> int:
        return profile.registers[name].initial if name in profile.registers else 0

    def most(name: str) -> int:
        return profile.registers[name].high if name in profile.registers else 0

    for name, why in _AS_MADE.items():
        yield Wanted(name, made(name), made(name), made(name), why)
    if profile.modes:
        joint = profile.modes["joint"]
        yield Wanted("operating_mode", joint, joint, joint, "its goals are no angles")
    stops = "it refuses or ends short of goals within the joint's limits"
    low, high = int(bounds.low[k]), int(bounds.high[k])
    yield Wanted("angle_limit_low", -(2**31), low, made("angle_limit_low"), stops)
    yield Wanted("angle_limit_high", high, 2**31, made("angle_limit_high"), stops)
    weak = "it is weaker than the robot's table allows"
    torque = min(made("max_torque"), int(bounds.torque[k]))
    yield Wanted("max_torque", torque, most("max_torque"), made("max_torque"), weak)
    yield Wanted("current_limit", made("current_limit"), most("current_limit"), made("current_limit"), weak)
    speed = min(made("velocity_limit"), int(bounds.speed[k]))
    yield Wanted("velocity_limit", speed, most("velocity_limit"), made("velocity_limit"), "it is slower")
    delay = made("return_delay")
    yield Wanted("return_delay", 0, max(delay, _DELAY), delay, "it answers later than planned")
    yield Wanted("secondary_id", _NO_SECOND_ID, 255, 255, "it obeys the goals of another servo too")


def compared(bounds: Bounds, k: int, values: Mapping[str, int], mend: str) -> Iterator[Difference]:
    """How the registers of the servo of joint k differ from what is wanted.

    Args:
        bounds: of the robot.
        k: of the joint.
        values: of its registers by name, signs decoded; at least those of ``wanted``.
        mend: what mends them.
    """
    profile = bounds.profiles[k]
    mode = servo_mode(profile, values)
    for row in wanted(bounds, k):
        found = values[row.register]
        if not row.allows(found):
            named = f"{found} ({mode} mode)" if row.register in mode_registers(profile) else str(found)
            yield Difference(
                bounds.names[k], bounds.ids[k], row.register, named, _span(row, profile), mend, row.why
            )


def _span(row: Wanted, profile: Profile) -> str:
    register = profile.register(row.register)
    if row.low == row.high:
        return f"{row.low} (joint mode)" if row.register == "operating_mode" else str(row.low)
    if row.low <= register.low:
        return f"at most {row.high}"
    return f"at least {row.low}" if row.high >= register.high else f"{row.low} to {row.high}"
