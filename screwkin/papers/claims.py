"""What a paper says, as data: tables and figures, its numbers, and the measures that answer them.

A file in ``papers/`` holds ``[paper]`` (name, title, source, robot, and ``changes`` to its gaits, if any) and
``[[section]]`` (place, title, text) with rows and pictures. A row has ``item``, ``measure``, and as far as
there are any ``with`` (the measure's arguments), ``paper`` (the printed value), ``note``, ``unit``, ``form``
(how ours is written) and ``within`` (how far apart equal values may be).
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from screwkin.errors import Fault, FileFaults, InputError
from screwkin.model.library import find_paper

Value = float | int | str | Sequence[float] | None

UNITS: Mapping[str, float] = {
    "m": 1.0,
    "mm": 1e3,
    "cm²": 1e4,
    "kg": 1.0,
    "rad": 1.0,
    "deg": 57.29577951308232,
    "s": 1.0,
    "ms": 1e3,
    "%": 100.0,
    "N m/rad": 1.0,
}
"""How many of a unit make one of the SI."""


@dataclass(frozen=True)
class Claim:
    """One line: what the paper prints, and the measure that returns our value."""

    item: str
    measure: str
    with_: Mapping[str, Any] = field(default_factory=dict)
    paper: Value = None
    note: str = ""
    unit: str = ""
    form: str = ""
    within: float = 1e-6


@dataclass(frozen=True)
class Picture:
    """A figure to be drawn again: name of the drawing, its arguments, and what it shows."""

    draw: str
    caption: str
    with_: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Section:
    """A table, figure or claim of the paper."""

    place: str
    title: str
    text: str = ""
    rows: tuple[Claim, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Paper:
    """A paper, as far as it can be measured; its walks are those of gait files with some ``changes``."""

    name: str
    title: str
    source: str
    robot: str
    sections: tuple[Section, ...]
    text: str = ""
    changes: Mapping[str, str | float] = field(default_factory=dict)


def load_paper(name_or_path: str | Path) -> Paper:
    """A bundled paper by its name, or any by its path.

    Raises:
        UnknownNameError: there is none; it lists the names.
        FileFaults: faults of the file, all at once.
    """
    path = find_paper(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read {path}: {error}") from None
    return parse_paper(text, str(path))


def parse_paper(text: str, path: str = "<text>") -> Paper:
    """The paper that a text describes; see ``load_paper``."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: no valid TOML: {error}") from None
    faults: list[Fault] = []
    head = _checked(Paper, data.get("paper"), "[paper]", faults, ("sections",))
    if not isinstance(head.get("changes", {}), dict):
        faults.append(Fault("[paper]", "changes", "no table", "Write { parameter = value } of the gaits"))
    sections = []
    for number, table in enumerate(_tables(data, "section", faults), 1):
        where = f"section {number}"
        values = _checked(Section, table, where, faults, ("rows", "pictures"), ("row", "picture"))
        rows = [
            _row(row, f"{where}, row {k}", faults) for k, row in enumerate(_tables(table, "row", faults), 1)
        ]
        drawn = [
            _checked(Picture, picture, f"{where}, picture {k}", faults)
            for k, picture in enumerate(_tables(table, "picture", faults), 1)
        ]
        if not faults:
            pictures = tuple(Picture(**picture) for picture in drawn)
            sections.append(Section(**values, rows=tuple(Claim(**row) for row in rows), pictures=pictures))
    faults += [Fault("", key, "unknown key", "Remove it") for key in data if key not in ("paper", "section")]
    if faults:
        raise FileFaults(path, faults)
    return Paper(**head, sections=tuple(sections))


def _row(table: Any, where: str, faults: list[Fault]) -> dict[str, Any]:
    values = _checked(Claim, table, where, faults)
    unit = values.get("unit", "")
    if unit and unit not in UNITS:
        faults.append(Fault(where, "unit", f"unknown unit {unit!r}", f"Write one of {', '.join(UNITS)}"))
    return values


def _tables(data: Any, key: str, faults: list[Fault]) -> list[Any]:
    tables = data.get(key, []) if isinstance(data, dict) else []
    if not isinstance(tables, list):
        faults.append(Fault("", key, "no list of tables", f"Write [[{key}]]"))
        return []
    return tables


def _checked(
    kind: type,
    table: Any,
    where: str,
    faults: list[Fault],
    nested: Sequence[str] = (),
    besides: Sequence[str] = (),
) -> dict[str, Any]:
    """The keys of a table as arguments of a record; missing and unknown ones become faults."""
    if not isinstance(table, dict):
        faults.append(Fault(where, "", "no table", "Write its keys"))
        return {}
    known = {f.name.rstrip("_"): f for f in fields(kind) if f.name not in nested}
    values = {}
    for key, value in table.items():
        if key in known:
            values[known[key].name] = value
        elif key not in besides:
            faults.append(Fault(where, key, "unknown key", f"Valid: {', '.join([*known, *besides])}"))
    needed = [name for name, f in known.items() if f.default is f.default_factory]
    faults += [Fault(where, name, "missing", "Give it") for name in needed if name not in table]
    return values
