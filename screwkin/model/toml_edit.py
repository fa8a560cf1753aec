"""Values of a TOML text changed where they stand: comments, order and formulas of the rest stay."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from screwkin.model.toml_out import table_text, toml_key, toml_value

Place = tuple[str | int, ...]
"""Keys and row numbers that lead to a value, as in ``("link", 2, "mass")``."""

_BLANK = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)*")
_KEY = re.compile(r"""[ \t]*("(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[A-Za-z0-9_-]+)[ \t]*\.?""")
_STRING = re.compile(r'"{3}(?:[^\\]|\\.)*?"{3,5}|\'{3}.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'', re.DOTALL)
_EQUALS = re.compile(r"=[ \t]*")


@dataclass(frozen=True)
class _Statement:
    """``key = value`` at text[start:end], its value at text[value:end]."""

    start: int
    value: int
    end: int


def edited(text: str, changes: Mapping[Place, Any]) -> str:
    """The text with other values, or without the keys whose new value is None.

    Where a value stands within another one, so that it cannot be changed in place, the whole text is written
    anew: the same data with the changes, without comments.

    Args:
        text: sound TOML.
        changes: the new value of each place; the table or row that holds the key exists.
    """
    data = tomllib.loads(text)
    wanted = deepcopy(data)
    for (*path, key), value in changes.items():
        holder: Any = wanted
        for part in path:
            holder = holder[part]
        if value is None:
            holder.pop(key, None)
        else:
            holder[key] = value
    try:
        new = _in_place(text, changes)
        if tomllib.loads(new) == wanted:
            return new
    except (KeyError, tomllib.TOMLDecodeError):
        pass
    return table_text(wanted)


def _in_place(text: str, changes: Mapping[Place, Any]) -> str:
    """The text with every change where its key stands; a new key comes at the end of its table.

    Raises:
        KeyError: the table has no header of its own.
    """
    statements, ends = _scan(text)
    cuts: list[tuple[int, int, str]] = []
    for place, value in changes.items():
        if place in statements:
            one = statements[place]
            line = text.find("\n", one.end) + 1 or len(text)
            cuts.append((one.start, line, "") if value is None else (one.value, one.end, toml_value(value)))
        elif value is not None:
            end = text.find("\n", ends[place[:-1]])
            end = len(text) if end < 0 else end
            cuts.append((end, end, f"\n{toml_key(str(place[-1]))} = {toml_value(value)}"))
    for start, end, new in sorted(cuts, key=lambda cut: cut[0], reverse=True):
        text = text[:start] + new + text[end:]
    return text


def _scan(text: str) -> tuple[dict[Place, _Statement], dict[Place, int]]:
    """Every ``key = value`` by its place, and for every table with a header the end of what it holds."""
    statements: dict[Place, _Statement] = {}
    ends: dict[Place, int] = {(): 0}
    rows: dict[Place, int] = {}
    table: Place = ()
    at = _end(_BLANK, text, 0)
    while at < len(text):
        if text[at] == "[":
            many = text.startswith("[[", at)
            keys, stop = _keys(text, at + 1 + many)
            table = _resolved(keys, rows, many)
            stop = ends[table] = text.index("]", stop) + 1 + many
        else:
            keys, stop = _keys(text, at)
            value = _end(_EQUALS, text, stop)
            stop = ends[table] = _value_end(text, value)
            statements[(*table, *keys)] = _Statement(at, value, stop)
        at = _end(_BLANK, text, stop)
    return statements, ends


def _resolved(keys: Sequence[str], rows: dict[Place, int], many: bool) -> Place:
    """The place of a header's table: the last row so far of every array of tables on the way."""
    place: Place = ()
    for i, key in enumerate(keys):
        place = (*place, key)
        if many and i == len(keys) - 1:
            rows[place] = rows.get(place, -1) + 1
        if place in rows:
            place = (*place, rows[place])
    return place


def _keys(text: str, at: int) -> tuple[list[str], int]:
    """The parts of a dotted key, and where it ends."""
    keys = []
    while part := _KEY.match(text, at):
        keys.append(tomllib.loads(f"key = {part[1]}")["key"] if part[1][0] in "\"'" else part[1])
        at = part.end()
    return keys, at


def _value_end(text: str, at: int) -> int:
    """Where a value ends: before a comment or line end that stands in no bracket."""
    depth, end = 0, at
    while at < len(text) and (depth or text[at] not in "#\n"):
        if text[at] in "\"'":
            at = end = _end(_STRING, text, at)
        elif text[at] == "#":
            at = _end(_BLANK, text, at)
        else:
            depth += (text[at] in "[{") - (text[at] in "]}")
            end = at + 1 if text[at] not in " \t\r" else end
            at += 1
    return end


def _end(pattern: re.Pattern[str], text: str, at: int) -> int:
    """Where a match that begins here ends."""
    matched = pattern.match(text, at)
    if matched is None:
        raise KeyError(text[at : at + 20])
    return matched.end()
