"""Timing that alternates between contestants, so that a drifting processor clock favours none of them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

Run = Callable[[], object]
SHORTEST = 2e-2
"""A timed batch of calls lasts so long [s] or more: a contestant at work, not what others left in caches."""


@dataclass(frozen=True)
class Elapsed:
    """What a run in another process says of itself: wall and processor time [s]."""

    wall: float
    cpu: float


@dataclass(frozen=True)
class Timing:
    """Seconds per call in every round: wall time, and processor time of all threads.

    On a computer that others use too, processor time is the truer of the two for one thread.
    """

    wall: tuple[float, ...]
    cpu_rounds: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.wall)

    @property
    def best(self) -> float:
        return min(self.wall)

    @property
    def cpu(self) -> float:
        return statistics.median(self.cpu_rounds)


def interleaved(runs: Mapping[str, Run], rounds: int, budget: float = 60.0) -> dict[str, Timing]:
    """Time every contestant once per round, in turn and each round in the reverse order of the last.

    A call too short for the clock is repeated within its turn. Rounds end early when ``budget`` [s] is spent.
    Every contestant must have run before, so that its compilers and caches are warm.
    """
    repeats = {name: _repeats(run) for name, run in runs.items()}
    wall: dict[str, list[float]] = {name: [] for name in runs}
    cpu: dict[str, list[float]] = {name: [] for name in runs}
    order, begin = list(runs), time.perf_counter()
    for done in range(rounds):
        if done and time.perf_counter() - begin > budget:
            break
        for name in order:
            run, times = runs[name], repeats[name]
            spent = _measured(run, times)
            wall[name].append(spent.wall)
            cpu[name].append(spent.cpu)
        order.reverse()
    return {name: Timing(tuple(wall[name]), tuple(cpu[name])) for name in runs}


def _measured(run: Run, times: int) -> Elapsed:
    """Time per call of several calls in a row."""
    cpu_before, before = time.process_time(), time.perf_counter()
    told = []
    for _ in range(times):
        value = run()
        if isinstance(value, Elapsed):
            told.append(value)
        del value  # at once, so that its memory serves again
    wall, cpu = time.perf_counter() - before, time.process_time() - cpu_before
    if told:
        wall, cpu = sum(value.wall for value in told), sum(value.cpu for value in told)
    return Elapsed(wall / times, cpu / times)


def _repeats(run: Run) -> int:
    """Calls that last ``SHORTEST`` together."""
    times = 1
    while _measured(run, times).wall * times < SHORTEST:
        times *= 2
    return times
