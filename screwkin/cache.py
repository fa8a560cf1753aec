"""The cache folder, which may be deleted at any time: contents by name, returned if this user stored them.

An entry is one file: the SHA-256 of its name and contents, and the contents. It counts if it is a plain file
of this user that nobody else may write to, and if its hash is right; what was hashed is what is returned. The
folder is ``$SCREWKIN_CACHE``, else the user's cache folder. Where there is none that is the user's alone,
nothing is cached, and one remark says why.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import stat
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

from screwkin.errors import SpeedRemark

LARGEST = 2**26
"""Bytes of an entry; the largest programs take about a hundredth of it."""
_SHA256 = hashlib.sha256().digest_size
_POSIX = os.name == "posix"
_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


class _Unusable(Exception):
    """Why nothing can be cached, in words."""


def cache_folder() -> Path | None:
    """The folder of cached files, there or not yet; None, with one remark, where nothing is cached."""
    try:
        folder = _named()
        if folder.exists():
            _check(folder)
    except _Unusable as reason:
        return _off(str(reason))
    except OSError as error:
        return _off(f"the folder cannot be used: {error}")
    return folder


def digest(*texts: str) -> str:
    """A name for the contents of texts."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:32]


def cached(name: str) -> bytes | None:
    """The contents that this user stored under a name; None if there are none, or not as they were stored."""
    folder = cache_folder()
    if folder is None:
        return None
    with suppress(OSError, ValueError):
        # Without O_NONBLOCK a pipe of that name would wait for its writer for ever.
        file = os.open(folder / name, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _PLAIN)
        with open(file, "rb") as entry:
            about = os.fstat(entry.fileno())
            if not (stat.S_ISREG(about.st_mode) and _own(about) and about.st_size <= LARGEST):
                return None
            data = entry.read(LARGEST)
        if data[:_SHA256] == _hash(name, data[_SHA256:]):
            return data[_SHA256:]
    return None


def store(name: str, contents: bytes) -> None:
    """Cache contents under a name, in a file that only this user may read; complete or not at all."""
    folder = cache_folder()
    if folder is None or len(contents) > LARGEST - _SHA256:
        return
    beside = folder / f".{secrets.token_hex(8)}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _PLAIN, 0o600)
        try:
            with open(file, "wb") as entry:
                entry.write(_hash(name, contents) + contents)
            beside.replace(folder / name)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
    except OSError as error:
        _off(f"nothing can be written to {folder} ({error.strerror or error})")


def _hash(name: str, contents: bytes) -> bytes:
    """With the name, so that no entry can stand for another."""
    return hashlib.sha256(name.encode() + b"\0" + contents).digest()


def _named() -> Path:
    wanted = os.environ.get("SCREWKIN_CACHE")
    if not wanted:
        wanted = _default(os.environ.get("HOME"), os.environ.get("XDG_CACHE_HOME"))
    folder = Path(wanted)
    if not folder.is_absolute():
        raise _Unusable(f"{wanted!r} is no absolute path")
    return folder


@cache
def _default(home: str | None, caches: str | None) -> str:
    """The user's cache folder, which the arguments decide."""
    import platformdirs

    if _POSIX:
        import pwd

        if not (home or caches):
            raise _Unusable("HOME is not set")
        try:
            pwd.getpwuid(os.getuid())
        except KeyError:
            raise _Unusable(f"user id {os.getuid()} has no name on this computer") from None
    return platformdirs.user_cache_dir("screwkin", appauthor=False)


def _check(folder: Path) -> None:
    about = folder.stat()
    if not stat.S_ISDIR(about.st_mode):
        raise _Unusable(f"{folder} is no folder")
    if not _own(about):
        mode = stat.S_IMODE(about.st_mode)
        raise _Unusable(
            f"{folder} (user id {about.st_uid}, mode {mode:03o}) is not this user's alone to write to"
        )


def _own(about: os.stat_result) -> bool:
    """True for what belongs to this user, and what no other may write to."""
    if not _POSIX:
        return True  # folders of Windows' users are theirs by access lists, which stat does not show
    return about.st_uid == os.getuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@cache
def _off(reason: str) -> None:
    """One remark a process."""
    advice = "set SCREWKIN_CACHE to a folder of yours with mode 700"
    warnings.warn(
        f"machine code is compiled in every process anew: {reason}; {advice}", SpeedRemark, stacklevel=2
    )
