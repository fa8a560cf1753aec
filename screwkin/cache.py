"""The cache folder, which may be deleted at any time: names of what it holds, and what may be run of it."""

from __future__ import annotations

import hashlib
import os
import stat
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


def seal(path: Path) -> None:
    """Make a finished file of the cache its owner's alone, and note its contents beside it."""
    path.chmod(0o700)
    _seal(path).write_text(_contents(path), encoding="ascii")


def sealed(path: Path) -> bool:
    """True if a file is as ``seal`` saw it, and of this user, so that its code may be run."""
    try:
        status = path.lstat()
        own = not hasattr(os, "getuid") or status.st_uid == os.getuid()
        alone = os.name != "posix" or not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        whole = stat.S_ISREG(status.st_mode) and _seal(path).read_text(encoding="ascii") == _contents(path)
    except (OSError, ValueError):
        return False
    return own and alone and whole


def _seal(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _contents(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
