"""Denavit-Hartenberg tables as CSV files, with the units in the header.

    convention,limb,joint,type,alpha_deg,a_mm,d_mm,offset_deg
    modified,left_leg,base,fixed,0,0,0,90
    modified,left_leg,left_hip,revolute,90,19,0,0
    modified,left_leg,left_foot,fixed,90,31,0,90

Angles are ``alpha_deg`` and ``offset_deg``, or ``_rad``; lengths ``a_mm`` and ``d_mm``, or ``_m``. ``limb``
may be left out of a file of one chain, ``type`` (revolute, prismatic, fixed) where all joints are revolute.
Fixed rows before a chain's joints are its base, fixed rows behind them its tool, and those have the tip's
name. Blank lines and lines that begin with # are comments.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from screwkin.algebra.se3 import IDENTITY, Pose
from screwkin.errors import Fault, TableError, near
from screwkin.files import MOST_NAMES
from screwkin.model.dh import CONVENTIONS, Convention, DHRow, DHTable, DHType, row_transform
from screwkin.model.dh_derive import fixed_rows
from screwkin.model.expression import listed
from screwkin.model.toml import read_text

UNITS: Mapping[str, tuple[str, ...]] = {
    "alpha": ("deg", "rad"),
    "a": ("mm", "m"),
    "d": ("mm", "m"),
    "offset": ("deg", "rad"),
}
"""Parameters, and the units in which a column may give them: ``alpha_deg``."""

TYPES = ("revolute", "prismatic", "fixed")
"""Kinds of rows."""

_WORDS = ("convention", "limb", "joint", "type")
_COLUMNS = (*_WORDS, *(f"{name}_{unit}" for name, units in UNITS.items() for unit in units))
_ONLY = "chain"  # name of a chain that has none


def load_dh(path: str | Path) -> tuple[DHTable, ...]:
    """The chains of a file, in its order.

    Args:
        path: of a CSV file as the module's head describes.

    Raises:
        TableError: the file cannot be read or has faults; it lists all of them.
    """
    return parse_dh(read_text(Path(path), TableError), str(path))


def parse_dh(text: str, path: str = "<text>") -> tuple[DHTable, ...]:
    """The chains of a text.

    Args:
        text: CSV as the module's head describes.
        path: where it comes from, for messages.

    Raises:
        TableError: the text has faults; it lists all of them.
    """
    try:
        lines = _lines(text)
    except csv.Error as wrong:
        raise TableError(path, [Fault("file", "", f"is no CSV ({wrong})", "Save it as plain CSV")]) from None
    if not lines:
        fix = "Begin with a header: convention,joint,alpha_deg,a_mm,d_mm,offset_deg"
        raise TableError(path, [Fault("file", "", "is empty", fix)])
    (number, header), *body = lines
    if (longest := max(len(body), len(header))) > MOST_NAMES:
        found = f"holds {longest:,} rows or columns, at most {MOST_NAMES} are read"
        raise TableError(path, [Fault("file", "", found, "Give the table of one robot")])
    faults = list(_header_faults(f"line {number}", header))
    if faults:
        raise TableError(path, faults)
    if not body:
        raise TableError(path, [Fault("file", "", "has a header but no rows", "Write a row for each joint")])
    rows = [_row(number, header, cells, faults) for number, cells in body]
    chains: dict[str, list[_Row]] = {}
    for row in rows:
        chains.setdefault(row.words.get("limb") or _ONLY, []).append(row)
    for name, chain in chains.items():
        faults += _chain_faults(name, chain)
    if faults:
        raise TableError(path, faults)
    return tuple(_table(name, chain) for name, chain in chains.items())


def dh_text(tables: Sequence[DHTable]) -> str:
    """Chains as the text of a file, in rad and m, with every digit that distinguishes a float."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*_WORDS, "alpha_rad", "a_m", "d_m", "offset_rad"])
    for table in tables:
        rows = [(row, "fixed") for row in fixed_rows(table.base, "base", table.convention)]
        rows += [(row, row.type) for row in table.rows]
        rows += [(row, "fixed") for row in fixed_rows(table.tool, table.tip, table.convention)]
        for row, kind in rows:
            numbers = (repr(float(x) + 0.0) for x in (row.alpha, row.a, row.d, row.offset))
            writer.writerow([table.convention, table.name, row.joint, kind, *numbers])
    return out.getvalue()


@dataclass
class _Row:
    """A line of the file: its words, and its numbers in rad and m."""

    where: str
    words: dict[str, str]
    numbers: dict[str, float] = field(default_factory=dict)

    @property
    def type(self) -> str:
        return self.words.get("type") or "revolute"

    @property
    def dh(self) -> DHRow:
        kind = cast(DHType, "revolute" if self.type == "fixed" else self.type)
        return DHRow(self.words["joint"], **self.numbers, type=kind)


def _lines(text: str) -> list[tuple[int, list[str]]]:
    """Number and cells of every line that is no comment."""
    lines = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            lines.append((number, [cell.strip() for cell in next(csv.reader([line]))]))
    return lines


