"""Values that the shell completes: bundled names, choices, and files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

TOML = (".toml",)
TABLES = (*TOML, ".urdf", ".xml", ".csv")
"""Suffixes of robots' files."""

Completer = Callable[[str], list[str]]


def names_and_files(names: Callable[[], Iterable[str]], suffixes: tuple[str, ...] = ()) -> Completer:
    """What completes an argument that is a bundled name or a file.

    Args:
        names: gives the names.
        suffixes: of files.
    """

    def complete(incomplete: str) -> list[str]:
        known = [name for name in names() if name.startswith(incomplete)]
        return [*known, *(_files(incomplete, suffixes) if suffixes else ())]

    return complete


def _files(incomplete: str, suffixes: tuple[str, ...]) -> Iterator[str]:
    """Files with such suffixes, and folders, whose path begins so."""
    head, slash, tail = incomplete.rpartition("/")
    try:
        entries = sorted(Path(head + slash or ".").expanduser().iterdir())
    except OSError:
        return
    for entry in entries:
        if entry.name.startswith(tail) and not (entry.name.startswith(".") and not tail):
            if entry.is_dir():
                yield f"{head}{slash}{entry.name}/"
            elif entry.suffix in suffixes:
                yield f"{head}{slash}{entry.name}"


def _of(module: str, name: str) -> Any:
    """What a module holds, loaded when the shell asks."""
    return getattr(import_module(f"screwkin.{module}"), name)


def _choices(module: str, *names: str) -> Completer:
    """Words that a module lists."""
    return names_and_files(lambda: (word for name in names for word in _of(module, name)))


_ROBOTS = names_and_files(lambda: _of("model.library", "robot_names")(), TABLES)
_ROBOTS_OR_MOTIONS = names_and_files(lambda: _of("model.library", "robot_names")(), (*TABLES, ".npz"))
_GAITS = names_and_files(lambda: _of("model.library", "gait_names")(), TOML)
_SERVOS = names_and_files(lambda: ("auto", "rigid", "table", *_of("motors.library", "motor_models")()), TOML)
_MODELS = names_and_files(lambda: _of("servo.profiles", "profile_models")(), TOML)

VALUES: Mapping[str, Completer] = {
    "robot": _ROBOTS,
    "source": _ROBOTS,
    "view what": _ROBOTS_OR_MOTIONS,
    "forces robot": _ROBOTS_OR_MOTIONS,
    "codegen what": _choices("export.codegen", "KINDS"),
    "gait": _GAITS,
    "assignments": names_and_files(lambda: (f"{key}=" for key in _of("gait.keys", "KEYS"))),
    "engine": _choices("analysis.engines", "ENGINES"),
    "servo": _SERVOS,
    "model": _MODELS,
    "reproduce name": names_and_files(lambda: _of("model.library", "paper_names")(), TOML),
    "compensate": _choices("gait.compensation", "WAYS"),
    "convention": _choices("model.dh", "CONVENTIONS"),
    "friction": _choices("motors.identify", "FRICTIONS"),
}
"""What completes the parameter of that name: of one verb, or of any."""
