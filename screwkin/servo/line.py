"""A line to servos, the clock it goes by, what comes back over it, and what can go wrong with it."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Literal, Protocol

from screwkin.errors import InputError, NoSolutionError

ErrorBit = Literal[
    "voltage", "angle limit", "overheat", "range", "checksum", "overload", "instruction", "hardware", "access"
]
REFUSED: frozenset[ErrorBit] = frozenset(("angle limit", "range", "instruction", "access"))
"""Errors of a command that was not carried out; the others are about the servo's health."""


class BusError(NoSolutionError, OSError):
    """The servo ``id`` does not answer, or not with sense."""

    def __init__(self, message: str, id: int = -1) -> None:
        self.id = id
        super().__init__(message)


class DamagedError(BusError):
    """Something answers, but never a sound packet: noise, a wrong rate, or two servos with one id."""


class LineLostError(BusError):
    """The port itself is gone: the cable or the adapter was pulled."""


class PortError(InputError, OSError):
    """The port cannot be opened."""


class RefusedError(BusError):
    """A servo refused a command; ``errors`` names its error bits."""

    def __init__(self, message: str, id: int, errors: frozenset[ErrorBit]) -> None:
        self.errors = errors
        super().__init__(message, id)


class ByteLine(Protocol):
    """Bytes out and in; a pyserial port with ``timeout=0`` is one."""

    def write(self, data: bytes) -> int | None:
        """Send the bytes."""

    def read(self, size: int) -> bytes:
        """At most so many of the bytes that have arrived; never waits."""

    def reset_input_buffer(self) -> None:
        """Forget what has arrived."""

    def close(self) -> None:
        """Give the line back."""


class Clock(Protocol):
    """A clock that never goes back."""

    def now(self) -> float:
        """Time [s]."""

    def sleep(self, seconds: float) -> None:
        """Wait."""


class MonotonicClock:
    """The computer's own."""

    def now(self) -> float:
        """Time [s] since some moment."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(max(0.0, seconds))


@dataclass(frozen=True)
class Reply:
    """What a servo answered: its bytes, and what it complains about."""

    id: int
    data: bytes
    errors: frozenset[ErrorBit] = frozenset()

    @property
    def value(self) -> int:
        """The bytes as one number, least significant byte first."""
        return int.from_bytes(self.data, "little")


@dataclass
class Statistics:
    """Counts of exchanges that wait for a reply, and their round-trip times [s], the recent ones singly."""

    exchanges: int = 0
    retries: int = 0
    silent: int = 0
    corrupt: int = 0
    failed: int = 0
    longest: float = 0.0
    total: float = 0.0
    recent: deque[float] = field(default_factory=lambda: deque(maxlen=1000))

    def answered(self, lasted: float) -> None:
        """Count a reply that took so long [s]."""
        self.recent.append(lasted)
        self.longest = max(self.longest, lasted)
        self.total += lasted

    @property
    def mean(self) -> float:
        """Mean time from command to reply [s]; NaN without any."""
        answered = self.exchanges - self.failed
        return self.total / answered if answered else math.nan
