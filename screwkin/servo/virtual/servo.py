"""A virtual servo: a register table with a body behind it, that answers commands as the makers' manuals say.

What the manuals say and software stumbles over is there: writing a goal switches torque on (protocol 1.0),
the lasting part of the table is locked while torque is on (2.0), a goal beyond the angle limits is refused,
an alarm named in ``shutdown`` takes the torque away until it is switched on again, a reset forgets the rest.
"""

from __future__ import annotations

import math

from screwkin.servo.packets import Kind, Request, RequestOutcome
from screwkin.servo.profiles import (
    Profile,
    Register,
    baud_from_register,
    decode,
    encode,
    radians_from_ticks,
    register_from_baud,
)
from screwkin.servo.protocols import codec
from screwkin.servo.virtual.body import OVERHEAT, OVERLOAD, VOLTAGE, Body

BOOT = 0.2
"""How long a servo is silent after a reset [s]."""

_LEAST_VOLTAGE = 4.0  # V, below which nothing runs


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
        self.table = bytearray(profile.size)
        self._id_at = profile.register("id").address
        self._places = {
            name: (register, slice(register.address, register.end))
            for name, register in profile.registers.items()
        }
        self.silent_until = -math.inf
        self._registered: tuple[int, bytes] | None = None
        self._alarms = 0
        for register in profile.registers.values():
            self._put(register, register.initial)
        self.put("id", id)
        self.put("baud_rate", register_from_baud(profile, baud))
        self.put("return_delay", round(return_delay / 2e-6))
        self._hold_still()

    @property
    def id(self) -> int:
        """Its id on the bus."""
        return self.table[self._id_at]

    @property
    def baud(self) -> int:
        """The rate it listens and talks at."""
        return baud_from_register(self.profile, self.get("baud_rate"))

    @property
    def torque_on(self) -> bool:
        """Whether it holds its position."""
        return bool(self.get("torque_enable"))

    @property
    def alarms(self) -> int:
        """Bits of what is wrong with it now."""
        volts = round(self.body.voltage * 10)
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
        """Set a register from inside, whatever its access; the value must fit its range."""
        self._put(self.profile.register(name), value)

    def advance(self, time: float) -> None:
        """Go on to a time [s]: move, warm up, and take the torque away where an alarm asks for it."""
        if time <= self.body.time:
            return
        profile, goal = self.profile, None
        if self.torque_on:
            goal = radians_from_ticks(profile, self.get("goal_position"))
        wanted, most = self.get("moving_speed"), profile.no_load_speed * self.body.voltage / profile.voltage
        speed = min(wanted * profile.speed_unit, most) if wanted else most
        limit = self.profile.register("torque_limit")
        torque = self.get("torque_limit") / limit.high
        if self.body.voltage < _LEAST_VOLTAGE or torque == 0:
            goal = None
        self.body.advance(time, goal, max(speed, 1e-9), torque)
        if cause := self.alarms & self.get("shutdown"):
            self._alarms |= cause  # a shutdown lasts until torque is switched on again
            self.put("torque_enable", 0)

    def reset(self, time: float, begin: int | None = None) -> None:
        """Start anew at a time, with registers from address ``begin`` on as new (default: volatile ones)."""
        self.advance(time)
        first = self.profile.ram_begins if begin is None else begin
        for register in self.profile.registers.values():
            if register.address >= first:
                self._put(register, register.initial)
        self._registered, self._alarms, self.body.overloaded = None, 0, 0.0
        self._hold_still()
        self.silent_until = time + BOOT

    def answer(self, command: Request, time: float) -> tuple[int, bytes] | None:
        """Carry out a command at a time [s]; error byte and data to answer, None for silence."""
        if time < self.silent_until or self.body.voltage < _LEAST_VOLTAGE:
            return None
        self.advance(time)
        outcome, data = self._carry_out(command, time)
        if not command.answers or self.get("status_level") < self._least_level(command.kind):
            return None
        return self._codec.error_byte(outcome, self.alarms), data

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

    def _read(self, address: int, length: int) -> tuple[RequestOutcome, bytes]:
        if not 0 < length <= len(self.table) - address:
            return "range", b""
        self._refresh()
        return "done", bytes(self.table[address : address + length])

    def _register(self, address: int, data: bytes) -> RequestOutcome:
        outcome = self._check(address, data)
        if outcome == "done":
            self._registered = (address, data)
            self.put("registered", 1)
        return outcome

    def _write(self, address: int, data: bytes) -> RequestOutcome:
        """Write all of the data or, where any of it is refused, nothing."""
        outcome = self._check(address, data)
        if outcome != "done":
            return outcome
        torque = self.torque_on
        self.table[address : address + len(data)] = data
        goal, waking = self.profile.register("goal_position"), self._facts.goal_switches_torque_on
        if waking and address < goal.end and goal.address < address + len(data) and not self._alarms:
            self.put("torque_enable", 1)
        if self.torque_on and not torque:
            self._alarms = 0
            if not waking:
                self._hold_still()
        return "done"

    def _check(self, address: int, data: bytes) -> RequestOutcome:
        if address + len(data) > len(self.table):
            return "range"
        after = bytearray(self.table)
        after[address : address + len(data)] = data
        for register in self.profile.registers.values():
            if register.end <= address or register.address >= address + len(data):
                continue
            value = decode(register, int.from_bytes(after[register.address : register.end], "little"))
            outcome = self._check_one(register, value)
            if outcome != "done":
                return outcome
        return "done"

    def _check_one(self, register: Register, value: int) -> RequestOutcome:
        lasting = register.address < self.profile.ram_begins
        locked = lasting and self.torque_on and self._facts.locked_while_stiff
        if register.access == "r" or locked:
            return "access"
        if register.name == "goal_position":
            turns = self.get("angle_limit_low") == self.get("angle_limit_high") == 0  # no limits: wheel mode
            if not turns and not self.get("angle_limit_low") <= value <= self.get("angle_limit_high"):
                return "angle"
        return "done" if register.low <= value <= register.high else "limit"

    def _hold_still(self) -> None:
        """Make the goal where it stands."""
        self._put(self.profile.register("goal_position"), self._ticks(self.body.angle))

    def _ticks(self, angle: float) -> int:
        ticks = round(angle / self.profile.tick) + self.profile.centre
        return min(max(ticks, 0), self.profile.ticks - 1)

    def _refresh(self) -> None:
        """Write what is measured into the table, each within what its register can hold."""
        profile, body = self.profile, self.body
        self.put("present_position", self._ticks(body.output))
        self._fit("present_speed", body.rate / profile.speed_unit, 0x3FF)
        self._fit("present_load", body.effort / profile.load_unit, 0x3FF)
        self._fit("present_voltage", body.voltage * 10, 0xFF)
        self._fit("present_temperature", body.temperature, 0xFF)
        self.put("moving", int(abs(body.rate) > profile.speed_unit))
        if "hardware_error" in profile.registers:
            self.put("hardware_error", self.alarms)

    def _fit(self, name: str, value: float, most: int) -> None:
        self.put(name, round(min(max(value, -most), most)))

    def _put(self, register: Register, value: int) -> None:
        data = encode(register, value).to_bytes(register.width, "little")
        self.table[register.address : register.end] = data
