"""TOML files read with faults that say where: robot tables, gaits, whatever else is TOML."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from screwkin.errors import Fault, FileFaults, InputError
from screwkin.files import LARGEST_TEXT, MOST_NAMES, read_file

LARGEST_TABLE = 2**19
"""Characters of a TOML file; the largest bundled one has 13,000."""
_DEEPEST_KEY = 30
"""Names in a dotted one: the time that they take grows with the square of their number."""
_BETWEEN_SIGNS = re.compile(r"[^\n,=\[\]{}]++")


def read_text(path: Path, error: type[FileFaults]) -> str:
    """The text of a file in UTF-8.

    Raises:
        FileFaults: of the class ``error``: a folder, unreadable, larger than ``LARGEST_TEXT``, or not UTF-8
            (the fault names the line).
    """
    try:
        return read_file(path, LARGEST_TEXT).decode("utf-8-sig")
    except InputError as wrong:
        fix = "Give the file of a robot or a gait; leave out what is no part of it"
        raise error(str(path), [Fault("file", "", f"holds {wrong}", fix)]) from None
    except UnicodeDecodeError as wrong:
        line = wrong.object[: wrong.start].count(b"\n") + 1
        found = f"byte {wrong.object[wrong.start]:#04x} is not UTF-8"
        raise error(str(path), [Fault(f"line {line}", "", found, "Save the file as UTF-8")]) from None
    except IsADirectoryError:
        raise error(str(path), [Fault("file", "", "is a folder", "Give the path of a file")]) from None
    except OSError as wrong:
        found = f"cannot be read ({wrong.strerror})"
        raise error(str(path), [Fault("file", "", found, "Give a readable file")]) from None


def read_toml(text: str, path: str, error: type[FileFaults]) -> dict[str, Any]:
    """A TOML text as nested dictionaries.

    Raises:
        FileFaults: of the class ``error``: the text is not TOML, or larger than a table; the fault names the
            line.
    """
    fix = "Mend the TOML there: quote texts, close brackets and quotes, write each key once"
    if len(text) > LARGEST_TABLE:
        found = f"holds {len(text):,} characters, at most {LARGEST_TABLE:,} are read"
        raise error(path, [Fault("file", "", found, "Leave out what is no part of the table")])
    for part in _BETWEEN_SIGNS.finditer(text):
        if part[0].count(".") > _DEEPEST_KEY:
            row, points = f"line {text.count(chr(10), 0, part.start()) + 1}", part[0].count(".")
            raise error(path, [Fault(row, "", f"holds {points:,} points in a row", "Shorten the key")])
    try:
        data = tomllib.loads(text)
        crowded = list(_crowded({"": data}, ""))
    except (ValueError, RecursionError) as wrong:  # ValueError also for integers of thousands of digits
        found, _, place = str(wrong).partition(" (at ")
        raise error(path, [Fault(place.rstrip(")") or "file", "", found, fix)]) from None
    if crowded:
        raise error(path, crowded)
    return data


def _crowded(data: dict[str, Any], where: str) -> Iterator[Fault]:
    """Tables with more rows or keys than a file may have."""
    for key, value in data.items():
        place = f"{where}.{key}".strip(".")
        tables = [value] if isinstance(value, dict) else value if isinstance(value, list) else []
        tables = [one for one in tables if isinstance(one, dict)]
        largest = max([len(tables), *map(len, tables)], default=0)
        if largest > MOST_NAMES:
            found = f"holds {largest:,} rows or keys, at most {MOST_NAMES} are read"
            yield Fault(
                f"[{place}]" if place else "file",
                "",
                found,
                "Split the file, or leave out what is no part of it",
            )
        for table in tables[: MOST_NAMES + 1]:
            yield from _crowded(table, place)
