"""The servo bus: the makers' driver, ``dynamixel_sdk``, behind one small interface.

Only this file imports the driver and pyserial, when a bus is opened. The driver writes and reads the
packets of all protocols; here are its time-outs (on a clock that may be a simulated one), its retries with a
bound, the names of its error bits, and statistics of its round trips.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Literal

from screwkin.errors import InputError, needed_for
from screwkin.servo.driver import DriverPort
from screwkin.servo.line import (
    REFUSED,
    BusError,
    ByteLine,
    Clock,
    DamagedError,
    ErrorBit,
    LineLostError,
    MonotonicClock,
    PortError,
    RefusedError,
    Reply,
    Statistics,
)
from screwkin.servo.packets import BROADCAST, Instruction, Packet, ProtocolName
from screwkin.servo.protocols import codec

_MOST_STRANGERS = 8  # sound packets of other servos that are passed over
_SHARE = 4  # bytes of a servo's part of an answer that many share, besides its data: error, id, sum

PATIENCE = 0.050
"""Time [s] that a reply may take until round trips were measured: the slowest adapters hold it back 40 ms."""

Grouped = Literal["none", "sync", "bulk", "fast"]
"""One packet that asks several servos: sync read, bulk read of MX servos on 1.0; fast: one packet answers."""


class Bus:
    """Servos on a line, by their ids. Every exchange is tried ``1 + retries`` times, then it is an error.

    Args:
        line: open, and ours alone.
        protocol: of all servos on it, see ``protocols.CODECS``.
        baud: bits per second, for the time-outs.
        clock: what time-outs and statistics go by.
        retries: how often an exchange is repeated that got no sound reply.
        patience: time [s] that a reply may take beyond that of its bytes: return delay and adapter.
        port: its name, for messages.
    """

    def __init__(
        self,
        line: ByteLine,
        protocol: ProtocolName = 1.0,
        baud: int = 1_000_000,
        clock: Clock | None = None,
        *,
        retries: int = 1,
        patience: float = PATIENCE,
        port: str = "",
    ) -> None:
        sdk = _driver()
        self.line, self.protocol, self.baud, self.retries = line, protocol, baud, retries
        self.port = port
        self.clock: Clock = clock or MonotonicClock()
        self.statistics = Statistics()
        self._sdk = sdk
        self._port = DriverPort(line, self.clock, baud, patience)
        self._codec = codec(protocol)
        self._facts = self._codec.FACTS
        self._handler = sdk.PacketHandler(self._facts.driver)

    @property
    def patience(self) -> float:
        """Time [s] that a reply may take beyond that of its bytes."""
        return self._port.patience

    @patience.setter
    def patience(self, seconds: float) -> None:
        self._port.patience = seconds

    def close(self) -> None:
        """Give the line back; what the servos do is not changed by it."""
        self.line.close()

    def ping(self, id: int) -> int:
        """Model number of the servo.

        Raises:
            BusError: no sound reply. LineLostError: the port is gone.
        """
        number = int(self._exchange(id, "ping", lambda: self._handler.ping(self._port, id))[0])
        return number if self._facts.model_at < 0 else self.read(id, self._facts.model_at, 2).value

    def present(self, id: int) -> bool:
        """Whether a servo answers a bare ping, as one does that is set not to answer readings.

        Raises:
            LineLostError: the port is gone.
        """
        try:
            self._exchange(id, "ping", lambda: self._bare_ping(id))
        except LineLostError:
            raise
        except BusError as error:
            return isinstance(error, DamagedError)
        return True

    def _bare_ping(self, id: int) -> tuple[bytes, int, int]:
        self._port.clearPort()
        self._port.writePort(self._codec.pack(Packet(id, Instruction.PING)))
        self._port.setPacketTimeout(self._facts.answer_size)
        return self._receive(id)

    def read(self, id: int, address: int, length: int) -> Reply:
        """Bytes of a servo's table.

        Raises:
            BusError: no sound reply. RefusedError: there is no such address. LineLostError.
        """
        data, errors = self._exchange(id, "read", lambda: self._ask(id, address, length), length)
        self._heed(id, f"reading {length} bytes at {address}", errors)
        return Reply(id, bytes(data), errors)

    def write(self, id: int, address: int, value: int, length: int) -> Reply:
        """Write a number into a servo's table, and wait for the reply unless to all (254).

        Raises:
            BusError: no sound reply. RefusedError: address or value is not accepted. LineLostError.
        """
        data = list(_bytes(value, length))
        if id == BROADCAST:
            self._send(lambda: self._handler.writeTxOnly(self._port, id, address, length, data))
            return Reply(id, b"")
        _, errors = self._exchange(
            id, "write", lambda: (None, *self._handler.writeTxRx(self._port, id, address, length, data))
        )
        self._heed(id, f"writing {value} at {address}", errors)
        return Reply(id, b"", errors)

    def reg_write(self, id: int, address: int, value: int, length: int) -> Reply:
        """Like ``write``, but done only at ``action``."""
        data = list(_bytes(value, length))
        _, errors = self._exchange(
            id,
            "reg write",
            lambda: (None, *self._handler.regWriteTxRx(self._port, id, address, length, data)),
        )
        self._heed(id, f"preparing {value} at {address}", errors)
        return Reply(id, b"", errors)

    def action(self) -> None:
        """All servos do what ``reg_write`` prepared; nobody answers."""
        self._send(lambda: self._handler.action(self._port, BROADCAST))

    def sync_write(self, address: int, length: int, data: Mapping[int, bytes]) -> None:
        """Write so many bytes at one address of several servos, in one packet that nobody answers.

        Raises:
            InputError: bytes of another length. LineLostError: the port is gone.
        """
        wrong = [id for id, item in data.items() if len(item) != length]
        if wrong or not data:
            raise InputError(f"sync write of {length} bytes: ids {wrong} got others, of {len(data)} servos")
        group = self._sdk.GroupSyncWrite(self._port, self._handler, address, length)
        for id, item in data.items():
            group.addParam(id, list(item))
        self._send(group.txPacket)

    def read_many(
        self, ids: Sequence[int], address: int, length: int, grouped: Grouped = "none"
    ) -> dict[int, Reply]:
        """Bytes at one address of several servos; those without a sound reply are left out.

        Args:
            ids: of the servos.
            address: first byte of each servo's table.
            length: number of bytes.
            grouped: ask all in one packet, where all of them support it (an AX-12 does not); who does not
                answer to it is asked alone.

        Raises:
            LineLostError: the port is gone.
        """
        replies: dict[int, Reply] = {}
        if grouped == "fast" and len(ids) > 1:
            replies = self._joined(ids, address, length)
            grouped = "sync"
        if grouped != "none" and len(ids) > 1 and not replies:
            replies = self._grouped(ids, address, length, grouped)
        for id in ids:
            if id not in replies:
                try:
                    replies[id] = self.read(id, address, length)
                except LineLostError:
                    raise
                except BusError:
                    continue
        return {id: replies[id] for id in ids if id in replies}

    def _grouped(self, ids: Sequence[int], address: int, length: int, grouped: Grouped) -> dict[int, Reply]:
        """The replies to one sync or bulk read, up to the first that is missing."""
        if grouped == "sync":
            self._send(lambda: self._ask_in_turn(ids, address, length))
        else:
            rows = [number for id in ids for number in (length, id, address)]
            self._send(lambda: self._handler.bulkReadTx(self._port, rows, len(rows)))
        replies: dict[int, Reply] = {}
        for id in ids:
            self.statistics.exchanges += 1
            began = self.clock.now()
            self._port.setPacketTimeout(self._facts.answer_size + length)
            answer = self._try(partial(self._receive, id))
            data, result, error = answer if isinstance(answer, tuple) else (b"", answer, 0)
            if result != self._sdk.COMM_SUCCESS or len(data) != length:
                self.statistics.failed += 1
                break
            self.statistics.answered(self.clock.now() - began)
            replies[id] = Reply(id, bytes(data), self._codec.errors(int(error)))
        return replies

    def _joined(self, ids: Sequence[int], address: int, length: int) -> dict[int, Reply]:
        """The replies to one fast sync read, of all or none: they share a packet."""
        self.statistics.exchanges += 1
        began = self.clock.now()
        self._send(lambda: self._handler.syncReadTx(self._port, address, length, list(ids), len(ids), True))
        size = _SHARE + length
        self._port.setPacketTimeout(self._facts.answer_size + size * len(ids))
        answer = self._try(lambda: self._handler.fastSyncReadRx(self._port, BROADCAST, size * len(ids)))
        data, result, _ = answer if isinstance(answer, tuple) else (b"", answer, 0)
        rows = [bytes(data[k * size : (k + 1) * size]) for k in range(len(ids))]
        if result != self._sdk.COMM_SUCCESS or [row[1:2] for row in rows] != [bytes((id,)) for id in ids]:
            self.statistics.failed += 1
            return {}
        self.statistics.answered(self.clock.now() - began)
        return {row[1]: Reply(row[1], row[2 : 2 + length], self._codec.errors(row[0])) for row in rows}

    def _ask_in_turn(self, ids: Sequence[int], address: int, length: int) -> Any:
        """Send a sync read; the driver knows that of its own protocols only."""
        if self._facts.driver == self.protocol:
            return self._handler.syncReadTx(self._port, address, length, list(ids), len(ids), False)
        packet = Packet(BROADCAST, Instruction.SYNC_READ, bytes((address, length, *ids)))
        self._port.clearPort()
        self._port.writePort(self._codec.pack(packet))
        return self._sdk.COMM_SUCCESS

    def _ask(self, id: int, address: int, length: int) -> tuple[bytes, int, int]:
        result = self._handler.readTx(self._port, id, address, length)
        return self._receive(id) if result == self._sdk.COMM_SUCCESS else (b"", result, 0)

    def _receive(self, id: int) -> tuple[bytes, int, int]:
        """Parameters of the servo's next status packet, the driver's result, and the error byte.

        The driver's own reads take the checksum for data when a packet is shorter than was asked for.
        """
        at, error = self._facts.length_at, self._facts.error_at
        result = self._sdk.COMM_RX_TIMEOUT
        for _ in range(_MOST_STRANGERS):
            packet, result = self._handler.rxPacket(self._port, *self._facts.driver_options)
            if result != self._sdk.COMM_SUCCESS:
                break
            if packet[self._facts.id_at] == id:
                length = bytes(packet[at : at + self._facts.length_width])
                count = int.from_bytes(length, "little") - self._facts.counted
                return bytes(packet[error + 1 : error + 1 + max(0, count)]), result, packet[error]
        return b"", result, 0

    def _send(self, act: Callable[[], Any]) -> None:
        """Send what nobody answers."""
        result = self._try(act)
        if result not in (self._sdk.COMM_SUCCESS, self._sdk.COMM_NOT_AVAILABLE):
            raise LineLostError("the port does not take the packet: check the cable")

    def _exchange(
        self, id: int, what: str, act: Callable[[], Any], length: int = 0
    ) -> tuple[Any, frozenset[ErrorBit]]:
        """Payload and errors of a sound reply, after as many tries as are allowed."""
        if not 0 <= id < BROADCAST - 1:
            raise InputError(f"invalid servo id {id}; expected 0 to {BROADCAST - 2}")
        self.statistics.exchanges += 1
        result, errors = self._sdk.COMM_RX_TIMEOUT, frozenset[ErrorBit]()
        for attempt in range(1 + self.retries):
            self.statistics.retries += attempt > 0
            began = self.clock.now()
            answer = self._try(act)
            payload, result, error = answer if isinstance(answer, tuple) else (None, answer, 0)
            errors = self._codec.errors(int(error))
            short = length and (payload is None or len(payload) != length)
            refused = bool(errors & REFUSED)
            if result == self._sdk.COMM_SUCCESS and "checksum" not in errors and (refused or not short):
                self.statistics.answered(self.clock.now() - began)
                return payload, errors
            silent = result == self._sdk.COMM_RX_TIMEOUT
            self.statistics.silent += silent
            self.statistics.corrupt += not silent
        self.statistics.failed += 1
        tried = f"to a {what}, tried {1 + self.retries} times"
        if result == self._sdk.COMM_RX_TIMEOUT:
            raise BusError(f"servo {id} does not answer {tried}", id)
        raise DamagedError(f"servo {id} answers with damaged packets {tried}", id)

    def _try(self, act: Callable[[], Any]) -> Any:
        """The driver's answer; bytes that it stumbles over are a damaged packet."""
        try:
            return act()
        except (IndexError, ValueError, UnboundLocalError):
            return self._sdk.COMM_RX_CORRUPT
        finally:
            self._port.is_using = False

    def _heed(self, id: int, doing: str, errors: frozenset[ErrorBit]) -> None:
        if errors & REFUSED:
            named = ", ".join(sorted(errors & REFUSED))
            raise RefusedError(f"servo {id} refused ({named} error) {doing}", id, errors)


