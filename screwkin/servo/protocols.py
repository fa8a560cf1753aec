"""The functions of either protocol under one name."""

from __future__ import annotations

from typing import Protocol, cast

from screwkin.servo import protocol1, protocol2
from screwkin.servo.packets import Command, Packet


class Codec(Protocol):
    """The functions of a protocol."""

    def pack(self, packet: Packet) -> bytes:
        """A packet as bytes."""

    def status(self, id: int, error: int, data: bytes = b"") -> bytes:
        """A servo's answer as bytes."""

    def parse(self, buffer: bytes, ended: bool = False) -> tuple[list[Packet], bytes]:
        """The sound packets of a stream, and what may yet become one."""

    def command_for(self, packet: Packet, id: int) -> Command | None:
        """What a packet asks of the servo of that id."""


def codec(protocol: float) -> Codec:
    """The functions of protocol 1.0 or 2.0."""
    return cast(Codec, protocol2 if protocol == 2.0 else protocol1)
