"""A virtual servo: a register table with a body behind it, that answers commands as the makers' manuals say.

What the manuals say and software stumbles over is there: what a goal means depends on mode, direction, offset
and divider; writing a goal switches torque on (protocol 1.0); the lasting part of the table is locked while
torque is on, or by ``lock``; a goal beyond the servo's own limits is refused; an alarm named in ``shutdown``
takes the torque away, each series in its way; a reset forgets the rest; a bus that falls silent stops a servo
that has a watchdog.
"""

from __future__ import annotations

import math

from screwkin.servo.model_file import Mode, unit_scale
from screwkin.servo.modes import mode_registers, servo_mode
from screwkin.servo.packets import Kind, Request, RequestOutcome
from screwkin.servo.profiles import Profile, Register, baud_from_register, decode, encode, register_from_baud
from screwkin.servo.protocols import codec
from screwkin.servo.virtual.body import OVERHEAT, OVERLOAD, VOLTAGE, Body, Drive
from screwkin.servo.virtual.drive import drive_of, torque_share
from screwkin.servo.virtual.frame import FRAME_REGISTERS, CountingFrame, frame_of
from screwkin.servo.virtual.rules import TRIPPED, write_outcome

BOOT = 0.2
"""How long a servo is silent after a reset [s]."""

_LEAST_VOLTAGE = 4.0  # V, below which nothing runs
_LEAST_OF_A_SMALL_ONE = 3.0  # V, the same of servos for less than 6 V
_STANDBY = 0.05  # A
_ALARMS = {"voltage": VOLTAGE, "overheat": OVERHEAT, "overload": OVERLOAD}
_WATCHDOG_UNIT = 0.02  # s
_AT_POWER_UP = (("torque_limit", "max_torque"), ("goal_current", "current_limit"))


