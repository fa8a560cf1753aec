"""What the makers' driver takes for its serial port: any line, and any clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from screwkin.errors import ScrewkinError
from screwkin.servo.line import ByteLine, Clock, LineLostError

_MOST_NOISE = 4096  # bytes of one reply that are waited through before a babbling line counts as silent
_BITS_PER_BYTE = 10  # a start bit, eight data bits and a stop bit


class DriverPort:
    """A line and a clock, by the names that the driver calls."""

    def __init__(self, line: ByteLine, clock: Clock, baud: int, patience: float) -> None:
        self.line, self.clock, self.baud, self.patience = line, clock, baud, patience
        self.is_open, self.is_using = True, False
        self.deadline, self.taken = clock.now(), 0

    def getBaudRate(self) -> int:
        """Bits per second."""
        return self.baud

    def clearPort(self) -> None:
        """Forget what has arrived."""
        self._guarded(self.line.reset_input_buffer)

    def writePort(self, packet: Sequence[int]) -> int:
        """Send a packet; returns how many bytes were sent."""
        sent = self._guarded(lambda: self.line.write(bytes(packet)))
        return len(packet) if sent is None else int(sent)

    def readPort(self, length: int) -> bytes:
        """At most so many of the bytes that have arrived; waits a little where there are none."""
        if self.taken >= _MOST_NOISE:
            return b""
        data = bytes(self._guarded(lambda: self.line.read(max(0, length))))
        self.taken += len(data)
        if not data and length > 0:
            self.clock.sleep(1e-4)
        return data

    def setPacketTimeout(self, packet_length: int) -> None:
        """Begin to wait for a packet of so many bytes."""
        self.setPacketTimeoutMillis(1e3 * (packet_length * _BITS_PER_BYTE / self.baud + self.patience))

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Begin to wait for so many milliseconds."""
        self.deadline, self.taken = self.clock.now() + 1e-3 * msec, 0

    def isPacketTimeout(self) -> bool:
        """Whether that time is over, or the line babbles."""
        return self.clock.now() > self.deadline or self.taken >= _MOST_NOISE

    def _guarded(self, act: Callable[[], Any]) -> Any:
        """A line that fails is lost; pulled ports raise OSError, TypeError, or termios.error (neither)."""
        try:
            return act()
        except ScrewkinError:
            raise
        except Exception as error:
            raise LineLostError(f"the port is gone ({error}): check the cable") from None
