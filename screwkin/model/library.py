"""Where robots, gaits and papers are: bundled ones by name, any other by its path."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from screwkin.errors import UnknownNameError

ROBOTS, GAITS, PAPERS = "robots", "trajectories", "papers"


def robot_names() -> tuple[str, ...]:
    """Names of the bundled robots and mechanisms, in order of the alphabet.

    Returns:
        Names that ``load_robot`` takes, such as ``linkages/four-bar``.

    Example:
        >>> import screwkin as sk
        >>> "linkages/four-bar" in sk.robot_names()
        True
    """
    return _names(ROBOTS)


def gait_names() -> tuple[str, ...]:
    """Names of the bundled gaits."""
    return _names(GAITS)


def paper_names() -> tuple[str, ...]:
    """Names of the bundled lists of what papers report, to be reproduced."""
    return _names(PAPERS)


def find_robot(name_or_path: str | Path) -> Path:
    """The file of a bundled robot, or of any table by its path.

    Raises:
        UnknownNameError: neither a bundled name nor a file; it lists the names.
    """
    return _find("robot", ROBOTS, name_or_path)


def find_gait(name_or_path: str | Path) -> Path:
    """The file of a bundled gait, or of any gait file by its path.

    Raises:
        UnknownNameError: neither a bundled name nor a file; it lists the names.
    """
    return _find("gait", GAITS, name_or_path)


def find_paper(name_or_path: str | Path) -> Path:
    """The file of a bundled paper's tables and figures, or of any such file by its path.

    Raises:
        UnknownNameError: neither a bundled name nor a file; it lists the names.
    """
    return _find("paper", PAPERS, name_or_path)


def data_folder(kind: str) -> Path:
    """The folder of bundled tables: inside the package where a wheel puts them, else in the checkout."""
    package = Path(str(files("screwkin")))
    installed = package / "data" / kind
    return installed if installed.is_dir() else package.parent / kind


def _names(kind: str) -> tuple[str, ...]:
    folder = data_folder(kind)
    names = (path.relative_to(folder).with_suffix("").as_posix() for path in folder.rglob("*.toml"))
    return tuple(sorted(names, key=lambda name: (name.count("/"), name)))


def _find(what: str, kind: str, name_or_path: str | Path) -> Path:
    """A bundled name wins over a path that reads the same; only what looks like a path is tried as one."""
    name, valid = str(name_or_path), _names(kind)
    if name in valid:
        return data_folder(kind) / f"{name}.toml"
    suffixed = name.lower().endswith((".toml", ".urdf", ".csv", ".xacro", ".xml", ".sdf"))
    looks_like_path = isinstance(name_or_path, Path) or suffixed or "/" in name or "\\" in name
    if looks_like_path and _exists(Path(name)):
        return Path(name)
    raise UnknownNameError(f"{what} file" if looks_like_path else what, name, valid)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # forbidden folders, names too long or with a null byte
        return False
