"""The protocols that servos speak: a file each, and a row here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from screwkin.errors import InputError
from screwkin.servo import protocol1, protocol2, protocol_scs
from screwkin.servo.line import ErrorBit
from screwkin.servo.packets import Packet, ProtocolFacts, ProtocolName, Request, RequestOutcome


class Codec(Protocol):
    """What a protocol's file holds."""

    @property
    def FACTS(self) -> ProtocolFacts:
        """Sizes, places, and how its servos behave."""

    def pack(self, packet: Packet) -> bytes:
        """A packet as bytes."""

    def status(self, id: int, error: int, data: bytes = b"") -> bytes:
        """A servo's answer as bytes."""

    def parse(self, buffer: bytes, ended: bool = False) -> tuple[list[Packet], bytes]:
        """The sound packets of a stream, and what may yet become one."""

    def command_for(self, packet: Packet, id: int) -> Request | None:
        """What a packet asks of the servo of that id."""

    def errors(self, byte: int) -> frozenset[ErrorBit]:
        """What an answer's error byte says."""

    def error_byte(self, outcome: RequestOutcome, alarms: int) -> int:
        """The error byte of an answer."""


CODECS: Mapping[ProtocolName, Codec] = {1.0: protocol1, 2.0: protocol2, "FT-SCS": protocol_scs}
"""Every protocol by its name."""


def protocol_named(text: str) -> ProtocolName:
    """The protocol that a text names; case does not matter.

    Raises:
        InputError: there is no such protocol; the message lists those there are.
    """
    for name in CODECS:
        if text.strip().lower() in (str(name).lower(), f"{name:g}" if isinstance(name, float) else name):
            return name
    raise _unknown(text)


def codec(protocol: ProtocolName) -> Codec:
    """The functions and facts of a protocol.

    Raises:
        InputError: there is no such protocol; the message lists those there are.
    """
    if protocol not in CODECS:
        raise _unknown(protocol)
    return CODECS[protocol]


def _unknown(protocol: ProtocolName) -> InputError:
    *most, last = map(str, CODECS)
    return InputError(f"invalid protocol {protocol}; expected {', '.join(most)} or {last}")
