"""The cache folder, which may be deleted at any time, and the names of what it holds."""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path


def cache_folder() -> Path:
    """The folder of cached files: ``$SCREWKIN_CACHE``, else the user's cache folder."""
    return _folder(os.environ.get("SCREWKIN_CACHE"))


@cache
def _folder(wanted: str | None) -> Path:
    import platformdirs

    return Path(wanted or platformdirs.user_cache_dir("screwkin", appauthor=False))


def digest(*texts: str) -> str:
    """A name for the contents of texts."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:32]
