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

from screwkin.servo.packets import (
    BROADCAST,
    Command,
    Instruction,
    Packet,
    rows,
    simple_command,
    sound_packets,
    sync_write_command,
    turn,
)

MOST = 1024
"""Bytes that ``len`` may count: servos have no room for more, so a greater length is noise."""

_HEADER = b"\xff\xff\xfd\x00"
_OVERHEAD = 7  # header, id, len
_LEAST = 3  # instruction, crc
_PATTERN, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
_POLYNOMIAL = 0x8005


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
    told = _HEADER + bytes((packet.id,)) + (len(body) + 2).to_bytes(2, "little") + body
    return told + crc16(told).to_bytes(2, "little")


def status(id: int, error: int, data: bytes = b"") -> bytes:
    """A servo's answer as bytes."""
    return pack(Packet(id, Instruction.STATUS, bytes((error,)) + data))


def parse(buffer: bytes, ended: bool = False) -> tuple[list[Packet], bytes]:
    """The sound packets of a stream, and the rest that may become one with more bytes: ``sound_packets``.

    A false length holds up what follows for at most 1031 bytes.
    """
    return sound_packets(buffer, ended, _HEADER, _length, _opened)


def _length(data: bytes, i: int) -> int:
    """Bytes of the packet at an index; 0 if none can begin there."""
    if data[i + 4 : i + 5] == b"\xff":
        return 0
    told = int.from_bytes(data[i + 5 : i + 7], "little") if i + _OVERHEAD <= len(data) else _LEAST
    return _OVERHEAD + told if _LEAST <= told <= MOST else 0


def _opened(data: bytes) -> tuple[Packet, int] | None:
    """The packet, if its crc is right, and the bytes it uses up."""
    if int.from_bytes(data[-2:], "little") != crc16(data[:-2]):
        return None
    body = data[_OVERHEAD:-2].replace(_STUFFED, _PATTERN)
    return Packet(data[4], body[0], body[1:]), len(data)


def command_for(packet: Packet, id: int) -> Command | None:
    """What a packet asks of the servo of that id; None if it is not concerned."""
    params, everyone = packet.params, packet.id == BROADCAST
    match packet.instruction:
        case Instruction.STATUS:
            return None
        case Instruction.SYNC_WRITE:
            return sync_write_command(params[:4], params[4:], id, width=2) if everyone else None
        case Instruction.SYNC_READ:
            before = turn(list(params[4:]), id)
            if before is None or not everyone:
                return None
            return Command("read", _number(params[:2]), _number(params[2:4]), after=before)
        case Instruction.BULK_READ:
            wanted = {row[0]: row for row in rows(params, 5) or ()}
            before = turn(list(wanted), id)
            if before is None or not everyone:
                return None
            return Command("read", _number(wanted[id][1:3]), _number(wanted[id][3:5]), after=before)
        case Instruction.BULK_WRITE:
            return _bulk_write(params, id) if everyone else None
        case Instruction.PING if everyone:
            return Command("ping", after=tuple(range(id)))
    return simple_command(packet, address_width=2) if packet.id in (id, BROADCAST) else None


def _bulk_write(params: bytes, id: int) -> Command | None:
    """Rows of id, address, length and as many bytes of data."""
    while len(params) >= 5:
        length = _number(params[3:5])
        if params[0] == id and 0 < length <= len(params) - 5:
            return Command("write", _number(params[1:3]), data=params[5 : 5 + length], answers=False)
        params = params[5 + length :]
    return None


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little")
