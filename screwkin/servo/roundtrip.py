"""How long servos take to answer, as measured; how long to wait for them; what holds their answers back.

The time from a command to its answer is that of the bytes, of the servo (its return delay) and of the
adapter, which collects bytes for up to its ``latency_timer`` before it hands them on: 16 ms on FTDI chips as
they are sold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from screwkin.servo.bus import PATIENCE, Bus
from screwkin.servo.line import BusError, LineLostError

SAMPLES = 40
"""Answers that round trips are measured by before a play: about two of each servo."""
_LEAST = 0.008  # s: a computer that does something else for a moment is no servo that is silent
_MARGIN = 0.004  # s
_FACTOR = 1.5  # of what 99 % of the answers take
_SLOW = 0.004  # s: more than a servo and its bytes take at any usual rate
_FAILED = 2  # answers that may be missing among those that are measured
_USB_SERIAL = Path("/sys/bus/usb-serial/devices")


@dataclass(frozen=True)
class RoundTrip:
    """Times from command to answer [s]: the least, the median, the 99th percentile, of ``count`` answers."""

    least: float
    median: float
    most: float
    count: int

    @property
    def patience(self) -> float:
        """How long to wait for an answer [s]: well beyond what 99 % of them take."""
        return min(max(_LEAST, _FACTOR * self.most + _MARGIN), 2 * PATIENCE)

    @property
    def is_slow(self) -> bool:
        """Whether something between computer and servos holds the answers back."""
        return self.median > _SLOW

    def __str__(self) -> str:
        least, median, most = 1e3 * self.least, 1e3 * self.median, 1e3 * self.most
        return f"{least:.1f} ms at least, {median:.1f} ms in the median, {most:.1f} ms in 99 %"

    def to_dict(self) -> dict[str, float]:
        """As JSON data."""
        return asdict(self)


def round_trip(bus: Bus) -> RoundTrip | None:
    """The round trips of the last answers on a bus; None without any."""
    times = np.array(bus.statistics.recent)
    if not len(times):
        return None
    least, median, most = times.min(), np.median(times), np.quantile(times, 0.99)
    return RoundTrip(float(least), float(median), float(most), len(times))


def measured_round_trips(
    bus: Bus, ids: Sequence[int], address: int, length: int, count: int = SAMPLES
) -> RoundTrip:
    """The round trips of a bus, of the recent answers and as many more as it takes.

    Args:
        bus: with the servos.
        ids: of the servos to ask in turn.
        address: first byte of each servo's table that is read.
        length: number of bytes.
        count: least number of answers.

    Raises:
        BusError: servos do not answer. LineLostError: the port is gone.
    """
    failed = 0
    for k in range(count - len(bus.statistics.recent)):
        try:
            bus.read(ids[k % len(ids)], address, length)
        except LineLostError:
            raise
        except BusError:
            failed += 1
            if failed > _FAILED:
                raise
    trip = round_trip(bus)
    if trip is None:
        raise BusError("no servo answers")
    return trip


def latency_timer(port: str) -> int | None:
    """How long the adapter of a port collects bytes [ms], as Linux says; None where it does not."""
    try:
        return int((_USB_SERIAL / Path(port).resolve().name / "latency_timer").read_text())
    except (OSError, ValueError):
        return None


def latency_advice(port: str = "") -> str:
    """What to do about answers that are held back: the adapter's latency_timer, and the line that sets it."""
    name = Path(port).resolve().name
    name = name if name.startswith("tty") else "ttyUSB0"
    line = f"echo 1 | sudo tee {_USB_SERIAL}/{name}/latency_timer"
    timer = latency_timer(port) if port else None
    if timer is None:
        return f"set the latency_timer of the port's adapter to 1 ms (FTDI chips, on Linux: {line})"
    if timer > 1:
        return f"the latency_timer of {port} is {timer} ms; set it to 1: {line}"
    return f"the latency_timer of {port} is 1 ms already: use another adapter, or a lower --rate"


def first_patience(port: str) -> float:
    """How long to wait for a first answer [s], before any was measured."""
    timer = latency_timer(port)
    return PATIENCE if timer is None else min(PATIENCE, 1e-3 * timer + 0.010)
