"""The protocols that servos speak: a file each, and a row here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from screwkin.errors import InputError
from screwkin.servo import protocol1, protocol2
from screwkin.servo.line import ErrorBit
from screwkin.servo.packets import Packet, ProtocolFacts, Request, RequestOutcome


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


CODECS: Mapping[float, Codec] = {1.0: protocol1, 2.0: protocol2}
"""Every protocol by its number."""


def codec(protocol: float) -> Codec:
    """The functions and facts of a protocol.

    Raises:
        InputError: there is no such protocol; the message lists those there are.
    """
    if protocol not in CODECS:
        raise InputError(f"invalid protocol {protocol}; expected {' or '.join(map(str, CODECS))}")
    return CODECS[protocol]
