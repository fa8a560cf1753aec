"""Protocol 2.0 as a servo sees it.

    +----+----+----+----+----+-------+-------+-------+-------------------+-------+-------+
    | FF | FF | FD | 00 | id | len L | len H | instr | params …          | crc L | crc H |   an instruction
    +----+----+----+----+----+-------+-------+-------+-------------------+-------+-------+
    | FF | FF | FD | 00 | id | len L | len H |  55   | error | data …    | crc L | crc H |   an answer
    +----+----+----+----+----+-------+-------+-------+-------------------+-------+-------+

len counts instr, params and crc. Where FF FF FD occurs in instr and params, one more FD is written after it
("stuffing", counted by len). crc is CRC-16 with polynomial 8005, begun with 0, not reflected, over all that
stands before.
id FE is everyone. error: 1 fail, 2 instruction, 3 crc, 4 range, 5 length, 6 limit, 7 access; bit 7 is set
while the servo's hardware error register is not 0.

Source: the maker's description of protocol 2.0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from screwkin.servo.line import ErrorBit
from screwkin.servo.packets import (
    BROADCAST,
    Instruction,
    Packet,
    ProtocolFacts,
    Request,
    RequestOutcome,
    ids_before,
    rows,
    simple_command,
    sound_packets,
    sync_write_command,
)

MOST = 1024
"""Bytes that ``len`` may count: servos have no room for more, so a greater length is noise."""

FACTS = ProtocolFacts(
    name=2.0,
    driver=2.0,
    id_at=4,
    length_at=5,
    error_at=8,
    length_width=2,
    counted=4,
    read_size=14,
    answer_size=11,
    sync_size=14,
    driver_options=(False,),
    goal_switches_torque_on=False,
    model_at=-1,
    ping_names_model=True,
    levels=(0, 1, 2),
    partial_reset=True,
    locked_while_stiff=True,
)

_HEADER = b"\xff\xff\xfd\x00"
_OVERHEAD = 7  # header, id, len
_LEAST = 3  # instruction, crc
_PATTERN, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
_POLYNOMIAL = 0x8005
_ALERT = 0x80  # of the hardware
_NUMBERS: Mapping[int, ErrorBit] = {
    1: "instruction",
    2: "instruction",
    3: "checksum",
    4: "range",
    5: "range",
    6: "range",
    7: "access",
}
_OUTCOMES: Mapping[RequestOutcome, int] = {
    "done": 0,
    "angle": 6,
    "limit": 6,
    "range": 4,
    "access": 7,
    "instruction": 2,
}


def _crc_row(byte: int) -> int:
    register = byte << 8
    for _ in range(8):
        register = (register << 1) ^ (_POLYNOMIAL if register & 0x8000 else 0)
    return register & 0xFFFF


_CRC = tuple(map(_crc_row, range(256)))


def crc16(data: bytes) -> int:
    """CRC-16 with polynomial 8005, begun with 0, not reflected."""
    register = 0
    for byte in data:
        register = (register << 8 & 0xFF00) ^ _CRC[register >> 8 ^ byte]
    return register


def pack(packet: Packet) -> bytes:
    """A packet as bytes."""
    body = (bytes((packet.instruction,)) + packet.params).replace(_PATTERN, _STUFFED)
    checked = _HEADER + bytes((packet.id,)) + (len(body) + 2).to_bytes(2, "little") + body
    return checked + crc16(checked).to_bytes(2, "little")


def status(id: int, error: int, data: bytes = b"") -> bytes:
    """A servo's answer as bytes."""
    return pack(Packet(id, Instruction.STATUS, bytes((error,)) + data))


def joined_status(count: int, length: int, answers: Sequence[tuple[int, int, bytes]]) -> bytes:
    """The one packet with which servos answer a fast sync read, as far as they do.

    Each adds error, id, data, and the crc of all that stands before; the last of these is that of the packet.

    Args:
        count: of the servos that are asked.
        length: bytes that each is asked for.
        answers: id, error and data of those that answer before the first that does not.
    """
    size = 1 + count * (length + 4)
    packet = _HEADER + bytes((BROADCAST,)) + size.to_bytes(2, "little") + bytes((Instruction.STATUS,))
    for id, error, data in answers:
        packet += bytes((error, id)) + data
        packet += crc16(packet).to_bytes(2, "little")
    return packet


def errors(byte: int) -> frozenset[ErrorBit]:
    """What an answer's error byte says."""
    number = byte & ~_ALERT
    names: frozenset[ErrorBit] = frozenset({_NUMBERS[number]} if number in _NUMBERS else ())
    return names | {"hardware"} if byte & _ALERT else names


def error_byte(outcome: RequestOutcome, alarms: int) -> int:
    """The error byte of an answer: what became of the request, and whether the servo has an alarm."""
    return (_ALERT if alarms else 0) | _OUTCOMES[outcome]


def parse(buffer: bytes, ended: bool = False) -> tuple[list[Packet], bytes]:
    """The sound packets of a stream, and the rest that may become one with more bytes: ``sound_packets``.

    A false length holds up what follows for at most 1031 bytes.
    """
    return sound_packets(buffer, ended, _HEADER, _length, _opened)


def _length(data: bytes, i: int) -> int:
    """Bytes of the packet at an index; 0 if none can begin there."""
    if data[i + 4 : i + 5] == b"\xff":
        return 0
    length = int.from_bytes(data[i + 5 : i + 7], "little") if i + _OVERHEAD <= len(data) else _LEAST
    return _OVERHEAD + length if _LEAST <= length <= MOST else 0


def _opened(data: bytes) -> tuple[Packet, int] | None:
    """The packet, if its crc is right, and the bytes it uses up."""
    if int.from_bytes(data[-2:], "little") != crc16(data[:-2]):
        return None
    body = data[_OVERHEAD:-2].replace(_STUFFED, _PATTERN)
    return Packet(data[4], body[0], body[1:]), len(data)


def command_for(packet: Packet, id: int) -> Request | None:
    """What a packet asks of the servo of that id; None if it is not concerned."""
    params, everyone = packet.params, packet.id == BROADCAST
    match packet.instruction:
        case Instruction.STATUS:
            return None
        case Instruction.SYNC_WRITE:
            return sync_write_command(params[:4], params[4:], id, width=2) if everyone else None
        case Instruction.SYNC_READ | Instruction.FAST_SYNC_READ:
            before = ids_before(list(params[4:]), id)
            if before is None or not everyone:
                return None
            joined = tuple(params[4:]) if packet.instruction == Instruction.FAST_SYNC_READ else ()
            return Request("read", _number(params[:2]), _number(params[2:4]), after=before, joined=joined)
        case Instruction.BULK_READ:
            wanted = {row[0]: row for row in rows(params, 5) or ()}
            before = ids_before(list(wanted), id)
            if before is None or not everyone:
                return None
            return Request("read", _number(wanted[id][1:3]), _number(wanted[id][3:5]), after=before)
        case Instruction.BULK_WRITE:
            return _bulk_write(params, id) if everyone else None
        case Instruction.PING if everyone:
            return Request("ping", after=tuple(range(id)))
    return simple_command(packet, address_width=2) if packet.id in (id, BROADCAST) else None


def _bulk_write(params: bytes, id: int) -> Request | None:
    """Rows of id, address, length and as many bytes of data."""
    while len(params) >= 5:
        length = _number(params[3:5])
        if params[0] == id and 0 < length <= len(params) - 5:
            return Request("write", _number(params[1:3]), data=params[5 : 5 + length], answers=False)
        params = params[5 + length :]
    return None


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little")
