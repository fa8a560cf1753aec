"""Protocol 1.0 as a servo sees it.

    +----+----+----+-----+-------+-----------+-----+
    | FF | FF | id | len | instr | params …  | sum |     an instruction
    +----+----+----+-----+-------+-----------+-----+
    | FF | FF | id | len | error | data …    | sum |     an answer
    +----+----+----+-----+-------+-----------+-----+

len counts instr, params and sum; sum = ~(id + len + instr + params) & FF; id FE is everyone. Bits of error:
0 voltage, 1 angle limit, 2 overheat, 3 range, 4 checksum, 5 overload, 6 instruction.

Source: the maker's description of protocol 1.0.
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

_HEADER = b"\xff\xff"
_OVERHEAD = 4  # header, id, len
_LEAST = 2  # instruction, sum


def checksum(body: bytes) -> int:
    """The sum byte over id, len, instr and params."""
    return ~sum(body) & 0xFF


def pack(packet: Packet) -> bytes:
    """A packet as bytes; at most 253 bytes of parameters."""
    body = bytes((packet.id, len(packet.params) + 2, packet.instruction)) + packet.params
    return _HEADER + body + bytes((checksum(body),))


def status(id: int, error: int, data: bytes = b"") -> bytes:
    """A servo's answer as bytes."""
    return pack(Packet(id, error & 0x7F, data))


def parse(buffer: bytes, ended: bool = False) -> tuple[list[Packet], bytes]:
    """The sound packets of a stream, and the rest that may become one with more bytes: ``sound_packets``.

    A false length holds up what follows for at most 259 bytes.
    """
    return sound_packets(buffer, ended, _HEADER, _length, _opened)


def _length(data: bytes, i: int) -> int:
    """Bytes of the packet at an index; 0 if none can begin there."""
    if data[i + 2 : i + 3] == b"\xff":
        return 0
    told = data[i + 3] if i + 3 < len(data) else _LEAST
    return _OVERHEAD + told if told >= _LEAST else 0


def _opened(data: bytes) -> tuple[Packet, int] | None:
    """The packet, if its sum is right, and the bytes it uses up."""
    if data[-1] != checksum(data[2:-1]):
        return None
    # A sum of FF may be the next header's: it always is where one bit made len greater by one.
    return Packet(data[2], data[4], data[5:-1]), len(data) - (data[-1] == 0xFF)


def command_for(packet: Packet, id: int) -> Command | None:
    """What a packet asks of the servo of that id; None if it is not concerned."""
    params = packet.params
    if packet.instruction == Instruction.SYNC_WRITE:
        return sync_write_command(params[:2], params[2:], id, width=1) if packet.id == BROADCAST else None
    if packet.instruction == Instruction.BULK_READ:
        wanted = {row[1]: row for row in rows(params[1:], 3) or ()}
        before = turn(list(wanted), id)
        if before is None or packet.id != BROADCAST:
            return None
        return Command("read", wanted[id][2], wanted[id][0], after=before)
    return simple_command(packet, address_width=1) if packet.id in (id, BROADCAST) else None
