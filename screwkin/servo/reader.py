"""Reads servos in turn between the frames of a play: logs what they answer, and has it watched."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from screwkin.algebra.arrays import Array
from screwkin.servo.budget import block_of, budget
from screwkin.servo.bus import Bus, Grouped
from screwkin.servo.gate import Bounds
from screwkin.servo.line import BusError, LineLostError, Reply
from screwkin.servo.log import Log
from screwkin.servo.profiles import physical
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.watch import Watch


class Reader:
    """Reads n servos, in the order of the robot's joints.

    Args:
        bus: with the servos.
        servos: of the robot.
        bounds: of the same servos.
        rate: frames per second.
        log: where measurements go.
        watch: whom they are shown to.
    """

    def __init__(
        self, bus: Bus, servos: ServoMap, bounds: Bounds, rate: float, log: Log, watch: Watch
    ) -> None:
        self.bus, self.bounds, self.rate, self.log, self.watch = bus, bounds, rate, log, watch
        self._directions = [servo.direction for servo in servos.joints]
        self._queue = deque(range(len(bounds.ids)))
        self._blocks = [block_of(profile) for profile in bounds.profiles]

    @property
    def sees_torque(self) -> bool:
        """Whether every reading shows the torque limit."""
        return all("torque_limit" in names for _, _, names in self._blocks)

    def ask(self, k: int) -> Reply:
        """The bytes of a servo's block.

        Raises:
            BusError: it does not answer. LineLostError: the port is gone.
        """
        start, length, _ = self._blocks[k]
        return self.bus.read(self.bounds.ids[k], start, length)

    def values(self, k: int, reply: Reply) -> dict[str, float]:
        """The values of a servo's block in SI; the torque registers as they are."""
        profile = self.bounds.profiles[k]
        start, _, names = self._blocks[k]
        raw = {}
        for name in names:
            register = profile.register(name)
            raw[name] = int.from_bytes(reply.data[register.address - start : register.end - start], "little")
        values = {
            name.removeprefix("present_"): physical(profile, name, number)
            for name, number in raw.items()
            if name.startswith("present_")
        }
        values["position"] = self.bounds.radians_of(k, raw["present_position"])
        values["speed"] *= self._directions[k]
        values |= {name: float(raw[name]) for name in ("torque_enable", "torque_limit") if name in raw}
        return values

    def read(self, goal: Array, due: float, time: Callable[[], float]) -> None:
        """Read servos in turn until the next frame is near; who did not answer is first in the next frame.

        One is read wherever a reading of usual length fits: at the highest rates nothing else would see them.

        Args:
            goal: what the servos were sent to last (n,) [rad].
            due: when the next frame is [s of the bus's clock].
            time: the time in the play [s].

        Raises:
            PlayStopped: something went too far. LineLostError: the port is gone.
        """
        if self._grouped() != "none":
            self._read_group(goal, time)
            return
        again: list[int] = []
        estimate = self._estimate()
        for count in range(len(self._queue)):
            spare = min(count + 1.0, 2.0) * estimate  # the next may take longer than the mean
            if self.bus.clock.now() + spare > due:
                break
            k = self._queue.popleft()
            try:
                self._take(k, self.ask(k), goal, time())
                self._queue.append(k)
            except LineLostError:
                raise
            except BusError:
                again.append(k)
                self.watch.lost(k, time())
        self._queue.extendleft(reversed(again))

    def _read_group(self, goal: Array, time: Callable[[], float]) -> None:
        start, length, _ = self._blocks[0]
        count = max(1, budget(self.bounds.profiles, self.bus.baud).reads(self.rate))
        chosen = [self._queue[i] for i in range(min(count, len(self._queue)))]
        self._queue.rotate(-len(chosen))
        ids = [self.bounds.ids[k] for k in chosen]
        replies = self.bus.read_many(ids, start, length, self._grouped())
        for k, id in zip(chosen, ids, strict=True):
            if id in replies:
                self._take(k, replies[id], goal, time())
            else:
                self.watch.lost(k, time())

    def _grouped(self) -> Grouped:
        profiles = self.bounds.profiles
        if len({profile.model for profile in profiles}) > 1:
            return "none"
        if profiles[0].has_sync_read:
            return "sync"
        return "bulk" if profiles[0].has_bulk_read else "none"

    def _estimate(self) -> float:
        """Time that one more reading is likely to take [s]."""
        mean = self.bus.statistics.mean
        return budget(self.bounds.profiles, self.bus.baud).read if math.isnan(mean) else mean

    def _take(self, k: int, reply: Reply, goal: Array, time: float) -> None:
        values = self.values(k, reply)
        self.log.measured(k, values, time)
        self.watch.seen(k, values, reply.errors, time)
        self.watch.tracked(k, values, float(goal[k]), time)
