"""Files that a robot's file names by URI or by a path of another machine: where they are on this one.

A ``package://NAME/rest`` is looked for beside the robot's file and above it, then among the packages that ROS
knows by its environment, then in the share folders of this Python installation.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

_SCHEMES = ("package", "model", "file")


def find_mesh(uri: str, folder: Path) -> Path | None:
    """The file that a URI or a path names, or None where it is not on this machine.

    Args:
        uri: ``package://``, ``model://`` or ``file://``, or a path; backslashes are slashes.
        folder: of the robot's file.
    """
    scheme, separator, rest = uri.strip().replace("\\", "/").partition("://")
    if not separator:
        scheme, rest = "", scheme
    elif scheme not in _SCHEMES:
        return None
    else:
        rest = unquote(rest)
    tried = (
        _by_package(rest.lstrip("/"), folder) if scheme in ("package", "model") else _by_path(rest, folder)
    )
    return next((Path(os.path.normpath(path)) for path in tried if _is_file(path)), None)


def full_path(file: str, folder: Path) -> str:
    """A mesh's path that a table in a folder names; URIs and nothing stay as they are."""
    if not file or "://" in file:
        return file
    return os.path.normpath(folder.absolute() / file.replace("\\", "/"))


def short_path(file: str, folder: Path) -> str:
    """How a table in a folder names a mesh: from there, if the mesh lies in it or in the folder above."""
    home = folder.absolute()
    around = {home, home.parent} - {Path(home.anchor)}
    if "://" in file or not around & set(Path(file).parents):
        return file
    return Path(os.path.relpath(file, home)).as_posix()


def _by_path(rest: str, folder: Path) -> Iterator[Path]:
    """The path itself, from the folder and from those above it."""
    yield from (here / rest for here in _upwards(folder))


def _by_package(rest: str, folder: Path) -> Iterator[Path]:
    """A package's file: the package is a folder of that name, whether beside, above or known to ROS."""
    name, _, inside = rest.partition("/")
    for here in _upwards(folder):
        yield here / rest
        if here.name == name:
            yield here / inside
    for known in package_folders():
        yield known / rest
        if known.name == name:
            yield known / inside
    yield from (here / inside for here in _upwards(folder))  # a checkout under another name


@lru_cache(maxsize=64)
def _upwards(folder: Path) -> tuple[Path, ...]:
    here = folder.absolute()
    return (here, *here.parents)


def package_folders() -> tuple[Path, ...]:
    """Folders that hold packages, or are packages: of ROS 1, of ROS 2 and of this Python installation."""
    environment = os.environ
    ros = [Path(path) for path in environment.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if path]
    ament = environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    ros += [Path(path) / "share" for path in ament if path]
    site = Path(sysconfig.get_path("purelib"))
    return (*ros, Path(sys.prefix) / "share", site / "cmeel.prefix" / "share", site)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # forbidden folders, names too long or with a null byte
        return False
