"""A virtual servo bus in memory: bytes go in, bytes come out when they would have arrived.

It takes the place of a serial port that never waits: ``write``, ``read``, ``in_waiting``,
``reset_input_buffer``, ``close``. Time is that of the clock given: the computer's, or a simulated one. Bytes
take their time at the baud rate, servos their return delay; servos set to another rate hear nothing; two
servos with one id talk at once, and what arrives is the bitwise and of both.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from typing import Protocol, Self

import numpy as np

from screwkin.servo import protocol2
from screwkin.servo.packets import BROADCAST, Packet, Request
from screwkin.servo.protocols import Codec, codec
from screwkin.servo.virtual.faults import InjectedFault, affected, deafened, mangled
from screwkin.servo.virtual.servo import VirtualServo

_SILENCE = 0.005  # s, after which no more bytes of a packet are waited for
_BITS_PER_BYTE = 10
_SAME_RATE = 0.03  # of the rate: what both ends of a line tolerate
_SERVOS_OWN = ("reset", "overload", "blocked", "overheat", "brown-out")

Witness = Callable[[float, int, Request], None]
"""Called with time, servo id and command for every command that reaches a servo."""


class Now(Protocol):
    """The part of a clock that a bus reads."""

    def now(self) -> float:
        """Time [s]."""


@dataclass
class SimulatedClock:
    """A clock that goes on only when somebody waits."""

    time: float = 0.0

    def now(self) -> float:
        """Time [s]."""
        return self.time

    def sleep(self, seconds: float) -> None:
        """Wait."""
        self.time += max(0.0, seconds)


class VirtualBus:
    """Servos on a line.

    Args:
        servos: all of one protocol.
        clock: what time goes by.
        baud: the rate of the port, which may be changed later.
        faults: what goes wrong, and when; more by ``inject``.
        seed: of what is random in faults.
        witness: called for every command that reaches a servo.
        adapter: time that the port's adapter holds answers back [s].
        supply: resistance of the servos' common supply [ohm]; the current of all lowers the voltage of each.
    """

    def __init__(
        self,
        servos: Sequence[VirtualServo],
        clock: Now,
        baud: int = 1_000_000,
        faults: Sequence[InjectedFault] = (),
        seed: int = 0,
        witness: Witness | None = None,
        adapter: float = 0.0,
        supply: float = 0.0,
    ) -> None:
        self.servos, self.clock, self.baudrate = tuple(servos), clock, baud
        self.adapter, self.supply = adapter, supply
        self.packets = self.answers = 0
        self.pulled = False
        self._codec: Codec = codec(servos[0].profile.protocol if servos else 1.0)
        self._random = np.random.default_rng(seed)
        self._witness = witness
        self._faults: list[InjectedFault] = []
        self._turns: list[tuple[float, bool, InjectedFault]] = []  # beginnings (True) and ends to come
        self._heard, self._last, self._free = b"", clock.now(), clock.now()
        self._coming: list[tuple[float, int, bytes]] = []  # a heap: when, which, what
        self._arrived = bytearray()
        for servo in self.servos:
            servo.body.time = max(servo.body.time, clock.now())
        for fault in faults:
            self.inject(fault)

    def inject(self, fault: InjectedFault) -> None:
        """Let something go wrong."""
        self._faults.append(fault)
        self._turns.append((fault.at, True, fault))
        if fault.until < float("inf"):
            self._turns.append((fault.until, False, fault))
        self._turns.sort(key=lambda turn: turn[0])

    def servo(self, id: int) -> VirtualServo:
        """The first servo with that id.

        Raises:
            StopIteration: there is none.
        """
        return next(servo for servo in self.servos if servo.id == id)

    def advance(self) -> None:
        """Let the servos come to the present time."""
        self._live_through(self.clock.now())
        self._load_supply(self.clock.now())
        for servo in self.servos:
            servo.advance(self.clock.now())

    def write(self, data: bytes) -> int:
        """Send bytes to the servos; returns how many.

        Raises:
            OSError: the cable was pulled.
        """
        now = self.clock.now()
        self._plugged(now)
        sent = max(now, self._free) + len(data) * self._byte_time
        self._free = self._last = sent
        self._hear(mangled(self._faults, sent, bytes(data), self._random), sent)
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """At most so many of the bytes that have arrived by now; never waits.

        Raises:
            OSError: the cable was pulled.
        """
        self._arrive()
        data = bytes(self._arrived[:size])
        del self._arrived[:size]
        return data

    @property
    def in_waiting(self) -> int:
        """How many bytes have arrived."""
        self._arrive()
        return len(self._arrived)

    @property
    def next_arrival(self) -> float | None:
        """When the next bytes will arrive [s], None if none are under way."""
        return self._coming[0][0] if self._coming else None

    def reset_input_buffer(self) -> None:
        """Forget what has arrived."""
        self._arrive()
        self._arrived.clear()

    def reopened(self) -> Self:
        """The port, opened anew.

        Raises:
            OSError: the cable is pulled.
        """
        self._coming.clear()
        self._arrive()
        return self

    def close(self) -> None:
        """Give the port back; the servos stay as they are."""

    @property
    def _byte_time(self) -> float:
        return _BITS_PER_BYTE / self.baudrate

    def _hear(self, data: bytes, time: float, ended: bool = False) -> None:
        """Let the servos obey the packets that bytes make up with those before."""
        packets, self._heard = self._codec.parse(self._heard + data, ended)
        for packet in packets:
            self.packets += 1
            self._free = max(self._free, self._obey(packet, time))

    def _obey(self, packet: Packet, time: float) -> float:
        """Let the servos concerned carry out a packet; returns when the line is free again."""
        requests: list[tuple[VirtualServo, Request]] = []
        tolerated = _SAME_RATE * self.baudrate
        self._load_supply(time)
        for servo in self.servos:
            if abs(servo.baud - self.baudrate) > tolerated:
                continue
            servo.hear(time)
            if packet.id not in (servo.id, servo.second_id, BROADCAST):
                continue
            command = self._codec.command_for(packet, servo.id)
            if command is None and servo.second_id != BROADCAST:
                second = self._codec.command_for(packet, servo.second_id)
                command = replace(second, answers=False, after=()) if second else None
            if command is not None:
                requests.append((servo, command))
        requests.sort(key=lambda pair: len(pair[1].after))
        if requests and requests[0][1].joined:
            return self._answer_jointly(requests, time)
        said: set[int] = set()
        for id in dict.fromkeys(servo.id for servo, _ in requests):
            mine = [pair for pair in requests if pair[0].id == id]
            before = mine[0][1].after
            answers = [self._answer(servo, command, time) for servo, command in mine]
            if before and mine[0][1].kind == "read" and before[-1] not in said:
                continue  # it waits for the one before it in vain; to a ping of all each answers in its time
            time, spoken = self._say(id, [answer for answer in answers if answer is not None], time)
            if spoken:
                said.add(id)
        return time

    def _answer_jointly(self, requests: list[tuple[VirtualServo, Request]], time: float) -> float:
        """Let servos answer in one packet, up to the first that does not; when the line is free again."""
        asked, delay = requests[0][1].joined, 0.0
        answers: list[tuple[int, int, bytes]] = []
        for servo, command in requests:
            heard = command.after == asked[: len(answers)]
            answer = servo.answer(command, time) if heard and not self._deaf(servo, command, time) else None
            if answer is None:
                break
            delay = delay or servo.get("return_delay") * 2e-6
            answers.append((servo.id, *answer))
        if not answers:
            return time
        data = protocol2.joined_status(len(asked), requests[0][1].length, answers)
        return self._say(answers[0][0], [(delay, data)], time)[0]

    def _deaf(self, servo: VirtualServo, command: Request, time: float) -> bool:
        """Whether a command does not reach a servo; those that do are witnessed."""
        self._live_through(time)
        if deafened(self._faults, servo.id, time, self._random):
            return True
        if self._witness is not None:
            self._witness(time, servo.id, command)
        return False

    def _load_supply(self, time: float) -> None:
        """Let the current of all servos lower the voltage of each."""
        if self.supply:
            for servo in self.servos:
                servo.advance(time)
            sag = self.supply * sum(servo.current for servo in self.servos)
            for servo in self.servos:
                servo.body.sag = sag

    def _answer(self, servo: VirtualServo, command: Request, time: float) -> tuple[float, bytes] | None:
        """What a servo answers: its return delay, and the bytes."""
        id = servo.id  # the command may change it
        if self._deaf(servo, command, time):
            return None
        answer = servo.answer(command, time)
        if answer is None:
            return None
        return servo.get("return_delay") * 2e-6, self._codec.status(id, *answer)

    def _say(self, id: int, answers: list[tuple[float, bytes]], time: float) -> tuple[float, bool]:
        """Put the answers of all servos with one id on the line; when it is free again, and if any came."""
        if not answers:
            return time, False
        data = answers[0][1]
        for _, other in answers[1:]:
            both = zip(data.ljust(len(other), b"\xff"), other.ljust(len(data), b"\xff"), strict=True)
            data = bytes(a & b for a, b in both)
        late, data = affected(self._faults, id, time, data, self._random)
        self.answers += 1
        begin = time + late + min(delay for delay, _ in answers)
        end = begin + len(data) * self._byte_time
        if data:
            heappush(self._coming, (end + self.adapter, self.answers, data))
        # A late answer holds nobody up: the others do not know of it.
        return (time if late else end), bool(data)

    def _arrive(self) -> None:
        now = self.clock.now()
        self._plugged(now)
        while self._coming and self._coming[0][0] <= now:
            self._arrived += heappop(self._coming)[2]

    def _plugged(self, now: float) -> None:
        if self._heard and now > self._last + _SILENCE:
            self._hear(b"", self._last + _SILENCE, ended=True)
        self._live_through(now)
        if self.pulled:
            raise OSError(errno.EIO, "the cable of the virtual bus was pulled")

    def _live_through(self, time: float) -> None:
        """Let the faults up to a time begin and end."""
        while self._turns and self._turns[0][0] <= time:
            at, begins, fault = self._turns.pop(0)
            if fault.kind == "pulled":
                self.pulled = begins
            if fault.kind not in _SERVOS_OWN:
                continue
            for servo in self.servos:
                if fault.id in (None, servo.id):
                    servo.advance(at)
                    (fault.begin if begins else fault.end)(servo)
