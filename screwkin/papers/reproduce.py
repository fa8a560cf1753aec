"""A paper measured anew: its printed values beside ours, with the reasons where they differ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from screwkin.errors import MissingDependencyError
from screwkin.papers.bench import Bench
from screwkin.papers.claims import UNITS, Claim, Kind, Paper, Section, Value
from screwkin.papers.measures import MEASURES, check_call
from screwkin.papers.scatter import ALIKE, FEW, ROUNDING, Scatter

_KINDS: dict[Kind, str] = {
    "printed": "printed numbers",
    "damaged": "numbers that the scan has damaged",
    "reading": "values read from rules (docs/papers.md)",
    "words": "claims in words",
}

MARKS = {True: "same", False: "differs", None: ""}
"""How a row's agreement is written."""

Progress = Callable[[float], None]


@dataclass(frozen=True)
class ClaimResult:
    """One row of a reproduction.

    Attributes:
        item: table, figure or claim of the paper, with the unit.
        paper: the paper's value; None where it has none.
        ours: what was measured; None if a package for it is absent.
        note: where and why they differ, or how ours is meant.
        agrees: whether they are equal, within what the row allows; None if they cannot be compared.
        form: how ours is written.
        span: least and greatest of runs that differ by rounding, of which ours is the median.
        runs: how many; None if nothing was simulated.
        quote: what of the paper's text the value stands in; empty without a value.
        line: where in its text.
        kind: what the paper's value is; see ``claims.Kind``.
    """

    item: str
    paper: Value
    ours: Value
    note: str
    agrees: bool | None
    form: str = ""
    span: tuple[float, float] | None = None
    runs: int | None = None
    quote: str = ""
    line: int = 0
    kind: Kind = "printed"

    @property
    def source(self) -> str:
        """The quotation for a page, with its line and, where it is no printed number, its kind."""
        if not self.quote:
            return ""
        return f"“{self.quote}” ({self.line}{'' if self.kind == 'printed' else f'; {self.kind}'})"

    @property
    def shown(self) -> str:
        """Ours for a page, with the range of its runs if the digits show it."""
        ours = written(self.ours, self.form) or "–"
        return f"{ours} ({' to '.join(self._ends)})" if len(set(self._ends)) > 1 else ours

    @property
    def remark(self) -> str:
        """The note, and how many runs there were."""
        if self.runs is None:
            return self.note
        below = ", range below the digits shown" if len(set(self._ends)) == 1 and self.runs > 1 else ""
        return f"{self.note} {self.runs} run{'s' * (self.runs > 1)}{below}.".lstrip()

    @property
    def _ends(self) -> list[str]:
        return [written(end, self.form) for end in self.span or ()]

    def to_dict(self) -> dict[str, Any]:
        """The row as JSON data."""
        return {key: value for key, value in asdict(self).items() if key != "form"}


@dataclass(frozen=True)
class MeasuredSection:
    """A section of a paper with its rows measured."""

    section: Section
    lines: tuple[ClaimResult, ...]

    @property
    def title(self) -> str:
        """Place and title of the section."""
        return f"{self.section.place}: {self.section.title}"

    @property
    def cells(self) -> list[tuple[str, str, str, str, str, str]]:
        """Item, paper, ours, mark, note and quotation of every line, without the section's place."""
        return [
            (
                line.item.removeprefix(f"{self.section.place}: "),
                written(line.paper) or "–",
                line.shown,
                MARKS[line.agrees],
                line.remark,
                line.source,
            )
            for line in self.lines
        ]


