"""The rows of a robot table as the file holds them: raw, and checked one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from screwkin.algebra.scalar import Scalar
from screwkin.errors import Fault, near
from screwkin.model.expression import listed
from screwkin.model.schema import ROWS, TABLES, FrameRow, RobotRow, Row, kind_of, label, read_row


@dataclass(frozen=True)
class TableEntry:
    """One row: where it stands, what the file says, and the row if it has no fault of its own."""

    where: str
    raw: Mapping[str, object]
    row: Any

    def text(self, key: str) -> str:
        """A name in the row, as the file has it; empty where there is none."""
        value = self.raw.get(key)
        return value if isinstance(value, str) else ""


@dataclass(frozen=True)
class Rows:
    """All rows of a table by their key; ``robot`` and ``waist`` stand once, ``waist`` or not at all."""

    robot: TableEntry
    waist: TableEntry | None
    entries: Mapping[str, tuple[TableEntry, ...]]
    servos: Mapping[str, Any]

    def __getitem__(self, table: str) -> tuple[TableEntry, ...]:
        return self.entries[table]

    def good(self, table: str) -> Iterator[tuple[str, Any]]:
        """Place and row, for the rows without faults."""
        return ((entry.where, entry.row) for entry in self.entries[table] if entry.row is not None)


def read_rows(
    data: Mapping[str, Any], names: Mapping[str, Scalar], numbers: Mapping[str, float]
) -> tuple[Rows, list[Fault]]:
    """All rows of a table, each checked by itself, and their faults.

    Args:
        data: the nested dictionaries of the file.
        names: values of the parameters: floats or symbols.
        numbers: their numeric values, for limits and postures.
    """
    faults = list(_top_faults(data))

    def entry(kind: type[Row], raw: object, where: str) -> TableEntry:
        row, wrong = read_row(kind, raw, where, names, numbers)
        faults.extend(wrong)
        return TableEntry(where, raw if isinstance(raw, dict) else {}, row)

    robot = entry(RobotRow, data.get("robot", {}), "[robot]")
    given = data.get("waist")
    waist = entry(FrameRow, given, "[waist]") if isinstance(given, dict) else None
    entries = {
        table: tuple(
            entry(kind_of(table, raw), raw, label(table, i, raw)) for i, raw in enumerate(_array(data, table))
        )
        for table in ROWS
    }
    servos = data.get("servos", {})
    return Rows(robot, waist, entries, servos if isinstance(servos, dict) else {}), faults


def parameters_of(data: Mapping[str, Any]) -> Mapping[str, object]:
    """The raw parameters of a file."""
    raw = data.get("parameters", {})
    return raw if isinstance(raw, dict) else {}


def _array(data: Mapping[str, Any], table: str) -> list[object]:
    rows = data.get(table, [])
    return rows if isinstance(rows, list) else []


def _top_faults(data: Mapping[str, Any]) -> Iterator[Fault]:
    for key, value in data.items():
        if key not in TABLES:
            yield Fault("file", key, "is unknown", f"{near(key, TABLES)}Keys: {listed(TABLES)}")
        elif key in ROWS and not isinstance(value, list):
            yield Fault(f"[{key}]", "", "stands once", f"Write [[{key}]]: there may be several")
        elif key not in ROWS and not isinstance(value, dict):
            yield Fault("file", key, f"found {value!r}", f"Write [{key}] and its keys below it")
    if "robot" not in data:
        yield Fault("file", "robot", "is missing", "Write [robot] with name, base_link and base")
    if not _array(data, "link"):
        yield Fault("file", "link", "is missing", "Write a [[link]] for every body")
