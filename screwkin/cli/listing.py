"""Names and descriptions of bundled files, read without checking the whole file."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

from screwkin.cli.output import aligned, print_json, say


def list_tables(kind: str, names: Sequence[str], find: Callable[[str], Path], as_json: bool) -> int:
    """Print the bundled files of a kind; ``kind`` is also the table that holds the description."""
    described = {name: _description(find(name), kind) for name in names}
    if as_json:
        print_json({"names": list(described), "descriptions": described})
    else:
        say(aligned(list(described.items())))
    return 0


def _description(path: Path, kind: str) -> str:
    try:
        return str(tomllib.loads(path.read_text(encoding="utf-8")).get(kind, {}).get("description", ""))
    except (OSError, ValueError):
        return "(cannot be read)"
