"""What goes over a servo bus, as a servo sees it: packets, and what a packet asks of the servo that reads it.

The layout of the bytes is in ``protocol1`` and ``protocol2``; both hold the same functions:

    pack(packet) -> bytes                        a packet as bytes
    status(id, error, data) -> bytes             a servo's answer as bytes
    parse(buffer, ended) -> (packets, rest)      the sound packets of a stream, and what may become one
    command_for(packet, id) -> Request or None   what a packet asks of the servo of that id
    errors(byte) -> names                        what an answer's error byte says
    error_byte(outcome, alarms) -> int           the error byte of an answer
    FACTS                                        sizes, places, and how its servos behave

A further protocol is one such file and its row in ``protocols``. They share nothing with the makers' driver,
so that each tests the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

BROADCAST = 0xFE

Kind = Literal[
    "ping", "read", "write", "register", "action", "factory reset", "reboot", "unknown", "malformed"
]

ProtocolName = float | str
"""A protocol: the makers' number, or the name of one that has none."""

RequestOutcome = Literal["done", "angle", "limit", "range", "access", "instruction"]
"""What became of a request: carried out, or why not."""


class Instruction(IntEnum):
    """The instruction byte; ``STATUS`` only on protocol 2.0, where answers carry it."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    REBOOT = 0x08
    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A
    BULK_READ = 0x92
    BULK_WRITE = 0x93


@dataclass(frozen=True)
class Packet:
    """A sound packet: whom it concerns, its instruction (on protocol 1.0 an answer's error byte), rest."""

    id: int
    instruction: int
    params: bytes = b""


@dataclass(frozen=True)
class ProtocolFacts:
    """What distinguishes a protocol besides the bytes of its packets.

    Attributes:
        name: its number or name.
        driver: the handler of the makers' driver that frames its packets.
        id_at, length_at, error_at: places in an answer: of the id, of the length, of the error byte.
        length_width: bytes of the length.
        counted: bytes that the length counts besides the data.
        read_size, answer_size, sync_size: bytes of a request to read, and of an answer and a sync write
            without data.
        driver_options: what the makers' driver wants to know when it receives a packet.
        goal_switches_torque_on: writing a goal does so.
        model_at: where the model number is read after a ping; -1 where the driver's ping names it.
        ping_names_model: the answer to a ping holds the model number.
        levels: least status level at which a ping, a read, and anything else is answered.
        partial_reset: a factory reset may spare the lasting registers.
        locked_while_stiff: the lasting registers cannot be written while torque is on.
    """

    name: ProtocolName
    driver: float
    id_at: int
    length_at: int
    error_at: int
    length_width: int
    counted: int
    read_size: int
    answer_size: int
    sync_size: int
    driver_options: tuple[bool, ...]
    goal_switches_torque_on: bool
    model_at: int
    ping_names_model: bool
    levels: tuple[int, int, int]
    partial_reset: bool
    locked_while_stiff: bool


@dataclass(frozen=True)
class Request:
    """What one servo is asked: ``length`` bytes to read, ``data`` to write, at ``address``.

    ``answers`` says whether it may be answered at all, whatever the servo's status level; ``after`` names
    the servos whose answers come before its own; ``joined`` all those that answer in one packet.
    """

    kind: Kind
    address: int = 0
    length: int = 0
    data: bytes = b""
    answers: bool = True
    after: tuple[int, ...] = ()
    joined: tuple[int, ...] = ()


def sound_packets(
    buffer: bytes,
    ended: bool,
    header: bytes,
    length: Callable[[bytes, int], int],
    opened: Callable[[bytes], tuple[Packet, int] | None],
) -> tuple[list[Packet], bytes]:
    """The sound packets of a stream, in order, and the rest that may become one with more bytes.

    Where a packet proves false, the search goes on one byte behind its beginning, so that a false header or a
    lost byte costs no packet that follows. A false length may hold up what follows until so many bytes are
    there or the line has fallen silent; with ``ended`` nothing is waited for.

    Args:
        buffer: what has arrived, the rest of last time before it.
        ended: no more bytes are coming.
        header: what every packet begins with.
        length: bytes of the packet whose header stands at an index of the data, as far as they say; 0 if
            none can begin there.
        opened: the packet that so many bytes are, and how many of them it uses up; None if it is false.
    """
    data = bytes(buffer)
    packets: list[Packet] = []
    end = 0  # of the last packet, or of what was passed over
    while (i := data.find(header, end)) >= 0:
        end = i + 1
        whole = length(data, i)
        if i + whole > len(data):
            if not ended:
                return packets, data[i:]
        elif whole and (sound := opened(data[i : i + whole])):
            packets.append(sound[0])
            end = i + sound[1]
    begun = (header[:n] for n in range(len(header) - 1, 0, -1) if data.endswith(header[:n], end))
    return packets, b"" if ended else next(begun, b"")


def simple_command(packet: Packet, address_width: int) -> Request:
    """What an instruction to one servo, or to all alike, asks: all but the sync and bulk ones."""
    answers, params = packet.id != BROADCAST, packet.params
    address = int.from_bytes(params[:address_width], "little")
    match packet.instruction:
        case Instruction.PING:
            return Request("ping", answers=answers)
        case Instruction.READ if len(params) == 2 * address_width:
            length = int.from_bytes(params[address_width:], "little")
            return Request("read", address, length, answers=answers)
        case Instruction.WRITE if len(params) > address_width:
            return Request("write", address, data=params[address_width:], answers=answers)
        case Instruction.REG_WRITE if len(params) > address_width:
            return Request("register", address, data=params[address_width:], answers=answers)
        case Instruction.ACTION:
            return Request("action", answers=answers)
        case Instruction.FACTORY_RESET:
            return Request("factory reset", data=params, answers=answers)
        case Instruction.REBOOT if address_width == 2:
            return Request("reboot", answers=answers)
        case Instruction.READ | Instruction.WRITE | Instruction.REG_WRITE:
            return Request("malformed", answers=answers)
    return Request("unknown", answers=answers)


def rows(params: bytes, size: int) -> list[bytes] | None:
    """Parameters cut into rows of ``size`` bytes; None if they do not fit."""
    if size <= 0 or len(params) % size:
        return None
    return [params[i : i + size] for i in range(0, len(params), size)]


def sync_write_command(head: bytes, body: bytes, id: int, width: int) -> Request | None:
    """What a sync write asks of a servo: ``head`` holds address and length, ``body`` rows of id and data."""
    address, length = int.from_bytes(head[:width], "little"), int.from_bytes(head[width:], "little")
    for row in rows(body, length + 1) or ():
        if row[0] == id and length:
            return Request("write", address, data=row[1:], answers=False)
    return None


def ids_before(ids: Sequence[int], id: int) -> tuple[int, ...] | None:
    """The ids before ``id``; None if it is not among them."""
    return tuple(ids[: ids.index(id)]) if id in ids else None
