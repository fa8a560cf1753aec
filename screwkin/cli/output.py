"""What verbs print: one JSON object, or text; progress and remarks go to stderr."""

from __future__ import annotations

import json
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from screwkin.cli.terminal import columns_of, folded, manners, table_lines
from screwkin.errors import MissingDependencyError, OutputError, RobotRemark, SpeedRemark

T = TypeVar("T")

LONGEST = 300
"""Characters of a remark beyond which its names are counted."""


def print_json(data: Mapping[str, Any]) -> None:
    """One JSON object on stdout; numbers that JSON does not know (NaN, infinity) become null."""
    _print(json.dumps(plain(data), indent=2, allow_nan=False))


def _print(text: str) -> None:
    """A text on stdout, at once.

    Raises:
        BrokenPipeError: its reader has gone. OutputError: it cannot be written, as on a full disk.
    """
    try:
        print(text, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        drop_output()
        raise OutputError(f"cannot write standard output: {error.strerror}") from None


def drop_output() -> None:
    """Write to nowhere from now on, where stdout has failed: it is flushed once more at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def plain(value: Any) -> Any:
    """The value as JSON data: NumPy's numbers and arrays, tuples and mappings turned into JSON's own."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


def remark(text: str) -> None:
    """A line for the reader that is no result, on stderr; nothing if --quiet."""
    if not manners().quiet:
        print(folded(text, sys.stderr), file=sys.stderr, flush=True)


@contextmanager
def remarks_of_robots() -> Iterator[None]:
    """What robots' files leave open, read inside, is a remark, once, not a warning with a line of code.

    So is what makes screwkin slower on this computer.
    """
    with warnings.catch_warnings():
        shown, said, kinds = warnings.showwarning, set[str](), (RobotRemark, SpeedRemark)

        def show(message: Warning | str, category: type[Warning], *place: Any, **rest: Any) -> None:
            if issubclass(category, kinds):
                if str(message) not in said:
                    remark(shortened(f"remark: {message}"))
                said.add(str(message))
            else:
                shown(message, category, *place, **rest)

        for kind in kinds:
            warnings.simplefilter("always", kind)
        warnings.showwarning = show
        yield


def shortened(text: str) -> str:
    """A remark whose list of names is cut where it becomes longer than a paragraph."""
    head, more = text[:LONGEST].rpartition(", ")[0], text[LONGEST:].count(", ")
    return f"{head} and {more + 1} more" if more else text


def drawn(draw: Callable[[], Sequence[T]]) -> Sequence[T]:
    """Pictures, which stand beside results: without the library that draws them a remark, and none."""
    try:
        return draw()
    except MissingDependencyError as error:
        remark(f"no pictures: {error}")
        return ()


def silent(text: str) -> None:
    """Nothing: for those who asked for JSON alone."""


def say(text: str, folds: bool = True) -> None:
    """A result for the reader, on stdout; nothing if --quiet.

    Args:
        text: lines of it.
        folds: whether it is folded where the terminal is narrower; not what goes into another document.
    """
    if not manners().quiet:
        _print(folded(text, sys.stdout) if folds else text)


def aligned(rows: Sequence[Sequence[Any]], indent: str = "") -> str:
    """Rows of cells as lines, every column as wide as its widest cell, or as the terminal allows."""
    width = columns_of(sys.stdout)
    cells = [[str(cell) for cell in row] for row in rows]
    lines = table_lines(cells, None if width is None else width - len(indent))
    return "\n".join((indent + line).rstrip() for line in lines)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A bar, percent and remaining time on stderr while it is a terminal that can draw it, and not --quiet.

    ``TERM=dumb`` and ``TTY_INTERACTIVE=0`` say that it cannot. Yields a function that takes the share done.
    """
    still = os.environ.get("TERM") in ("dumb", "unknown") or os.environ.get("TTY_INTERACTIVE") == "0"
    if manners().quiet or still or not sys.stderr.isatty():
        yield lambda share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(
        *columns, console=Console(stderr=True, no_color=not manners().color or None), transient=True
    ) as shown:
        task = shown.add_task(label.replace("[", r"\["), total=1.0)
        yield lambda share: shown.update(task, completed=share)
