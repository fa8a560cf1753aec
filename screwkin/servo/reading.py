"""Servos are read in turn while frames are sent, as many in each as there is time for."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from screwkin.errors import SafetyError
from screwkin.servo.budget import block_of, budget, grouping, indirect_block
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds
from screwkin.servo.line import BusError, LineLostError, Reply
from screwkin.servo.profiles import decode, physical
from screwkin.servo.roundtrip import RoundTrip, latency_advice, measured_round_trips

_MEASURED = 2  # times before a refusal: a computer that stands still for a moment is no slow adapter

_GROUPS = 3  # readings of all servos in one packet by which a further answer is measured
_LEAST = 1e-4  # s

Taken = Callable[[int, Reply], None]
"""Called with joint and answer."""


class Readings:
    """The servos of a bus in the order in which they are to be read.

    Args:
        bus: with the servos.
        bounds: which they are.
    """

    def __init__(self, bus: Bus, bounds: Bounds) -> None:
        self.bus, self.bounds = bus, bounds
        self.blocks = [block_of(profile) for profile in bounds.profiles]
        self.grouped = grouping(bounds.profiles)
        self.budget = budget(bounds.profiles, bus.baud)
        self._queue, self._more = deque(range(len(bounds.ids))), self.budget.more

    def ask(self, k: int) -> Reply:
        """The bytes of the servo of joint k that a play looks at.

        Raises:
            BusError: no sound reply. LineLostError: the port is gone.
        """
        start, length, _ = self.blocks[k]
        return self.bus.read(self.bounds.ids[k], start, length)

    def values(self, k: int, reply: Reply) -> dict[str, float]:
        """The values of a servo's block in SI; the torque registers as they are."""
        profile = self.bounds.profiles[k]
        raw = {
            name: int.from_bytes(reply.data[at : at + profile.register(name).width], "little")
            for name, at in self.blocks[k].places.items()
        }
        values = {
            name.removeprefix("present_"): physical(profile, name, number)
            for name, number in raw.items()
            if name.startswith("present_")
        }
        position = decode(profile.register("present_position"), raw["present_position"])
        values["position"] = self.bounds.radians_of(k, position)
        values["speed"] *= math.copysign(1.0, self.bounds.scale[k])
        values |= {name: float(raw[name]) for name in ("torque_enable", "torque_limit") if name in raw}
        return values

    def plan(self, rate: float, interval: float) -> None:
        """Measure how long answers take, wait for them accordingly, and plan the readings by that.

        Args:
            rate: frames per second.
            interval: longest time from one reading of a servo to the next [s].

        Raises:
            SafetyError: servos would be read more rarely, one has fallen silent, or the port is gone.
        """
        for _ in range(_MEASURED):
            trip, again = self._answers_take()
            carried = budget(self.bounds.profiles, self.bus.baud, answer=trip.median, again=again)
            if carried.interval(rate) <= interval + 1e-9:
                self.bus.patience, self.budget, self._more = trip.patience, carried, carried.more
                return
            self.bus.statistics.recent.clear()
        reads, apart = carried.reads(rate), carried.interval(rate)
        often = f"read every {apart:.2f} s" if reads else "read at all"
        slower = carried.fastest(interval, rate)
        advice = [latency_advice(self.bus.port)] if trip.is_slow else ["raise the bus's baud rate"]
        advice += [f"play at --rate {slower}"] if slower else []
        advice += [f"accept that it is noticed within --notice {2 * apart:.2f} s only"] if reads else []
        raise SafetyError(
            f"at {rate:g} frames per second a servo would {'only ' if reads else 'not '}be {often}, and must "
            f"be every {interval:.2f} s for a blocked joint to be noticed: an answer takes {trip}; "
            + "; or ".join(advice)
        )

    def _answers_take(self) -> tuple[RoundTrip, float]:
        """Times of single answers, and of a further one in a frame [s], asked for as quickly as can be."""
        ids = self.bounds.ids
        try:
            self._agree()
            start, length, _ = self.blocks[0]
            trip = measured_round_trips(self.bus, ids, start, length)
            if self.grouped == "none":
                return trip, trip.most
            began = self.bus.clock.now()
            for _ in range(_GROUPS):
                self.bus.read_many(ids, start, length, self.grouped)
            lasted = (self.bus.clock.now() - began) / _GROUPS
        except LineLostError as error:
            raise SafetyError(f"the servos cannot be asked: {error}") from None
        except BusError as error:
            raise SafetyError(f"the servos are not ready: {error}") from None
        return trip, min(max((lasted - trip.median) / (len(ids) - 1), _LEAST), trip.most)

    def _agree(self) -> None:
        """Read from now on in the quickest way that all servos know, by their model and firmware.

        Torque registers that stand far from the measurements are read along by indirect addresses.

        Raises:
            BusError: one does not answer. LineLostError: the port is gone.
        """
        profile = self.bounds.profiles[0]
        if self.grouped != "sync" or not (profile.indirect or profile.fast_sync_read):
            return
        register = profile.register("firmware")
        firmware = min(self.bus.read(id, register.address, register.width).value for id in self.bounds.ids)
        if profile.fast_sync_read and firmware >= profile.fast_sync_read:
            self.grouped = "fast"
        block, shadows = indirect_block(profile), profile.indirect
        if block and shadows and firmware >= shadows.firmware:
            rows = [profile.register(name) for name in block.places]
            named = [place for row in rows for place in range(row.address, row.end)]
            data = b"".join(place.to_bytes(2, "little") for place in named)
            for id in self.bounds.ids:
                self.bus.write(id, shadows.addresses, int.from_bytes(data, "little"), len(data))
            self.blocks = [block] * len(self.blocks)

    def torque_is_read(self) -> bool:
        """Whether the torque limit is among what is read of every servo."""
        return all("torque_limit" in names for _, _, names in self.blocks)

    def read(self, due: float, taken: Taken, lost: Callable[[int], None]) -> None:
        """Read servos in turn until the next frame is near; who did not answer is first in the next frame.

        One is read wherever a reading of usual length fits: at the highest rates nothing else would see them.

        Args:
            due: when the next frame is to be sent [s of the bus's clock].
            taken: called for every answer.
            lost: called with the joint of every answer that is missing.

        Raises:
            LineLostError: the port is gone.
        """
        if self.grouped != "none":
            self._read_group(due, taken, lost)
            return
        again: list[int] = []
        for count in range(len(self._queue)):
            spare = self.budget.more if count else self.budget.read  # a further one may take longer
            if self.bus.clock.now() + spare > due:
                break
            k = self._queue.popleft()
            try:
                taken(k, self.ask(k))
                self._queue.append(k)
            except LineLostError:
                raise
            except BusError:
                again.append(k)
                lost(k)
        self._queue.extendleft(reversed(again))

    def _read_group(self, due: float, taken: Taken, lost: Callable[[int], None]) -> None:
        """Read as many in one packet as fit, by what that took last time."""
        now, usual = self.bus.clock.now, self.budget.read
        began = now()
        spare = due - began - usual
        if spare < 0:
            return  # else all later frames would be late too
        start, length, _ = self.blocks[0]
        chosen = [self._queue[i] for i in range(min(1 + int(spare / self._more), len(self._queue)))]
        self._queue.rotate(-len(chosen))
        ids = [self.bounds.ids[k] for k in chosen]
        replies = self.bus.read_many(ids, start, length, self.grouped)
        if len(ids) > 1:
            self._more = max(self.budget.more, (now() - began - usual) / (len(ids) - 1))
        for k, id in zip(chosen, ids, strict=True):
            if id in replies:
                taken(k, replies[id])
            else:
                lost(k)
