"""Footholds that a gait lists, one after the other: where each step ends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from screwkin.errors import Fault, near
from screwkin.model.expression import ExpressionError, UnresolvedError, evaluate, names_in

KEYS = ("x", "y", "yaw")
"""What a row ``[[foothold]]`` holds."""
HEIGHT = "z"
"""What it may hold beside: the height of the foothold [m], else 0."""


@dataclass(frozen=True)
class StepEnd:
    """Where a step ends: x, y, z [m] and yaw [rad] of the foot that swings, in the floor's frame."""

    x: float
    y: float
    yaw: float
    z: float = 0.0

    def to_dict(self) -> dict[str, float]:
        """As a row ``[[foothold]]``; level with the floor there is no z."""
        row = {"x": self.x, "y": self.y, "yaw": self.yaw}
        return row | {HEIGHT: self.z} if self.z else row


def read_places(
    rows: Any, numbers: Mapping[str, float | None], unknown: frozenset[str], faults: list[Fault]
) -> tuple[StepEnd, ...]:
    """The rows ``[[foothold]]`` of a gait.

    Args:
        rows: tables with ``KEYS`` and perhaps ``HEIGHT``, numbers or formulas.
        numbers: parameters of the gait by name; None for one that is itself faulty.
        unknown: names of those that depend on a robot which is not known yet; what depends on them is NaN.
        faults: collects what is wrong.
    """
    if not isinstance(rows, Sequence) or not all(isinstance(row, Mapping) for row in rows):
        fix = "Write [[foothold]] above x, y and yaw of every step"
        faults.append(Fault("[[foothold]]", "", f"{rows!r} is no list of tables", fix))
        return ()
    places = []
    for i, row in enumerate(rows):
        name = f"[[foothold]] {i + 1}"
        for key in row:
            if key not in (*KEYS, HEIGHT):
                fix = f"{near(key, (*KEYS, HEIGHT))}Valid: {', '.join((*KEYS, HEIGHT))}"
                faults.append(Fault(name, key, "unknown key", fix))
        keys = (*KEYS, HEIGHT) if HEIGHT in row else KEYS
        values = [_number(name, key, row, numbers, unknown, faults) for key in keys]
        if None not in values:
            places.append(StepEnd(*(float(value) for value in values if value is not None)))
    return tuple(places)


def _number(
    name: str,
    key: str,
    row: Mapping[str, Any],
    numbers: Mapping[str, float | None],
    unknown: frozenset[str],
    faults: list[Fault],
) -> float | None:
    if key not in row:
        faults.append(Fault(name, key, "missing", "Give x, y [m] and yaw [rad] of the foot that swings"))
        return None
    try:
        value = float(evaluate(row[key], numbers))
    except UnresolvedError:
        return None
    except ExpressionError as error:
        faults.append(Fault(name, key, error.found, error.fix))
        return None
    if not math.isfinite(value):
        faults.append(Fault(name, key, f"{value!r} is no length or angle", "Give a finite number"))
        return None
    return math.nan if unknown & {*names_in(row[key])} else value
