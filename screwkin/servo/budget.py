"""What a bus carries: how long a frame of goals and a reading take, and so how many frames there can be."""

from __future__ import annotations

from dataclasses import dataclass

from screwkin.servo.profiles import Profile
from screwkin.servo.protocols import codec

_BITS = 10  # per byte on the line
ADAPTER = 1e-3  # s that a USB adapter adds to a reply once its latency timer is 1 ms
BLOCK = ("torque_enable", "torque_limit", "present_position", "present_speed", "present_load")
HEALTH = ("present_voltage", "present_temperature")
_FARTHEST = 24  # bytes that are read along to have the torque registers in the same block


def block_of(profile: Profile) -> tuple[int, int, tuple[str, ...]]:
    """Address and length of the bytes that are read from a servo in a play, and the registers in them."""
    names = [name for name in (*BLOCK, *HEALTH) if name in profile.registers]
    end = max(profile.register(name).end for name in names)
    names = [name for name in names if end - profile.register(name).address <= _FARTHEST]
    start = min(profile.register(name).address for name in names)
    return start, end - start, tuple(names)


@dataclass(frozen=True)
class Budget:
    """Times [s] of one frame's goals, and of reading one servo; servos on the bus."""

    write: float
    read: float
    servos: int

    @property
    def full_rate(self) -> float:
        """Frames per second at which every servo can be read in every frame."""
        return 1.0 / (self.write + self.servos * self.read)

    @property
    def limit(self) -> float:
        """Most frames per second: goals for all and the reading of one servo."""
        return 1.0 / (self.write + self.read)

    def reads(self, rate: float) -> int:
        """Servos that can be read in a frame at so many frames per second."""
        return max(0, min(self.servos, int((1.0 / rate - self.write) / self.read + 1e-9)))


def budget(
    profiles: tuple[Profile, ...], baud: int, return_delay: float = 500e-6, adapter: float = ADAPTER
) -> Budget:
    """The budget of a bus.

    Args:
        profiles: of all servos on it.
        baud: bits per second.
        return_delay: time [s] that a servo waits before it answers; 500 microseconds when new.
        adapter: time [s] that the adapter adds to an answer.
    """
    byte = _BITS / baud
    facts = codec(profiles[0].protocol).FACTS
    goals = sum(
        1 + profile.register("goal_position").width + profile.register("moving_speed").width
        for profile in profiles
    )
    packets = len({profile.model for profile in profiles})
    longest = max(block_of(profile)[1] for profile in profiles)
    read = (facts.read_size + facts.answer_size + longest) * byte + return_delay + adapter
    return Budget((goals + packets * facts.sync_size) * byte, read, len(profiles))
