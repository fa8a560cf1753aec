"""FT-SCS, the protocol of Feetech's magnetic servos (STS, SMS), as a servo sees it.

The frames are those of protocol 1.0, words low byte first, as there. There is a sync read, answered in turn,
and no bulk read. The error byte of an answer says how the servo fares, never what became of a command: who
writes must read back. Its bits: 0 voltage, 1 encoder, 2 overheat, 3 current, 5 overload.

    +----+----+----+-----+----+---------+--------+---------+-----+
    | FF | FF | FE | len | 82 | address | length | ids …   | sum |     a sync read
    +----+----+----+-----+----+---------+--------+---------+-----+

Source: the maker's description of the protocol (servos with magnetic encoders).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from screwkin.servo import protocol1
from screwkin.servo.line import ErrorBit
from screwkin.servo.packets import (
    BROADCAST,
    Instruction,
    Packet,
    Request,
    RequestOutcome,
    ids_before,
    simple_command,
    sync_write_command,
)
from screwkin.servo.protocol1 import pack, parse

__all__ = ["FACTS", "command_for", "error_byte", "errors", "pack", "parse", "status"]

FACTS = replace(
    protocol1.FACTS,
    name="FT-SCS",
    goal_switches_torque_on=False,
    model_at=3,
    levels=(0, 0, 1),
    locked_while_stiff=False,
)

_BITS: Mapping[int, ErrorBit] = {0: "voltage", 1: "hardware", 2: "overheat", 3: "overload", 5: "overload"}
_STATES = sum(1 << bit for bit in _BITS)


def status(id: int, error: int, data: bytes = b"") -> bytes:
    """A servo's answer as bytes."""
    return pack(Packet(id, error & _STATES, data))


def errors(byte: int) -> frozenset[ErrorBit]:
    """What an answer's error byte says."""
    return frozenset(name for bit, name in _BITS.items() if byte >> bit & 1)


def error_byte(outcome: RequestOutcome, alarms: int) -> int:
    """The error byte of an answer: the bits of the servo's alarms, whatever became of the request."""
    return alarms & _STATES


def command_for(packet: Packet, id: int) -> Request | None:
    """What a packet asks of the servo of that id; None if it is not concerned."""
    params, everyone = packet.params, packet.id == BROADCAST
    match packet.instruction:
        case Instruction.SYNC_WRITE:
            return sync_write_command(params[:2], params[2:], id, width=1) if everyone else None
        case Instruction.SYNC_READ:
            before = ids_before(list(params[2:]), id)
            if before is None or not everyone:
                return None
            return Request("read", params[0], params[1], after=before)
        case Instruction.REBOOT if packet.id in (id, BROADCAST):
            return Request("reboot", answers=False)
    return simple_command(packet, address_width=1) if packet.id in (id, BROADCAST) else None
