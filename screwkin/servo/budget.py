"""What a bus carries: how long a frame of goals and a reading take, and so how many frames there can be."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from screwkin.servo.bus import Grouped
from screwkin.servo.profiles import Profile
from screwkin.servo.protocols import codec

_BITS = 10  # per byte on the line
ADAPTER = 1e-3  # s that a USB adapter adds to a reply once its latency timer is 1 ms
BLOCK = ("torque_enable", "torque_limit", "present_position", "present_speed", "present_load")
HEALTH = ("present_voltage", "present_temperature")
_FARTHEST = 24  # bytes that are read along to have the torque registers in the same block


class RegisterBlock(NamedTuple):
    """The bytes that are read from a servo in a play: address, length, and where in them each register is."""

    start: int
    length: int
    places: Mapping[str, int]


def block_of(profile: Profile) -> RegisterBlock:
    """The registers of a play as they stand in a servo's table, with those between them."""
    names = [name for name in (*BLOCK, *HEALTH) if name in profile.registers]
    end = max(profile.register(name).end for name in names)
    names = [name for name in names if end - profile.register(name).address <= _FARTHEST]
    start = min(profile.register(name).address for name in names)
    return RegisterBlock(start, end - start, {name: profile.register(name).address - start for name in names})


def indirect_block(profile: Profile) -> RegisterBlock | None:
    """All registers of a play side by side, by indirect addresses; None where there is no room for them."""
    places, length = {}, 0
    for name in (*BLOCK, *HEALTH):
        places[name] = length
        length += profile.register(name).width
    shadows = profile.indirect
    return RegisterBlock(shadows.data, length, places) if shadows and length <= shadows.count else None


@dataclass(frozen=True)
class Budget:
    """Times [s] of one frame's goals, of reading one servo, and one more with it; servos on the bus."""

    write: float
    read: float
    more: float
    servos: int

    @property
    def full_rate(self) -> float:
        """Frames per second at which every servo can be read in every frame."""
        return 1.0 / (self.write + self.read + (self.servos - 1) * self.more)

    @property
    def limit(self) -> float:
        """Most frames per second: goals for all and the reading of one servo."""
        return 1.0 / (self.write + self.read)

    def reads(self, rate: float) -> int:
        """Servos that can be read in a frame at so many frames per second."""
        spare = 1.0 / rate - self.write - self.read
        return min(self.servos, 1 + int(spare / self.more + 1e-9)) if spare >= -1e-12 else 0

    def interval(self, rate: float) -> float:
        """Time [s] from one reading of a servo to the next at so many frames per second; infinite: none."""
        reads = self.reads(rate)
        return math.ceil(self.servos / reads) / rate if reads else math.inf

    def fastest(self, interval: float, below: float) -> int | None:
        """Most frames per second below a rate at which every servo is read so often [s]; None: none."""
        rates = range(math.ceil(below) - 1, 0, -1)
        return next((rate for rate in rates if self.interval(rate) <= interval), None)


def grouping(profiles: Sequence[Profile]) -> Grouped:
    """How the servos of a bus can be asked in one packet, whatever their firmware: all of one model."""
    if len({profile.model for profile in profiles}) > 1 or len(profiles) < 2:
        return "none"
    if profiles[0].has_sync_read:
        return "sync"
    return "bulk" if profiles[0].has_bulk_read else "none"


def _goal_rows(profile: Profile) -> tuple[int, ...]:
    """Bytes of a servo in each sync write of goals: one if position and speed lie side by side, else two."""
    first, last = sorted(
        (profile.register(name) for name in ("goal_position", "moving_speed")), key=lambda r: r.address
    )
    together = first.end == last.address
    return (first.width + last.width,) if together else (first.width, last.width)


def budget(
    profiles: tuple[Profile, ...],
    baud: int,
    return_delay: float = 500e-6,
    adapter: float = ADAPTER,
    answer: float | None = None,
    again: float | None = None,
) -> Budget:
    """The budget of a bus.

    Args:
        profiles: of all servos on it.
        baud: bits per second.
        return_delay: time [s] that a servo waits before it answers; 500 microseconds when new.
        adapter: time [s] that the adapter adds to an answer.
        answer: time [s] from a command to its answer, where it was measured.
        again: the same of a further one in the same frame.
    """
    byte = _BITS / baud
    facts = codec(profiles[0].protocol).FACTS
    rows = [_goal_rows(profile) for profile in profiles]
    goals = sum(len(row) + sum(row) for row in rows)  # an id before each
    models = {profile.model: row for profile, row in zip(profiles, rows, strict=True)}
    packets = sum(map(len, models.values()))
    longest = max(block_of(profile).length for profile in profiles)
    more = (facts.answer_size + longest) * byte + return_delay  # an answer that follows another
    read = facts.read_size * byte + more + adapter if answer is None else answer
    write = (goals + packets * facts.sync_size) * byte
    further = again or (read if grouping(profiles) == "none" else min(more, read))
    return Budget(write, read, further, len(profiles))
