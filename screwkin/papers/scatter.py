"""Runs that differ by rounding alone, and what their results have in common.

Contact is chaotic: where feet are put down hard, an offset of a joint position in its last digits moves the
largest contact error by a factor. So a simulated number is the median of runs, with least and greatest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwkin.trajectory import Trajectory

ROUNDING = 1e-12
"""Largest offset of a joint position [rad or m] between two runs."""
FEW = 3
"""Runs by which it is decided whether a simulation scatters."""
ALIKE = 0.01
"""Share of the greatest by which numbers of runs that do not scatter differ at most."""


@dataclass(frozen=True)
class Scatter:
    """The same number, or the same answer as text, of every run."""

    values: tuple[float | str, ...]

    @property
    def numbers(self) -> tuple[float, ...]:
        """The values if all are numbers, else none."""
        found = tuple(value for value in self.values if not isinstance(value, str))
        return found if len(found) == len(self.values) else ()

    @property
    def middle(self) -> float | str:
        """The median; of texts the one that all runs have in common, or how many runs have which."""
        if self.numbers:
            return float(np.median(self.numbers))
        texts = [value if isinstance(value, str) else "falls" for value in self.values]
        counts = {text: texts.count(text) for text in sorted(texts)}
        if len(counts) == 1:
            return texts[0]
        return ", ".join(f"{text} ({count} of {len(texts)} runs)" for text, count in counts.items())

    @property
    def span(self) -> tuple[float, float] | None:
        """The least and the greatest number."""
        return (min(self.numbers), max(self.numbers)) if self.numbers else None


def shaken(trajectory: Trajectory, run: int) -> Trajectory:
    """The trajectory as a run plays it: run 0 as it is, others with joint positions off by ``ROUNDING``.

    The offsets of a run are the same in every process.
    """
    if not run:
        return trajectory
    offsets = np.random.default_rng(run).uniform(-ROUNDING, ROUNDING, trajectory.q.shape)
    return replace(trajectory, q=trajectory.q + offsets)


def scattered(rows: Sequence[Sequence[float | None]]) -> bool:
    """Whether numbers (runs, k) differ from run to run by more than ``ALIKE``; a missing one differs."""
    for column in zip(*rows, strict=True):
        known = [value for value in column if value is not None]
        if len(known) not in (0, len(column)):
            return True
        if known and not np.ptp(known) <= ALIKE * np.abs(known).max():
            return True
    return False
