"""TOML files read with faults that say where: robot tables, gaits, whatever else is TOML."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from screwkin.errors import Fault, FileFaults


def read_text(path: Path, error: type[FileFaults]) -> str:
    """The text of a file in UTF-8.

    Raises:
        FileFaults: of the class ``error``: a folder, unreadable, or not UTF-8 (the fault names the line).
    """
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        line = wrong.object[: wrong.start].count(b"\n") + 1
        found = f"byte {wrong.object[wrong.start]:#04x} is not UTF-8"
        raise error(str(path), [Fault(f"line {line}", "", found, "Save the file as UTF-8")]) from None
    except IsADirectoryError:
        raise error(str(path), [Fault("file", "", "is a folder", "Give the path of a .toml file")]) from None
    except OSError as wrong:
        found = f"cannot be read ({wrong.strerror})"
        raise error(str(path), [Fault("file", "", found, "Give a readable file")]) from None


def read_toml(text: str, path: str, error: type[FileFaults]) -> dict[str, Any]:
    """A TOML text as nested dictionaries.

    Raises:
        FileFaults: of the class ``error``: the text is not TOML; the fault names the line.
    """
    fix = "Mend the TOML there: quote texts, close brackets and quotes, write each key once"
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as wrong:  # ValueError also for integers of thousands of digits
        found, _, place = str(wrong).partition(" (at ")
        raise error(path, [Fault(place.rstrip(")") or "file", "", found, fix)]) from None
