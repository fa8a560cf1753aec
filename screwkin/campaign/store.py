"""The folder of a campaign: its plan, and one line a finished row, which no death of a process undoes.

``campaign.json`` is the plan. ``rows.jsonl`` grows by one line a row, in the order in which rows end; a line
counts once it is complete. A row that stands twice counts as it stands first.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Self

from screwkin.campaign.outcome import Outcome, outcome_from_dict
from screwkin.campaign.plan import differing_keys
from screwkin.errors import InputError, OutputError
from screwkin.files import atomic_write, read_file, read_json

PLAN, ROWS = "campaign.json", "rows.jsonl"


class Journal:
    """The open file of finished rows: ``outcomes`` are in it, ``append`` adds one and waits for the disk."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        complete = file.read()
        end = complete.rfind(b"\n") + 1
        file.truncate(end)  # the rest of a line that a death of the process tore
        file.seek(end)
        self._file = file
        self.outcomes = dict(_outcomes(complete[:end].decode(), path))

    def append(self, outcome: Outcome) -> None:
        """Add a row that ended; one that stands here already changes nothing."""
        if outcome.row in self.outcomes:
            return
        line = json.dumps(outcome.to_dict(), allow_nan=False) + "\n"
        self._file.write(line.encode())
        self._file.flush()
        os.fsync(self._file.fileno())
        self.outcomes[outcome.row] = outcome

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()


@contextmanager
def journal(folder: Path, plan: Mapping[str, Any]) -> Iterator[Journal]:
    """The journal of a campaign in a folder, begun or resumed; one process at a time.

    Args:
        folder: where it stands.
        plan: all that decides what its rows say, as JSON data.

    Raises:
        InputError: the folder holds another campaign, or a damaged one.
        OutputError: it cannot be written, or another process writes to it.
    """
    _check_plan(folder / PLAN, plan)
    path = folder / ROWS
    try:
        file = path.open("r+b" if path.exists() else "w+b")
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
    with file:
        _lock(file, folder)
        yield Journal(file, path)


def _check_plan(path: Path, plan: Mapping[str, Any]) -> None:
    """Write the plan, or compare it with the one that stands there."""
    if not path.exists():
        with atomic_write(path) as file:
            file.write(json.dumps(dict(plan), indent=2) + "\n")
        return
    there = read_json(read_file(path).decode(errors="replace"))
    differing = differing_keys(plan, there) if isinstance(there, dict) else ["all"]
    if differing:
        raise InputError(
            f"{path} is of another campaign: {', '.join(differing)} differ; repeat the command that "
            "began it, or name another folder"
        )


def _outcomes(text: str, path: Path) -> Iterator[tuple[int, Outcome]]:
    seen = set()
    for number, line in enumerate(text.splitlines(), 1):
        try:
            outcome = outcome_from_dict(json.loads(line))
        except (TypeError, ValueError):
            raise InputError(
                f"{path} line {number} is no row: {line[:60]!r}; remove the line, and its row is played again"
            ) from None
        if outcome.row not in seen:
            seen.add(outcome.row)
            yield outcome.row, outcome


def _lock(file: BinaryIO, folder: Path) -> None:
    """Keep other processes from the file until it is closed, where the system can."""
    try:
        import fcntl
    except ImportError:  # not on Windows; there a row that two processes play counts once
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise OutputError(f"another process writes to the campaign in {folder}; wait for its end") from None
