"""How much the command line says, in which colours and in how many columns."""

from __future__ import annotations

import os
import re
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import TextIO

GAP = 2
"""Blanks between columns of a table."""
_TIE = "\N{NO-BREAK SPACE}"
NARROWEST = 30
"""Columns that a terminal is taken to have at least."""


@dataclass(frozen=True)
class Manners:
    """What was asked for: quiet leaves results, remarks and bars to files and exit codes."""

    quiet: bool = False
    color: bool = True


_PLAIN = Manners()
_ASKED: ContextVar[Manners] = ContextVar("manners", default=_PLAIN)

OPTIONS = {"--quiet": {"quiet": True}, "--no-color": {"color": False}}
"""Words that may stand anywhere in a command line, and what they ask for."""


def manners() -> Manners:
    """What the command line at hand was asked for."""
    return _ASKED.get()


@contextmanager
def with_manners(words: Sequence[str]) -> Iterator[list[str]]:
    """The words that are no manners; those that are hold inside."""
    asked = Manners()
    for word in words:
        asked = replace(asked, **OPTIONS.get(word, {}))
    token = _ASKED.set(asked)
    try:
        yield [word for word in words if word not in OPTIONS]
    finally:
        _ASKED.reset(token)


def columns_of(stream: TextIO) -> int | None:
    """Columns of a terminal, or as many as the variable COLUMNS says; None for files and pipes."""
    if stream.isatty() or os.environ.get("COLUMNS", "").isdecimal():
        return max(NARROWEST, shutil.get_terminal_size().columns)
    return None


def folded(text: str, stream: TextIO) -> str:
    """The text, its lines folded at blanks where the terminal is too narrow, further in than they begin."""
    width = columns_of(stream)
    return text if width is None else "\n".join(_folded(line, width) for line in text.split("\n"))


def _folded(line: str, width: int) -> str:
    if len(line) <= width or set(line) in ({"-"}, {"="}):  # a rule under a title is as long as fits
        return line[:width]
    indent = line[: len(line) - len(line.lstrip())]
    lines = _lines(_tied(line.lstrip()), width - len(indent) - 2, indent, indent + "  ")
    return "\n".join(lines).replace(_TIE, " ")


def _lines(text: str, width: int, first: str = "", then: str = "") -> list[str]:
    """Lines of at most so many characters beyond their indents, but for longer words."""
    wrap = textwrap.TextWrapper(
        width=width + len(then),
        initial_indent=first,
        subsequent_indent=then,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return wrap.wrap(text) or [""]


def table_lines(cells: Sequence[Sequence[str]], width: int | None) -> list[str]:
    """Rows of cells as lines, every column as wide as its widest cell.

    In fewer columns than that takes, cells are folded at blanks, but for vectors; where words are too wide
    for that, the columns stand in groups, the first one in each of them.

    Args:
        cells: rows, which may be of different lengths.
        width: characters of a line; None: as many as it takes.
    """
    cells = [[_tied(cell) for cell in row] for row in cells]
    columns = [[row[k] for row in cells if k < len(row)] for k in range(max(map(len, cells), default=0))]
    natural = [max(map(len, column)) for column in columns]
    least = [max(len(word) for cell in column for word in cell.split(" ")) for column in columns]
    groups = [[*range(len(columns))]]
    if width is not None and _total(natural) > width:
        groups = _groups(least, width)
    lines: list[str] = []
    for group in groups:
        widths = [natural[k] for k in group] if width is None else _narrowed(natural, least, group, width)
        lines += _set([[row[k] for k in group if k < len(row)] for row in cells], widths)
    return [line.replace(_TIE, " ") for line in lines]


_TIED = re.compile(r"\([-+\d.,e ]+\)|\S*python\S* -m pip install \S+")


def _tied(text: str) -> str:
    """A text whose vectors and commands of installation are not folded."""
    return _TIED.sub(lambda one: one[0].replace(" ", _TIE), text)


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + GAP * (len(widths) - 1)


def _groups(least: Sequence[int], width: int) -> list[list[int]]:
    """Columns that fit beside the first one, group by group."""
    groups = [[0]]
    for k in range(1, len(least)):
        if len(groups[-1]) > 1 and _total([least[j] for j in (*groups[-1], k)]) > width:
            groups.append([0])
        groups[-1].append(k)
    return groups


def _narrowed(natural: Sequence[int], least: Sequence[int], group: Sequence[int], width: int) -> list[int]:
    """Widths of the columns of a group: the widest gives way first, none below its longest word."""
    widths = [natural[k] for k in group]
    while _total(widths) > width:
        wide = [i for i, k in enumerate(group) if widths[i] > least[k]]
        if not wide:
            break
        widths[max(wide, key=widths.__getitem__)] -= 1
    return widths


def _set(cells: Sequence[Sequence[str]], widths: Sequence[int]) -> list[str]:
    """Rows as lines; a cell that is wider than its column goes on in the next line."""
    lines = []
    for row in cells:
        pairs = zip(row, widths, strict=False)
        parts = [[cell] if len(cell) <= width else _lines(cell, width) for cell, width in pairs]
        for line in zip_longest(*parts, fillvalue="") if parts else [()]:
            joined = (" " * GAP).join(cell.ljust(width) for cell, width in zip(line, widths, strict=False))
            lines.append(joined.rstrip())
    return lines
