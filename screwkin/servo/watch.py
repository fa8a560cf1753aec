"""The watchdogs of a play: what is measured is held against thresholds; what crosses one is a named fault."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.servo.gate import Bounds
from screwkin.servo.line import ErrorBit

FaultKind = Literal[
    "tracking",
    "temperature",
    "voltage",
    "load",
    "torque",
    "servo",
    "lost",
    "unseen",
    "line",
    "late",
    "gate",
    "log",
    "guardian",
    "interrupted",
    "feedback",
]
_HEALTH: frozenset[ErrorBit] = frozenset(("voltage", "overheat", "overload", "hardware"))


@dataclass(frozen=True)
class ServoFault:
    """What stopped a play: joint and id ("" and -1 where it is the whole bus), time [s] in the play."""

    kind: FaultKind
    joint: str
    id: int
    time: float
    message: str

    def __str__(self) -> str:
        who = f"{self.joint} (servo {self.id})" if self.joint else "all joints (all servos)"
        return f"{self.kind} fault at {self.time:.2f} s: {who}: {self.message}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return asdict(self)


class PlayStopped(Exception):
    """Stops the frames; ``fault`` says why."""

    def __init__(self, fault: ServoFault) -> None:
        self.fault = fault
        super().__init__(str(fault))


@dataclass(frozen=True)
class Thresholds:
    """When a play is stopped.

    tracking [rad] from every goal of the last tracking_time [s]; temperature [degrees Celsius]; voltage as
    shares of the servo's nominal one; load [share of the greatest torque] for load_time [s]; lost: replies of
    one servo missing in a row; silence: replies missing in a row, of any; late [s]: of a frame; notice [s]:
    within which a blocked joint must be noticed; no servo may go unread for longer.
    """

    tracking: float = 0.25
    tracking_time: float = 0.1
    temperature: float = 65.0
    voltage_low: float = 0.75
    voltage_high: float = 1.25
    load: float = 0.95
    load_time: float = 0.5
    lost: int = 5
    silence: int = 6
    late: float = 0.2
    notice: float = 0.5

    @property
    def interval(self) -> float:
        """The longest time planned from one reading of a servo to the next [s].

        A blocked joint may be near its goals at one reading, by chance, but hardly at two.
        """
        return self.notice / 2


class Watch:
    """Remembers what has been seen of n servos, and raises what goes too far."""

    def __init__(self, bounds: Bounds, thresholds: Thresholds) -> None:
        n = len(bounds.ids)
        self.bounds, self.thresholds = bounds, thresholds
        self.max_tracking_error = 0.0
        self._goals: deque[tuple[float, Array]] = deque()
        self._seen = np.full(n, math.nan)
        self._loaded_since = np.full(n, math.nan)
        self._lost, self._silence = np.zeros(n, dtype=int), 0
        self.torque_limits: np.ndarray[Any, Any] | None = None

    def seen(self, k: int, values: Mapping[str, float], errors: frozenset[ErrorBit], time: float) -> None:
        """A servo has answered.

        Raises:
            PlayStopped: it complains, or is too hot, or its voltage is out of range.
        """
        self._lost[k], self._silence, self._seen[k] = 0, 0, time
        limit, nominal = self.thresholds, self.bounds.profiles[k].voltage
        if errors & _HEALTH:
            self._fault("servo", k, time, f"it reports {', '.join(sorted(errors & _HEALTH))}")
        if values["temperature"] > limit.temperature:
            self._fault(
                "temperature", k, time, f"{values['temperature']:.0f} degC, at most {limit.temperature:.0f}"
            )
        low, high = limit.voltage_low * nominal, limit.voltage_high * nominal
        if not low <= values["voltage"] <= high:
            self._fault("voltage", k, time, f"{values['voltage']:.1f} V, outside {low:.1f} to {high:.1f} V")

    def tracked(self, k: int, values: Mapping[str, float], command: float, time: float) -> None:
        """A servo that follows commands has answered. One reading is enough: the next may be long in coming.

        Raises:
            PlayStopped: it is too far off, or loaded too much for too long; or its torque was changed.
        """
        limit = self.thresholds
        error = abs(values["position"] - command)
        self.max_tracking_error = max(self.max_tracking_error, error)
        while len(self._goals) > 1 and self._goals[1][0] <= time - limit.tracking_time:
            self._goals.popleft()
        off = min([error, *(abs(values["position"] - float(goal[k])) for _, goal in self._goals)])
        if off > limit.tracking:
            self._fault("tracking", k, time, f"{off:.3f} rad off its goal, at most {limit.tracking:.3f}")
        load = abs(values["load"])
        if self._for_long(self._loaded_since, k, load > limit.load, time, limit.load_time):
            self._fault(
                "load", k, time, f"{100 * load:.0f} % of its torque, at most {100 * limit.load:.0f} %"
            )
        if values.get("torque_enable", 1.0) == 0.0:
            self._fault("torque", k, time, "its torque is off: it was reset, or shut itself down")
        if self.torque_limits is not None and values.get("torque_limit", -1.0) not in (
            -1.0,
            float(self.torque_limits[k]),
        ):
            limits = (
                f"its torque limit is {values['torque_limit']:.0f}, and was set to {self.torque_limits[k]}"
            )
            self._fault("torque", k, time, f"{limits}: it was reset, or shut itself down")

    def lost(self, k: int, time: float) -> None:
        """A reply is missing.

        Raises:
            PlayStopped: too many in a row.
        """
        self._lost[k] += 1
        self._silence += 1
        if self._silence >= self.thresholds.silence:
            text = f"{self._silence} replies in a row are missing, of servo {self.bounds.ids[k]} last"
            raise PlayStopped(ServoFault("lost", self.bounds.names[k], self.bounds.ids[k], time, text))
        if self._lost[k] >= self.thresholds.lost:
            self._fault("lost", k, time, f"{self._lost[k]} replies in a row are missing")

    def frame(self, goal: Array, by: float, time: float) -> None:
        """Goals (n,) [rad] were sent, late by so much [s].

        Raises:
            PlayStopped: by too much; or a servo has not been read for too long.
        """
        self._goals.append((time, goal))
        self._seen[np.isnan(self._seen)] = time
        k = int(self._seen.argmin())
        if (unseen := time - self._seen[k]) > self.thresholds.notice:
            text = f"it has not been read for {unseen:.2f} s, at most {self.thresholds.notice:.2f}"
            self._fault("unseen", k, time, text)
        if by > self.thresholds.late:
            text = f"a frame was sent {by:.3f} s late, at most {self.thresholds.late:.3f}"
            raise PlayStopped(ServoFault("late", "", -1, time, text))

    def _for_long(self, since: Any, k: int, bad: bool, time: float, allowed: float) -> bool:
        if not bad:
            since[k] = math.nan
        elif math.isnan(since[k]):
            since[k] = time
        return bool(time - since[k] >= allowed)

    def _fault(self, kind: FaultKind, k: int, time: float, message: str) -> None:
        raise PlayStopped(ServoFault(kind, self.bounds.names[k], self.bounds.ids[k], time, message))
