"""Contestants of a workload: what each runs, what came out, and whether all agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Array = Any
Result = Mapping[str, Array]


def _as_it_is(raw: Any) -> Result:
    found: Result = raw
    return found


@dataclass(frozen=True, eq=False)
class Contestant:
    """One way to compute a workload; everything that is not to be timed has been done beforehand.

    Attributes:
        run: computes; in the contestant's own layout.
        result: what ``run`` returned as named arrays with the samples in front; not timed.
        note: settings that a reader must know.
        few: samples that it computes, where all would take too long.
    """

    run: Callable[[], Any]
    result: Callable[[Any], Result] = _as_it_is
    note: str = ""
    few: int | None = None


Contestants = Mapping[str, Contestant]
