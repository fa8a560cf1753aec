"""Key points of a gait's channels: when (fraction of Tc) and what (a number or a formula), with their checks.

A channel covers one step, n even or odd alike, or a whole cycle of two steps (its last time is
then 2). How it goes on from step to step is its kind:

- ``swing``: only for the swinging foot, constant before and after;
- ``advance``: gains one per step (the waist's progress along its path);
- ``alternate``: changes its sign with every step (what sways or swings left and right);
- ``repeat``: the same in every step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import Fault, near
from screwkin.model.expression import ExpressionError, UnresolvedError, evaluate

ChannelKind = Literal["swing", "advance", "alternate", "repeat"]

CHANNELS: Mapping[str, ChannelKind] = {
    "foot_progress": "swing",
    "foot_height": "swing",
    "waist_progress": "advance",
    "waist_side": "alternate",
    "hand_forward": "alternate",
    "hand_raise": "repeat",
}
"""Every channel that a gait may have, and how it goes on from step to step."""

_CLOSEST = 1e-6  # of Tc: key times nearer than that make splines of absurd steepness
_SAME = 1e-9  # values that must be equal but may be written as different formulas
_LONGEST_TC = 1e3  # s: where the search for a workable Tc gives up


@dataclass(frozen=True, eq=False)
class Channel:
    """A channel's evaluated key points: ``at`` (k,) in steps, ``value`` (k,) in the channel's unit."""

    name: str
    at: Array
    value: Array

    @property
    def kind(self) -> ChannelKind:
        """How it goes on from step to step."""
        return CHANNELS[self.name]


def read_channel(
    name: str, raw: Any, numbers: Mapping[str, float | None], faults: list[Fault]
) -> Channel | None:
    """The channel of a gait file's table ``[channel.NAME]``, or None after adding its faults.

    Args:
        name: of the channel, one of ``CHANNELS``.
        raw: the table: ``at`` and ``value``, lists of numbers and formulas.
        numbers: parameters of the gait by name; None for one that is itself faulty.
        faults: collects what is wrong.
    """
    row = f"[channel.{name}]"
    if not isinstance(raw, Mapping):
        faults.append(Fault(row, "", f"{raw!r} is no table", "Write lists at = [...] and value = [...]"))
        return None
    for key in raw:
        if key not in ("at", "value"):
            faults.append(Fault(row, key, "unknown key", f"{near(key, ('at', 'value'))}Valid: at, value"))
    at, value = (_evaluated(row, key, raw.get(key), numbers, faults) for key in ("at", "value"))
    if at is None or value is None:
        return None
    if len(at) != len(value):
        found = f"{len(at)} times for {len(value)} values"
        faults.append(Fault(row, "at", found, "Give every value its time"))
        return None
    return Channel(name, np.array(at), np.array(value))


def _evaluated(
    row: str, key: str, raw: Any, numbers: Mapping[str, float | None], faults: list[Fault]
) -> list[float] | None:
    """Numbers of a list of formulas, or None after adding the fault of each."""
    if not isinstance(raw, Sequence) or isinstance(raw, str) or len(raw) < 2:
        found = "missing" if raw is None else f"{raw!r} is no list of at least two key points"
        faults.append(Fault(row, key, found, "Write a list such as [0, 0.5, 1]"))
        return None
    values: list[float] = []
    for i, item in enumerate(raw):
        try:
            values.append(float(evaluate(item, numbers)))
        except UnresolvedError:
            continue
        except ExpressionError as error:
            faults.append(Fault(row, f"{key}.{i}", error.found, error.fix))
    return values if len(values) == len(raw) else None


def increases(channel: Channel) -> bool:
    """Whether every key time lies after the one before it."""
    return bool(np.all(np.diff(channel.at) > _CLOSEST))


def channel_faults(channel: Channel, Tc: float, works_at: Callable[[float], bool]) -> list[Fault]:
    """What is wrong with a channel's times and values.

    Args:
        channel: evaluated key points.
        Tc: period of a step [s].
        works_at: whether the channel's times increase at another Tc.
    """
    row, at, value = f"[channel.{channel.name}]", channel.at, channel.value
    if not increases(channel):
        early = int(np.argmax(np.diff(at) <= _CLOSEST))
        found = (
            f"time {at[early + 1]:.6g} Tc of key point {early + 1} is not after {at[early]:.6g} Tc of the one"
            f" before it (Tc = {Tc:g} s)"
        )
        least = _smallest_period(Tc, works_at)
        fix = "Write the times in increasing order"
        if least:
            fix = f"Raise Tc to at least {math.ceil(1e3 * least) / 1e3:g} s"
        return [Fault(row, "at", found, fix)]
    if channel.kind == "swing":
        return _swing_faults(channel, row)
    faults = []
    if abs(at[0]) > _SAME or min(abs(at[-1] - 1), abs(at[-1] - 2)) > _SAME:
        found = f"runs from {at[0]:g} to {at[-1]:g}"
        return [Fault(row, "at", found, "Begin at 0 and end at 1 (one step) or 2 (a cycle of two)")]
    steps = round(float(at[-1]))
    flips = channel.kind == "alternate" and steps == 1
    wanted = -value[0] if flips else value[0] + (steps if channel.kind == "advance" else 0)
    if abs(value[-1] - wanted) > _SAME * max(1.0, abs(wanted)):
        why = {"advance": f"{steps} more than", "alternate": "opposite to" if flips else "equal to"}
        relation = why.get(channel.kind, "equal to")
        found = f"ends at {value[-1]:g} after beginning at {value[0]:g}"
        faults.append(Fault(row, "value", found, f"Make the last value {relation} the first: {wanted:g}"))
    if channel.kind == "advance" and abs(value[0]) > _SAME:
        faults.append(Fault(row, "value.0", f"{value[0]:g} is not 0", "Progress begins at 0"))
    return faults


def _swing_faults(channel: Channel, row: str) -> list[Fault]:
    faults = []
    if channel.at[0] < 0 or channel.at[-1] > 1:
        found = f"runs from {channel.at[0]:.6g} to {channel.at[-1]:.6g}"
        faults.append(Fault(row, "at", found, "Keep the swing between 0 and 1"))
    ends = (0.0, 1.0) if channel.name == "foot_progress" else (0.0, 0.0)
    for i, wanted in zip((0, len(channel.value) - 1), ends, strict=True):
        if abs(channel.value[i] - wanted) > _SAME:
            found = f"{channel.value[i]:g} is not {wanted:g}"
            where = "foothold to foothold" if channel.name == "foot_progress" else "floor to floor"
            faults.append(Fault(row, f"value.{i}", found, f"A swing goes from {where}"))
    return faults


def _smallest_period(Tc: float, works_at: Callable[[float], bool]) -> float | None:
    """Smallest Tc [s] above the given one at which the key times increase, to 0.1 ms; None if none is."""
    low, high = Tc, Tc
    while not works_at(high):
        low, high = high, 1.1 * high
        if high > _LONGEST_TC:
            return None
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if works_at(middle) else (middle, high)
    return high
