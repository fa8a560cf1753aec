"""What a paper says, as data: tables and figures, its numbers, and the measures that answer them.

A file in ``papers/`` holds ``[paper]`` (name, title, source, robot, and ``changes`` to its gaits, if any) and
``[[section]]`` (place, title, text) with rows and pictures. A row has ``item``, ``measure``, and as far as
there are any ``with`` (the measure's arguments), ``paper`` (the paper's value), ``note``, ``unit``, ``form``
(how ours is written) and ``within`` (how far apart equal values may be). A value of the paper comes with the
span of text that it stands in, ``quote``, the number of its ``line`` in the text, and its ``kind``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from screwkin.errors import Fault, FileFaults, near
from screwkin.model.library import find_paper
from screwkin.model.toml import read_text, read_toml

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
    "N m": 1.0,
    "N m/rad": 1.0,
}
"""How many of a unit make one of the SI."""


Kind = Literal["printed", "damaged", "reading", "words"]
"""What the value of a paper is.

A number that stands in the quotation, or does but for damage of the scan; what follows from a printed rule,
as docs/papers.md reads it; or what the paper says, or lets expect, in words.
"""

_STRICT = ConfigDict(extra="forbid")
_ALIASES = {"with_": "with", "rows": "row", "pictures": "picture", "sections": "section"}


@dataclass(frozen=True)
class Claim:
    """One line: what the paper says, and where, and the measure that returns our value."""

    __pydantic_config__ = _STRICT
    item: str
    measure: str
    with_: Annotated[Mapping[str, Any], Field(alias="with")] = field(default_factory=dict)
    paper: Any = None
    line: int = 0
    quote: str = ""
    kind: Kind = "printed"
    note: str = ""
    unit: str = ""
    form: str = ""
    within: float = 1e-6


@dataclass(frozen=True)
class Picture:
    """A figure to be drawn again: name of the drawing, its arguments, and what it shows."""

    __pydantic_config__ = _STRICT
    draw: str
    caption: str
    with_: Annotated[Mapping[str, Any], Field(alias="with")] = field(default_factory=dict)


@dataclass(frozen=True)
class Section:
    """A table, figure or claim of the paper."""

    __pydantic_config__ = _STRICT
    place: str
    title: str
    text: str = ""
    rows: Annotated[tuple[Claim, ...], Field(alias="row")] = ()
    pictures: Annotated[tuple[Picture, ...], Field(alias="picture")] = ()


@dataclass(frozen=True)
class Paper:
    """A paper, as far as it can be measured; its walks are those of gait files with some ``changes``."""

    __pydantic_config__ = _STRICT
    name: str
    title: str
    source: str
    robot: str
    sections: Annotated[tuple[Section, ...], Field(alias="section")]
    text: str = ""
    changes: Mapping[str, Any] = field(default_factory=dict)


def load_paper(name_or_path: str | Path) -> Paper:
    """A bundled paper by its name, or any by its path.

    Raises:
        UnknownNameError: there is none; it lists the names.
        FileFaults: faults of the file, all at once.
    """
    path = find_paper(name_or_path)
    return parse_paper(read_text(path, FileFaults), str(path))


def parse_paper(text: str, path: str = "<text>") -> Paper:
    """The paper that a text describes; see ``load_paper``."""
    data = read_toml(text, path, FileFaults)
    head = data.get("paper")
    if not isinstance(head, dict):
        raise FileFaults(path, [Fault("[paper]", "", "no table", "Write its keys")])
    faults = [Fault("", key, "unknown key", "Remove it") for key in data if key not in ("paper", "section")]
    try:
        paper = _PAPER.validate_python({**head, "section": data.get("section", [])})
    except ValidationError as wrong:
        raise FileFaults(path, [*map(_fault, wrong.errors(include_url=False)), *faults]) from None
    for number, section in enumerate(paper.sections, 1):
        for k, row in enumerate(section.rows, 1):
            where = f"section {number}, row {k}"
            if row.unit and row.unit not in UNITS:
                fix = f"Write one of {', '.join(UNITS)}"
                faults.append(Fault(where, "unit", f"unknown unit {row.unit!r}", fix))
            if (row.paper is None) == bool(row.quote and row.line > 0):
                what = "a value of the paper without quotation" if row.paper is not None else "no value of it"
                fix = "Give paper, quote and line (of the paper's text, from 1) together, or none of them"
                faults.append(Fault(where, "paper", what, fix))
    if faults:
        raise FileFaults(path, faults)
    return paper


_PAPER = TypeAdapter(Paper)
_RECORDS = {"": Paper, "section": Section, "row": Claim, "picture": Picture}


def _fault(error: ErrorDetails) -> Fault:
    """A fault of a paper's file in our words."""
    *places, key = ("", *map(str, error["loc"]))
    names = [name for name in places if name in _RECORDS]
    numbers = [int(place) + 1 for place in (*places, key) if place.isdigit()]
    where = ", ".join(f"{name} {number}" for name, number in zip(names[1:], numbers, strict=False))
    if error["type"] == "unexpected_keyword_argument":
        known = [_ALIASES.get(f.name, f.name) for f in fields(_RECORDS[names[-1]])]
        return Fault(where or "[paper]", key, "unknown key", f"{near(key, known)}Valid: {', '.join(known)}")
    found, fix = {
        "missing": ("missing", "Give it"),
        "tuple_type": ("no list of tables", f"Write [[{key}]]"),
        "dataclass_type": ("no table", "Write its keys"),
        "dict_type": ("no table", "Write { name = value }"),
    }.get(error["type"], (f"found {error['input']!r}", error["msg"]))
    return Fault(where or "[paper]", "" if key.isdigit() else key, found, fix)