def open_line(port: str, baud: int = 1_000_000, rs485: bool = False) -> ByteLine:
    """A serial port, ours alone.

    Args:
        port: such as ``/dev/ttyUSB0``.
        baud: bits per second.
        rs485: let the kernel switch the direction of an RS-485 transceiver.

    Raises:
        PortError: not there, not allowed, in use, or no such baud rate; lists the ports that are there.
        MissingDependencyError: pyserial is not installed.
    """
    with needed_for("a serial port"):
        import serial
        from serial.rs485 import RS485Settings
    try:
        line = serial.Serial(port, baud, timeout=0, write_timeout=0.1, exclusive=True)
        if rs485:
            line.rs485_mode = RS485Settings()
    except (OSError, ValueError) as error:
        there = ", ".join(port_names()) or "none"
        raise PortError(
            f"cannot open port {port}: {error}. Ports found: {there}; permissions: docs/hardware.md"
        ) from None
    opened: ByteLine = line
    return opened


def port_names() -> tuple[str, ...]:
    """Serial ports of this computer."""
    from serial.tools.list_ports import comports

    return tuple(sorted(str(port.device) for port in comports()))


def _driver() -> Any:
    with needed_for("a servo bus"):
        import dynamixel_sdk
    return dynamixel_sdk


def _bytes(value: int, length: int) -> bytes:
    try:
        return int(value).to_bytes(length, "little")
    except (OverflowError, ValueError) as error:
        raise InputError(f"{value} does not fit into {length} bytes of a servo's table ({error})") from None
