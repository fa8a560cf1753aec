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

from collections.abc import Mapping

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

FACTS = ProtocolFacts(
    name=1.0,
    driver=1.0,
    id_at=2,
    length_at=3,
    error_at=4,
    length_width=1,
    counted=2,
    read_size=8,
    answer_size=6,
    sync_size=8,
    driver_options=(),
    goal_switches_torque_on=True,
    model_at=-1,
    ping_names_model=False,
    levels=(0, 1, 2),
    partial_reset=False,
    locked_while_stiff=True,
)

_HEADER = b"\xff\xff"
_OVERHEAD = 4  # header, id, len
_LEAST = 2  # instruction, sum
_BITS: tuple[ErrorBit, ...] = (
    "voltage",
    "angle limit",
    "overheat",
    "range",
    "checksum",
    "overload",
    "instruction",
)  # bits 0 to 6 of the error byte
_OUTCOMES: Mapping[RequestOutcome, int] = {
    "done": 0,
    "angle": 0x02,
    "limit": 0x08,
    "range": 0x08,
    "access": 0x08,
    "instruction": 0x40,
}


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


def errors(byte: int) -> frozenset[ErrorBit]:
    """What an answer's error byte says."""
    return frozenset(name for bit, name in enumerate(_BITS) if byte >> bit & 1)


def error_byte(outcome: RequestOutcome, alarms: int) -> int:
    """The error byte of an answer: what became of the request, and the bits of the servo's alarms."""
    return alarms | _OUTCOMES[outcome]


def parse(buffer: bytes, ended: bool = False) -> tuple[list[Packet], bytes]:
    """The sound packets of a stream, and the rest that may become one with more bytes: ``sound_packets``.

    A false length holds up what follows for at most 259 bytes.
    """
    return sound_packets(buffer, ended, _HEADER, _length, _opened)


def _length(data: bytes, i: int) -> int:
    """Bytes of the packet at an index; 0 if none can begin there."""
    if data[i + 2 : i + 3] == b"\xff":
        return 0
    length = data[i + 3] if i + 3 < len(data) else _LEAST
    return _OVERHEAD + length if length >= _LEAST else 0


def _opened(data: bytes) -> tuple[Packet, int] | None:
    """The packet, if its sum is right, and the bytes it uses up."""
    if data[-1] != checksum(data[2:-1]):
        return None
    # A sum of FF may be the next header's: it always is where one wrong bit raises len by one.
    return Packet(data[2], data[4], data[5:-1]), len(data) - (data[-1] == 0xFF)


def command_for(packet: Packet, id: int) -> Request | None:
    """What a packet asks of the servo of that id; None if it is not concerned."""
    params = packet.params
    if packet.instruction == Instruction.SYNC_WRITE:
        return sync_write_command(params[:2], params[2:], id, width=1) if packet.id == BROADCAST else None
    if packet.instruction == Instruction.BULK_READ:
        wanted = {row[1]: row for row in rows(params[1:], 3) or ()}
        before = ids_before(list(wanted), id)
        if before is None or packet.id != BROADCAST:
            return None
        return Request("read", wanted[id][2], wanted[id][0], after=before)
    return simple_command(packet, address_width=1) if packet.id in (id, BROADCAST) else None