def _header_faults(where: str, header: Sequence[str]) -> Iterator[Fault]:
    for column in dict.fromkeys(header):
        if header.count(column) > 1:
            yield Fault(where, column, "is there twice", "Keep one column of that name")
        if column in UNITS:
            fix = f"Name the unit: {' or '.join(f'{column}_{unit}' for unit in UNITS[column])}"
            yield Fault(where, column, "has no unit", fix)
        elif column not in _COLUMNS:
            yield Fault(where, column, "is unknown", f"{near(column, _COLUMNS)}Columns: {listed(_COLUMNS)}")
    for word in ("convention", "joint"):
        if word not in header:
            yield Fault(where, word, "is missing", f"Write a column {word}")
    for name, units in UNITS.items():
        given = [f"{name}_{unit}" for unit in units if f"{name}_{unit}" in header]
        if len(given) > 1:
            yield Fault(where, name, f"is given by {' and '.join(given)}", "Keep one of the columns")
        elif not given and name not in header:
            fix = f"Write a column {' or '.join(f'{name}_{unit}' for unit in units)}"
            yield Fault(where, name, "is missing", fix)


def _row(number: int, header: Sequence[str], cells: Sequence[str], faults: list[Fault]) -> _Row:
    """The row of a line; its faults are added."""
    where = f"line {number}"
    if len(cells) != len(header):
        found = f"{len(cells)} cells under {len(header)} columns"
        faults.append(Fault(where, "", found, "Write one cell for each column"))
    given = dict(zip(header, cells, strict=False))
    row = _Row(where, {word: given[word] for word in _WORDS if word in given})
    if row.words.get("joint"):
        row.where = f"{where} {row.words['joint']!r}"
    else:
        faults.append(Fault(where, "joint", "is empty", "Write the joint's name"))
    faults += _word_faults(row)
    for column, cell in given.items():
        name, _, unit = column.partition("_")
        if name not in UNITS:
            continue
        value, fault = _number(cell, name, unit)
        row.numbers[name] = value
        if fault:
            faults.append(Fault(row.where, column, *fault))
    return row


def _word_faults(row: _Row) -> Iterator[Fault]:
    for word, valid in (("convention", CONVENTIONS), ("type", TYPES)):
        given = row.words.get(word, "")
        if given not in valid and (given or word == "convention"):
            no_helical = "DH parameters have no helical joints. " if given == "helical" else ""
            fix = f"{near(given, valid)}{no_helical}Write {' or '.join(valid)}"
            yield Fault(row.where, word, f"is {given!r}" if given else "is empty", fix)


def _number(cell: str, name: str, unit: str) -> tuple[float, tuple[str, str] | None]:
    """The value of a cell in rad or m, and what is wrong with it."""
    try:
        value = float(cell)
    except ValueError:
        return 0.0, (f"{cell!r} is not a number", f"Write a number in {unit}")
    if not math.isfinite(value):
        return 0.0, (f"{cell} is not finite", f"Write a finite number in {unit}")
    if unit == "rad" and abs(value) > 2 * math.pi:
        fix = f"If the column holds degrees, call it {name}_deg; else keep angles within a full turn"
        return 0.0, (f"{cell} rad is more than a full turn, as degrees would be", fix)
    if unit == "deg":
        return math.radians(value), None
    return value / 1000 if unit == "mm" else value, None  # divided, so that 52 mm is the float 0.052


def _chain_faults(name: str, chain: Sequence[_Row]) -> Iterator[Fault]:
    """Faults between the rows of a chain."""
    moving = [i for i, row in enumerate(chain) if row.type != "fixed"]
    if not moving:
        yield Fault(chain[0].where, "type", f"chain {name!r} has no joint", "Write a row for each joint")
        return
    seen: dict[str, str] = {}
    for i, row in enumerate(chain):
        if row.words.get("convention") != chain[0].words.get("convention"):
            found = f"differs from {chain[0].where} of the same chain"
            yield Fault(row.where, "convention", found, "Give a chain one convention")
        joint = row.words.get("joint", "")
        if row.type != "fixed" and joint:
            if joint in seen:
                fix = "Give each joint of a chain a name of its own"
                yield Fault(row.where, "joint", f"stands at {seen[joint]} already", fix)
            seen.setdefault(joint, row.where)
        elif moving[0] < i < moving[-1]:
            fix = "Merge it into the rows beside it; fixed rows stand before or behind the joints"
            yield Fault(row.where, "type", "is fixed, between joints", fix)


def _table(name: str, chain: Sequence[_Row]) -> DHTable:
    convention = cast(Convention, chain[0].words["convention"])
    moving = [i for i, row in enumerate(chain) if row.type != "fixed"]
    behind = chain[moving[-1] + 1 :]
    return DHTable(
        convention,
        tuple(chain[i].dh for i in moving),
        _product(chain[: moving[0]], convention),
        _product(behind, convention),
        name,
        behind[-1].words["joint"] if behind else f"{name}_tip",
    )


def _product(rows: Sequence[_Row], convention: Convention) -> Pose:
    """The constant transform of fixed rows."""
    pose = IDENTITY
    for row in rows:
        pose = pose @ row_transform(row.dh, 0, convention)
    return pose
