"""Files of servo models: the bundled ones by name, a user's own by its path; keys: see ``motors``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

from screwkin.errors import TableError, UnknownNameError
from screwkin.model.toml import read_text, read_toml


@cache
def bundled_tables() -> tuple[tuple[Mapping[str, Any], str], ...]:
    """What every bundled model's file holds, and its name, in order of the alphabet."""
    folder = files("screwkin.motors") / "models"
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".toml"))
    return tuple((_toml((folder / name).read_text("utf-8"), name), name) for name in names)


@cache
def model_names() -> tuple[str, ...]:
    """Names of the bundled models, in order of the alphabet."""
    return tuple(sorted(table["model"] for table, _ in bundled_tables()))


def is_model(name: object) -> bool:
    """Whether a name or alias is a bundled model's (case does not matter), or a path that ends in .toml."""
    return isinstance(name, str) and (is_file(name) or name.strip().lower() in _all_names())


def is_file(name: str) -> bool:
    """Whether a name is the path of a model's file."""
    return name.strip().lower().endswith(".toml")


def model_table(path: str, folder: Path | None = None) -> tuple[Mapping[str, Any], str]:
    """What a user's file of a servo model holds, and where it was.

    Args:
        path: of the file.
        folder: where a relative path begins, besides the working folder.

    Raises:
        UnknownNameError: there is no such file. TableError: it cannot be read, or is no TOML.
    """
    name = path.strip()
    for place in (Path(name), *([folder / name] if folder else [])):
        if place.is_file():
            return _toml(read_text(place, TableError), str(place)), str(place)
    motors = tuple(sorted(table["model"] for table, _ in bundled_tables() if "motor" in table))
    raise UnknownNameError("servo model file", name, motors)


@cache
def _all_names() -> frozenset[str]:
    return frozenset(
        name.lower() for table, _ in bundled_tables() for name in (table["model"], *table.get("aliases", ()))
    )


def _toml(text: str, where: str) -> Mapping[str, Any]:
    return MappingProxyType(read_toml(text, where, TableError))
