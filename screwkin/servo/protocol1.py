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
    """The sound packets of a stream, in order, and the rest that may become one with more bytes.

    Where a packet proves false, the search goes on one byte behind its beginning, so that a false header or a
    lost byte costs no packet that follows. A false length may hold up what follows until so many bytes are
    there (at most 259) or the line has fallen silent; pass ``ended`` then, and nothing is waited for.
    """
    data = bytes(buffer)
    packets: list[Packet] = []
    end = 0  # of the last packet, or of what was passed over
    while (i := data.find(_HEADER, end)) >= 0:
        end = i + 1
        if data[i + 2 : i + 3] == b"\xff":
            continue
        whole = _OVERHEAD + (data[i + 3] if i + 3 < len(data) else _LEAST)
        if i + whole > len(data):
            if not ended:
                return packets, data[i:]
        elif whole >= _OVERHEAD + _LEAST and data[i + whole - 1] == checksum(data[i + 2 : i + whole - 1]):
            packets.append(Packet(data[i + 2], data[i + 4], data[i + 5 : i + whole - 1]))
            # A sum of FF may be the next header's: it always is where one bit made len greater by one.
            end = i + whole - (data[i + whole - 1] == 0xFF)
    half = b"\xff" if not ended and len(data) > end and data[-1] == 0xFF else b""
    return packets, half


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