@dataclass(frozen=True)
class Reproduction:
    """A paper with all its rows measured."""

    paper: Paper
    sections: tuple[MeasuredSection, ...]

    @property
    def lines(self) -> tuple[ClaimResult, ...]:
        """All rows."""
        return tuple(line for measured in self.sections for line in measured.lines)

    @property
    def summary(self) -> str:
        """How many values of each kind agree, in a sentence."""
        parts = []
        for kind, what in _KINDS.items():
            lines = [line for line in self.lines if line.quote and line.kind == kind]
            agreed = sum(line.agrees is True for line in lines)
            parts += [f"{agreed} of {len(lines)} {what} come out"] if lines else []
        free = sum(not line.quote for line in self.lines)
        parts += [f"{free} are ours alone, where the paper has no value"] if free else []
        return f"{len(self.lines)} rows: {'; '.join(parts)}. Notes say why the others do not."

    @property
    def repetition(self) -> str:
        """How often was simulated, in a sentence; empty if nothing was."""
        runs = [line.runs for line in self.lines if line.runs is not None]
        if not runs:
            return ""
        return (
            f"Contact is chaotic, so what is simulated is repeated with joint positions off by up to "
            f"{ROUNDING:g} rad, as by rounding: {max(runs)} runs, but {FEW} where those agree to "
            f"{ALIKE:.0%}; the notes say how many. Numbers are medians, with (least to greatest)."
        )


def check_paper(paper: Paper) -> None:
    """Raise unless every row names a known measure and its arguments.

    Raises:
        UnknownNameError, InputError: the first row that does not.
    """
    for section in paper.sections:
        for row in section.rows:
            check_call("measure", row.measure, MEASURES, row.with_, _item(section, row))


def reproduce(paper: Paper, bench: Bench, progress: Progress = lambda share: None) -> Reproduction:
    """Measure every row of a paper.

    Args:
        paper: from ``load_paper``.
        bench: where robots, walks and studies are computed and cached.
        progress: called with the share of rows done.

    Raises:
        UnknownNameError, InputError: a row names no measure, or wrong arguments.
    """
    check_paper(paper)
    total, done, sections = max(1, sum(len(s.rows) for s in paper.sections)), 0, []
    for section in paper.sections:
        lines = []
        for row in section.rows:
            lines.append(_measured(section, row, bench))
            done += 1
            progress(done / total)
        sections.append(MeasuredSection(section, tuple(lines)))
    return Reproduction(paper, tuple(sections))


def _item(section: Section, row: Claim) -> str:
    unit = f" [{row.unit}]" if row.unit else ""
    return f"{section.place}: {row.item}{unit}"


def _measured(section: Section, row: Claim, bench: Bench) -> ClaimResult:
    quoted = ClaimResult(
        _item(section, row),
        row.paper,
        None,
        row.note,
        None,
        row.form,
        None,
        None,
        row.quote,
        row.line,
        row.kind,
    )
    try:
        value = MEASURES[row.measure](bench, **row.with_)
    except MissingDependencyError as error:
        return replace(quoted, note=f"not measured: {error}")
    factor, span, runs = UNITS.get(row.unit, 1.0), None, None
    if isinstance(value, Scatter):
        runs = len(value.values)
        span = value.span and (value.span[0] * factor, value.span[1] * factor)
        value = value.middle
    ours = _scaled(value, factor)
    return replace(quoted, ours=ours, agrees=agreement(row.paper, ours, row.within), span=span, runs=runs)


def _scaled(value: Value, factor: float) -> Value:
    """The value in a row's unit, as plain numbers."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, int) and factor == 1.0:
        return value
    scaled = np.asarray(value) * (factor if factor != 1.0 else 1)
    plain: Value = scaled.tolist()
    return plain


def agreement(paper: Value, ours: Value, within: float) -> bool | None:
    """Whether two values are equal up to ``within``, relative to the paper's and absolute below 1."""
    if paper is None or ours is None:
        return None
    if isinstance(paper, str) or isinstance(ours, str):
        return paper == ours if isinstance(paper, str) and isinstance(ours, str) else None
    a, b = np.atleast_1d(np.asarray(paper, dtype=float)), np.atleast_1d(np.asarray(ours, dtype=float))
    if a.shape != b.shape:
        return False
    return bool((np.abs(a - b) <= within * np.maximum(1.0, np.abs(a))).all())


def written(value: Value, form: str = "") -> str:
    """A value for a page; zero is 0 in any form."""
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, Sequence):
        parts = [written(one, form) for one in value]
        return parts[0] if len(parts) == 1 else f"({', '.join(parts)})"
    if value == 0 or (isinstance(value, int) and not form):
        return str(int(value))
    text = format(value, form or ".8g")
    if not float(text):
        text = text.lstrip("-")
    return text.replace("-", "−", 1) if text.startswith("-") else text
