"""The watchdogs of a play: what is measured is held against thresholds; what crosses one is a named fault."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

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
    "line",
    "late",
    "gate",
    "interrupted",
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

    tracking [rad] for tracking_time [s]; temperature [degrees Celsius]; voltage as shares of the servo's
    nominal one; load [share of the greatest torque] for load_time [s]; lost: replies of one servo missing
    in a row; silence: replies missing in a row, of any; late [s]: of a frame.
    """

    tracking: float = 0.4
    tracking_time: float = 0.2
    temperature: float = 65.0
    voltage_low: float = 0.75
    voltage_high: float = 1.25
    load: float = 0.95
    load_time: float = 0.5
    lost: int = 5
    silence: int = 6
    late: float = 0.2


class Watch:
    """Remembers what has been seen of n servos, and raises what goes too far."""

    def __init__(self, bounds: Bounds, thresholds: Thresholds) -> None:
        n = len(bounds.ids)
        self.bounds, self.thresholds = bounds, thresholds
        self.max_tracking_error = 0.0
        self._off_since = np.full(n, math.nan)
        self._loaded_since = np.full(n, math.nan)
        self._lost, self._silence = np.zeros(n, dtype=int), 0
        self.torque_limits: np.ndarray[Any, Any] | None = None

    def seen(self, k: int, values: Mapping[str, float], errors: frozenset[ErrorBit], time: float) -> None:
        """A servo has answered.

        Raises:
            PlayStopped: it complains, or is too hot, or its voltage is out of range.
        """
        self._lost[k], self._silence = 0, 0
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
        """A servo that follows commands has answered.

        Raises:
            PlayStopped: it is too far off, or loaded too much, for too long; or its torque was changed.
        """
        limit = self.thresholds
        error = abs(values["position"] - command)
        self.max_tracking_error = max(self.max_tracking_error, error)
        if self._for_long(self._off_since, k, error > limit.tracking, time, limit.tracking_time):
            self._fault("tracking", k, time, f"{error:.3f} rad off its goal, at most {limit.tracking:.3f}")
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

    def late(self, by: float, time: float) -> None:
        """A frame was sent late.

        Raises:
            PlayStopped: by too much.
        """
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
