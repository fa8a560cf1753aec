"""Writes what a robot's table wants into its servos, one servo at a time, each register read back.

What the lasting registers held before stands in a backup file, which is written back in the same way. No
servo is written to while any of them holds its torque: a change of mode under torque is a jump.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from screwkin.errors import InputError, NoSolutionError, SafetyError
from screwkin.files import read_file, read_json
from screwkin.servo.bus import Bus
from screwkin.servo.examine import decoded, register_bytes
from screwkin.servo.gate import Bounds
from screwkin.servo.line import BusError, LineLostError
from screwkin.servo.profiles import Profile, Register, decode, encode
from screwkin.servo.wanted import FIRST, wanted

_SETTLE = 0.02  # s, that a servo may take to store a lasting register
_TRIES = 3
_PASSES = 3  # a change of mode may set registers that were right
_OWN = ("id", "baud_rate", "lock")  # by these the servo is reached


@dataclass(frozen=True)
class Change:
    """A register of a servo that is written: the bytes that it holds, and those that it gets."""

    joint: str
    id: int
    register: Register
    before: bytes
    after: bytes

    def __str__(self) -> str:
        old, new = (decode(self.register, int.from_bytes(raw, "little")) for raw in (self.before, self.after))
        return f"{self.joint} (servo {self.id}): {self.register.name} from {old} to {new}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        old, new = (decode(self.register, int.from_bytes(raw, "little")) for raw in (self.before, self.after))
        return {
            "joint": self.joint, "id": self.id, "register": self.register.name, "before": old, "after": new
        }  # fmt: skip


@dataclass(frozen=True)
class SavedServo:
    """A servo of a backup: the bytes of its lasting registers by name, in hexadecimal."""

    joint: str
    id: int
    model: str
    registers: Mapping[str, str]


def saved(bus: Bus, bounds: Bounds, k: int) -> SavedServo:
    """What the registers of the servo of joint k hold that ``configure`` could change.

    A servo that answers no readings is first set to answer: it has no other way to say what it holds.

    Raises:
        BusError: it does not answer. LineLostError: the port is gone.
    """
    id, profile = bounds.ids[k], bounds.profiles[k]
    names = [row.register for row in wanted(bounds, k)]
    names += [r.name for r in profile.registers.values() if r.address < profile.ram_begins]
    names = [name for name in dict.fromkeys(names) if profile.register(name).access == "rw"]
    try:
        data = register_bytes(bus, profile, id, names)
    except LineLostError:
        raise
    except BusError:
        level = profile.register("status_level")
        if not bus.present(id):
            raise
        _put(bus, id, level, level.initial.to_bytes(level.width, "little"))
        data = register_bytes(bus, profile, id, names) | {"status_level": bytes(level.width)}
    return SavedServo(bounds.names[k], id, profile.model, {name: raw.hex() for name, raw in data.items()})


def planned_changes(bounds: Bounds, k: int, before: SavedServo) -> tuple[Change, ...]:
    """The registers of the servo of joint k that hold something else than the table wants."""
    profile = bounds.profiles[k]
    held = {name: bytes.fromhex(text) for name, text in before.registers.items()}
    values = decoded(profile, held)
    changes = []
    for row in wanted(bounds, k):
        if not row.allows(values[row.register]):
            register = profile.register(row.register)
            after = encode(register, row.written).to_bytes(register.width, "little")
            changes.append(Change(before.joint, before.id, register, held[register.name], after))
    return tuple(changes)


def reversed_changes(bus: Bus, bounds: Bounds, k: int, backup: SavedServo) -> tuple[Change, ...]:
    """The registers of the servo of joint k that hold something else than they do in a backup.

    Raises:
        BusError: it does not answer. LineLostError: the port is gone.
    """
    now = saved(bus, bounds, k).registers
    profile, mute = bounds.profiles[k], ("status_level", bytes(1).hex())  # read as what it was set to
    return tuple(
        Change(backup.joint, backup.id, profile.register(name), bytes.fromhex(now[name]), bytes.fromhex(text))
        for name, text in backup.registers.items()
        if name not in _OWN and (now[name] != text or (name, text) == mute)
    )


def refuse_torque(bus: Bus, bounds: Bounds) -> None:
    """Refuse to write while servos hold their torque.

    Raises:
        SafetyError: some do, all of them named. LineLostError: the port is gone.
    """
    stiff = []
    for name, id, profile in zip(bounds.names, bounds.ids, bounds.profiles, strict=True):
        register = profile.register("torque_enable")
        try:
            if bus.read(id, register.address, register.width).value:
                stiff.append(f"{name} (servo {id})")
        except LineLostError:
            raise
        except BusError:
            continue  # it is named among the differences
    if stiff:
        raise SafetyError(
            f"torque is on: {', '.join(stiff)}. Hold the robot, and switch the servos' power off and on; "
            "or end a play with --at-end limp"
        )


def write_changes(bus: Bus, profile: Profile, changes: Sequence[Change]) -> None:
    """Write registers of one servo, and read each back; again where one changed another.

    Where a model forgets what was written under its lock, the lock is open meanwhile, and read back too.

    Raises:
        NoSolutionError: a register does not become what was written. LineLostError: the port is gone.
    """
    if not changes:
        return
    last = [one for one in changes if one.register.name == "status_level" and not any(one.after)]
    rest = [one for one in changes if one not in last]
    rest.sort(key=lambda one: one.register.name not in FIRST)
    lock = profile.register("lock") if profile.unlocked_to_last else None
    opening = [Change(changes[0].joint, changes[0].id, lock, b"\1", b"\0")] if lock else []
    for turn in range(_PASSES):
        opened = [one for one in opening if turn == 0 or _held(bus, one) != one.after]
        left = [one for one in rest if turn == 0 or opened or _held(bus, one) != one.after]
        for one in (*opened, *left):
            _put(bus, one.id, one.register, one.after)
        if not left:
            break
    wrong = [f"{one}: it holds {held.hex()} all the same" for one, held in _still(bus, (*opening, *rest))]
    for one in () if wrong else last:
        _put(bus, one.id, one.register, one.after)
    for one in opening:
        _put(bus, one.id, one.register, one.before)
    if wrong:
        advice = "Its table may be locked: switch its power off and on, and try again"
        raise NoSolutionError(f"{'; '.join(wrong)}. {advice}")


def _still(bus: Bus, changes: Sequence[Change]) -> Iterator[tuple[Change, bytes]]:
    for one in changes:
        if (held := _held(bus, one)) != one.after:
            yield one, held


def _held(bus: Bus, one: Change) -> bytes:
    for _ in range(_TRIES - 1):
        try:
            return bus.read(one.id, one.register.address, one.register.width).data
        except LineLostError:
            raise
        except BusError:
            bus.clock.sleep(_SETTLE)
    return bus.read(one.id, one.register.address, one.register.width).data


def _put(bus: Bus, id: int, register: Register, data: bytes) -> None:
    """Write to one servo in the packet that nobody answers, whatever its status level."""
    bus.sync_write(register.address, register.width, {id: data})
    bus.clock.sleep(_SETTLE)


def backup_data(robot: str, servos: Sequence[SavedServo]) -> dict[str, Any]:
    """A backup as JSON data."""
    return {"kind": "servo registers", "robot": robot, "servos": [asdict(one) for one in servos]}


def load_backup(path: Path, bounds: Bounds) -> tuple[SavedServo, ...]:
    """The servos of a backup file, each of them one of the robot's.

    Raises:
        InputError: not there, no backup, or of other servos.
    """
    try:
        data = read_json(read_file(path).decode())
        if data["kind"] != "servo registers":
            raise KeyError("kind")
        servos = tuple(SavedServo(**row) for row in data["servos"])
        sizes = [[(n, len(bytes.fromhex(t))) for n, t in one.registers.items()] for one in servos]
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, KeyError, TypeError, ValueError, AttributeError):
        raise InputError(f"{path} is no backup of servos; expected one that bus configure wrote") from None
    for one, places in zip(servos, sizes, strict=True):
        k = bounds.ids.index(one.id) if one.id in bounds.ids else -1
        if k < 0 or bounds.names[k] != one.joint or bounds.profiles[k].model != one.model:
            raise InputError(f"{path}: {one.joint} (servo {one.id}, {one.model}) is no servo of this robot")
        for name, size in places:
            register = bounds.profiles[k].register(name)
            if size != register.width or register.access != "rw":
                raise InputError(f"{path}: {one.joint}, {name}: {size} bytes, expected {register.width}")
    return servos
