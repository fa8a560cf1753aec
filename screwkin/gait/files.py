"""Gait files: TOML read into a ``Gait``."""

from __future__ import annotations

from pathlib import Path

from screwkin.errors import GaitError
from screwkin.gait.record import Gait, gait_from_dict
from screwkin.model.library import find_gait, gait_names
from screwkin.model.toml import read_text, read_toml


def default_gait(robot: str) -> str:
    """The bundled gait of a robot if none is chosen: the first named ``ROBOT-…``, else ``walk``.

    Args:
        robot: name of a robot.
    """
    own = [name for name in gait_names() if name.startswith(f"{robot}-")]
    return own[0] if own else "walk"


def load_gait(name_or_path: str | Path) -> Gait:
    """A bundled gait by its name, or the gait of a file.

    Args:
        name_or_path: such as ``"walk"`` or ``"my/gait.toml"``.

    Returns:
        The checked gait; ``replace`` sets its parameters.

    Raises:
        UnknownNameError: no such gait; the message lists the bundled ones.
        GaitError: the file cannot be read or is wrong; all faults are named at once.

    Example:
        >>> import screwkin as sk
        >>> sk.load_gait("walk").replace(Tc=1.2).Tc
        1.2
    """
    path = find_gait(name_or_path)
    return parse_gait(read_text(path, GaitError), str(path))


def parse_gait(text: str, path: str = "<text>") -> Gait:
    """The gait of a TOML text.

    Args:
        text: TOML; the comments of the bundled gaits explain its keys.
        path: where it comes from, for messages.

    Raises:
        GaitError: the text is no TOML, or the gait is wrong; all faults are named at once.
    """
    return gait_from_dict(read_toml(text, path, GaitError), path)
