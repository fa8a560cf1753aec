"""What takes long to make and stays the same: kept in the user's cache folder, which may be deleted."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from screwkin.errors import OutputError
from screwkin.files import atomic_write


def cache_folder() -> Path:
    """Where things are kept: ``$SCREWKIN_CACHE``, else the user's cache folder."""
    return _folder(os.environ.get("SCREWKIN_CACHE"))


@cache
def _folder(wanted: str | None) -> Path:
    import platformdirs

    return Path(wanted or platformdirs.user_cache_dir("screwkin", appauthor=False))


def digest(*told: str) -> str:
    """A name for what texts say."""
    return hashlib.sha256("\0".join(told).encode()).hexdigest()[:32]


def remembered(name: str, made_of: str, make: Callable[[], Any]) -> Any:
    """A result that JSON can hold, as it was made before of the same things, or made now and kept.

    Args:
        name: what it is; begins the file's name.
        made_of: all that decides the result, in words.
        make: makes it.
    """
    file = cache_folder() / f"{name}-{digest(made_of)}.json"
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        made = json.loads(json.dumps(make()))
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with atomic_write(file) as beside:
            json.dump(made, beside)
    except (OSError, OutputError):
        pass  # nothing is lost but the time to make it again
    return made