class VirtualServo:
    """A servo on a virtual bus. ``body`` may be changed from outside: load, voltage, temperature.

    Args:
        profile: the model.
        id: on the bus.
        angle: where it stands, from its centre [rad].
        stiffness: of its joint [N m/rad]; infinite: rigid.
        baud: the rate it is set to.
        return_delay: from the end of a command to the beginning of the answer [s].
    """

    def __init__(
        self,
        profile: Profile,
        id: int,
        angle: float = 0.0,
        stiffness: float = math.inf,
        baud: int = 1_000_000,
        return_delay: float = 0.0,
    ) -> None:
        self.profile = profile
        self._codec = codec(profile.protocol)
        self._facts = self._codec.FACTS
        self.body = Body(profile.stall_torque, profile.voltage, angle, stiffness)
        shadows = profile.indirect
        self.table = bytearray(max(profile.size, shadows.data + shadows.count if shadows else 0))
        self._id_at = profile.register("id").address
        self._places = {
            name: (register, slice(register.address, register.end))
            for name, register in profile.registers.items()
        }
        self.silent_until = -math.inf
        self._registered: tuple[int, bytes] | None = None
        self._alarms = 0
        self._heard = -math.inf
        self._frame: tuple[Mode, CountingFrame] | None = None
        for register in profile.registers.values():
            self._put(register, register.initial)
        if shadows:
            for k in range(shadows.count):
                at = shadows.addresses + 2 * k
                self.table[at : at + 2] = (shadows.data + k).to_bytes(2, "little")
        self._lasting = bytes(self.table[: profile.ram_begins])
        self.put("id", id)
        self.put("baud_rate", register_from_baud(profile, baud))
        self.put("return_delay", round(return_delay / 2e-6))
        self._hold_still()

    @property
    def id(self) -> int:
        """Its id on the bus."""
        return self.table[self._id_at]

    @property
    def second_id(self) -> int:
        """Another id whose commands it obeys without an answer; that of everyone where it has none."""
        second = self.get("secondary_id") if "secondary_id" in self._places else 0xFF
        return second if second < self.profile.register("id").high + 1 else 0xFE

    @property
    def baud(self) -> int:
        """The rate it listens and talks at."""
        return baud_from_register(self.profile, self.get("baud_rate"))

    @property
    def mode(self) -> Mode:
        """What it takes goals for."""
        return self._settings()[0]

    @property
    def torque_on(self) -> bool:
        """Whether its motor has any torque."""
        return bool(self.get("torque_enable")) and self._torque() > 0

    @property
    def current(self) -> float:
        """What it takes from the supply [A]."""
        return _STANDBY + (abs(self.body.effort) * self.profile.stall_current if self.torque_on else 0.0)

    @property
    def alarms(self) -> int:
        """Bits of what is wrong with it now."""
        volts = round(self.body.supply * 10)
        low, high = self.get("voltage_limit_low"), self.get("voltage_limit_high")
        return (
            (0 if low <= volts <= high else VOLTAGE)
            | (OVERHEAT if self.body.temperature > self.get("temperature_limit") else 0)
            | (OVERLOAD if self.body.overloaded >= self.body.patience else 0)
            | self._alarms
        )

    def get(self, name: str) -> int:
        """The value of a register, its sign decoded."""
        register, place = self._places[name]
        return decode(register, int.from_bytes(self.table[place], "little"))

    def put(self, name: str, value: int) -> None:
        """Set a register from inside, whatever its access, for good; the value must fit its range."""
        register = self.profile.register(name)
        self._put(register, value)
        self._frame = None
        if register.end <= self.profile.ram_begins:
            lasting = bytearray(self._lasting)
            lasting[register.address : register.end] = self.table[register.address : register.end]
            self._lasting = bytes(lasting)

    def advance(self, time: float) -> None:
        """Go on to a time [s]: move, warm up, and take the torque away where an alarm asks for it."""
        if time <= self.body.time:
            return
        if "bus_watchdog" in self._places and self.get("bus_watchdog") > 0 and self.get("torque_enable"):
            expiry = self._heard + self.get("bus_watchdog") * _WATCHDOG_UNIT
            if expiry < time:
                self._move(max(expiry, self.body.time))
                self.put("bus_watchdog", TRIPPED)
                self._hold_still()
        self._move(time)

    def hear(self, time: float) -> None:
        """A command, whoever it was for, has gone over the bus: that is what a watchdog waits for."""
        if "bus_watchdog" in self._places and self.get("bus_watchdog") > 0:
            self.advance(time)
        self._heard = time

    def reset(self, time: float, begin: int | None = None) -> None:
        """Start anew at a time, with registers from address ``begin`` on as new (default: volatile ones)."""
        self.advance(time)
        first = self.profile.ram_begins if begin is None else begin
        self.table[: len(self._lasting)] = self._lasting
        for register in self.profile.registers.values():
            if register.address >= first:
                self._put(register, register.initial)
        self._lasting = bytes(self.table[: self.profile.ram_begins])
        self._registered, self._alarms, self.body.overloaded, self._frame = None, 0, 0.0, None
        for volatile, lasting in _AT_POWER_UP:
            if volatile in self._places and lasting in self._places:
                self.put(volatile, self.get(lasting))
        self._hold_still()
        self.silent_until = time + BOOT

    def answer(self, command: Request, time: float) -> tuple[int, bytes] | None:
        """Carry out a command at a time [s]; error byte and data to answer, None for silence."""
        if time < self.silent_until or self.body.supply < self._least_voltage:
            return None
        if command.joined and self.get("firmware") < (self.profile.fast_sync_read or math.inf):
            return None  # it does not know the instruction, which is none of its own
        self.advance(time)
        self._heard = time
        outcome, data = self._carry_out(command, time)
        if not command.answers or self.get("status_level") < self._least_level(command.kind):
            return None
        return self._codec.error_byte(outcome, self.alarms), data

    @property
    def _least_voltage(self) -> float:
        return _LEAST_VOLTAGE if self.profile.voltage > 6.0 else _LEAST_OF_A_SMALL_ONE

    def _move(self, time: float) -> None:
        mode, frame = self._settings()
        torque = self._torque()
        drive: Drive = None
        if self.get("torque_enable") and torque > 0 and self.body.supply >= self._least_voltage:
            drive = drive_of(self.profile, mode, frame, self._get, self.body)
        self.body.advance(time, drive, torque)
        alarms, named = self.alarms, self.get("shutdown")
        if alarms and any(
            alarms & bit and named >> self.profile.alarms[alarm] & 1 for alarm, bit in _ALARMS.items()
        ):
            self._shut_down()

    def _shut_down(self) -> None:
        """Take the torque away for what lasts until it is asked for anew; a Feetech servo keeps a rest."""
        self._alarms |= self.alarms
        if self.profile.shutdown_clears != "nothing":
            self.put(self.profile.shutdown_clears, 0)

    def _torque(self) -> float:
        """The share of its torque that the motor may use."""
        share = torque_share(self.profile, self.mode, self._get)
        if self._alarms and self.profile.shutdown_clears == "nothing":
            rest = self._get("overload_rest") / 100 if self._alarms == OVERLOAD else 0.0
            return min(share, rest)
        return share

    def _settings(self) -> tuple[Mode, CountingFrame]:
        """Mode and frame, as the registers that decide them stand now."""
        if self._frame is None:
            mode = servo_mode(self.profile, {name: self.get(name) for name in mode_registers(self.profile)})
            values = {name: self.get(name) for name in FRAME_REGISTERS if name in self._places}
            self._frame = mode, frame_of(self.profile, mode, values)
        return self._frame

    def _get(self, name: str) -> int:
        return self.get(name) if name in self._places else 0

    def _least_level(self, kind: Kind) -> int:
        ping, read, rest = self._facts.levels
        return {"ping": ping, "read": read}.get(kind, rest)

    def _carry_out(self, command: Request, time: float) -> tuple[RequestOutcome, bytes]:
        match command.kind:
            case "ping":
                return "done", self._who() if self._facts.ping_names_model else b""
            case "read":
                return self._read(command.address, command.length)
            case "write":
                return self._write(command.address, command.data), b""
            case "register":
                return self._register(command.address, command.data), b""
            case "action" if self._registered is not None:
                address, data = self._registered
                self._registered = None
                self.put("registered", 0)
                return self._write(address, data), b""
            case "factory reset":
                whole = not self._facts.partial_reset or command.data == b"\xff"
                lasting = self.profile.register("return_delay").address
                self.reset(time, 0 if whole else lasting)
                return "done", b""
            case "reboot":
                self.reset(time)
                return "done", b""
        return "instruction", b""

    def _who(self) -> bytes:
        return self.get("model_number").to_bytes(2, "little") + bytes((self.get("firmware"),))

    def _places_of(self, address: int, length: int) -> list[int]:
        """Where the bytes at an address are, those of indirect data where their addresses say."""
        places, shadows = list(range(address, address + length)), self.profile.indirect
        if shadows is None or self.get("firmware") < shadows.firmware:
            return places
        for k, place in enumerate(places):
            if 0 <= (n := place - shadows.data) < shadows.count:
                at = shadows.addresses + 2 * n
                places[k] = int.from_bytes(self.table[at : at + 2], "little")
        return places

    def _read(self, address: int, length: int) -> tuple[RequestOutcome, bytes]:
        places = self._places_of(address, length)
        if not places or max(places) >= len(self.table):
            return "range", b""
        self._refresh()
        return "done", bytes(self.table[place] for place in places)

    def _register(self, address: int, data: bytes) -> RequestOutcome:
        outcome = self._check(address, data)
        if outcome == "done":
            self._registered = (address, data)
            if "registered" in self._places:
                self.put("registered", 1)
        return outcome

    def _write(self, address: int, data: bytes) -> RequestOutcome:
        """Write all of the data or, where any of it is refused, nothing."""
        outcome = self._check(address, data)
        if outcome != "done":
            return outcome
        stiff, mode = self.get("torque_enable"), self.mode
        for place, byte in zip(self._places_of(address, len(data)), data, strict=True):
            self.table[place] = byte
        self._frame = None
        if not (self.profile.unlocked_to_last and self._get("lock")):
            self._lasting = bytes(self.table[: self.profile.ram_begins])
        written = {name for name in ("goal_position", "torque_limit") if self._touches(name, address, data)}
        self._heed(written, bool(stiff), mode)
        return "done"

    def _heed(self, written: set[str], stiff: bool, mode: Mode) -> None:
        """What follows from a write besides the write."""
        if self.mode != mode and self.profile.modes:
            for volatile, lasting in _AT_POWER_UP:
                if volatile in self._places and lasting in self._places:
                    self.put(volatile, self.get(lasting))
            self._hold_still()
        clears = self.profile.shutdown_clears
        if clears == "torque_enable" and self._alarms:
            self.put("torque_enable", 0)  # only a reboot brings it back
            return
        waking = self._facts.goal_switches_torque_on
        if "goal_position" in written and waking and not self._alarms:
            self.put("torque_enable", 1)
        if (clears == "torque_limit" and "torque_limit" in written and self.get("torque_limit")) or (
            clears == "nothing" and "goal_position" in written
        ):
            self._alarms, self.body.overloaded = 0, 0.0
        if self.get("torque_enable") and not stiff and not waking:
            self._hold_still()

    def _touches(self, name: str, address: int, data: bytes) -> bool:
        register = self.profile.register(name)
        return address < register.end and register.address < address + len(data)

    def _check(self, address: int, data: bytes) -> RequestOutcome:
        places = self._places_of(address, len(data))
        if max(places, default=0) >= len(self.table):
            return "range"
        after = bytearray(self.table)
        for place, byte in zip(places, data, strict=True):
            after[place] = byte
        touched = set(places)
        for register in self.profile.registers.values():
            if touched.isdisjoint(range(register.address, register.end)):
                continue
            value = decode(register, int.from_bytes(after[register.address : register.end], "little"))
            outcome = write_outcome(self.profile, self._facts, self.mode, self._get, register, value)
            if outcome != "done":
                return outcome
        return "done"

    def _hold_still(self) -> None:
        """Make the goal where it stands, at rest."""
        register = self.profile.register("goal_position")
        at = self._settings()[1].shown(self.body.angle)
        if self.mode == "joint":
            at = min(max(at, 0), self.profile.ticks - 1)
        self._put(register, min(max(at, register.low), register.high))
        if "goal_velocity" in self._places:
            self.put("goal_velocity", 0)

    def _refresh(self) -> None:
        """Write what is measured into the table, each within what its register can hold."""
        profile, body = self.profile, self.body
        frame = self._settings()[1]
        way = -1.0 if frame.reversed else 1.0
        self._fit("present_position", frame.shown(body.output))
        self._fit("present_speed", way * body.rate / profile.speed_unit)
        self._fit("present_load", way * body.effort / profile.load_unit)
        self._fit("present_voltage", body.supply * 10)
        self._fit("present_temperature", body.temperature)
        self._fit("present_current", way * body.effort * profile.stall_current / self._ampere)
        self._fit("moving", int(abs(body.rate) > profile.speed_unit))
        bits = sum(1 << profile.alarms[alarm] for alarm, bit in _ALARMS.items() if self.alarms & bit)
        self._fit("hardware_error", bits)

    @property
    def _ampere(self) -> float:
        """One count of the current register [A]."""
        return (
            unit_scale(self.profile.registers["present_current"].unit)
            if "present_current" in self._places
            else 1.0
        )

    def _fit(self, name: str, value: float) -> None:
        if name in self._places:
            register = self._places[name][0]
            self._put(register, round(min(max(value, register.low), register.high)))

    def _put(self, register: Register, value: int) -> None:
        data = encode(register, value).to_bytes(register.width, "little")
        self.table[register.address : register.end] = data
