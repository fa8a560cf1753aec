"""What a play on servos leaves behind: commands and measurements frame by frame, in one npz file.

Its file holds: ``time`` (F,) planned and ``sent`` (F,) true time of every frame [s] from the start of the
play, ``trajectory_time`` (F,) [s] (NaN before and after the trajectory), ``joint_names``, ``ids`` (n,),
``command`` (F, n) [rad], ``position`` (F, n) [rad], ``speed`` [rad/s], ``load`` [share of the greatest
torque], ``voltage`` [V], ``temperature`` [degrees Celsius], ``read_at`` [s] when that was answered, each
(F, n), NaN where a servo was not read in that frame, and ``meta``, JSON text.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.files import atomic_write_bytes, npz_bytes, read_file, read_json, read_npz

MEASURED = ("position", "speed", "load", "voltage", "temperature", "read_at")
_GROWTH = 2


class Log:
    """Frames of n joints as they are played."""

    def __init__(self, names: Sequence[str], ids: Sequence[int], frames: int = 1024) -> None:
        self.names, self.ids, self.frames = tuple(names), tuple(ids), 0
        n = len(self.names)
        self._times = np.full((frames, 3), np.nan)
        self._command = np.full((frames, n), np.nan)
        self._measured = {name: np.full((frames, n), np.nan) for name in MEASURED}

    def frame(self, time: float, sent: float, trajectory_time: float, command: Array) -> None:
        """Begin a frame: when it was due, when it was sent [s], and what was commanded (n,) [rad]."""
        if self.frames == len(self._times):
            self._grow()
        self._times[self.frames] = time, sent, trajectory_time
        self._command[self.frames] = command
        self.frames += 1

    def measured(self, joint: int, values: Mapping[str, float], time: float) -> None:
        """What a servo answered at a time [s] in the frame begun last; ``values`` has all the rest."""
        for name, value in {**values, "read_at": time}.items():
            if name in self._measured:
                self._measured[name][self.frames - 1, joint] = value

    def arrays(self, meta: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        """The fields as they stand in the file."""
        count = self.frames
        times = dict(zip(("time", "sent", "trajectory_time"), self._times[:count].T, strict=True))
        return {
            **times,
            "joint_names": np.array(self.names, dtype=np.str_),
            "ids": np.array(self.ids, dtype=np.int64),
            "command": self._command[:count],
            **{name: column[:count] for name, column in self._measured.items()},
            "meta": np.array(json.dumps(meta)),
        }

    def save(self, path: str | Path, meta: Mapping[str, Any]) -> Path:
        """Write the file beside, then rename it: it is whole or not there.

        Raises:
            OutputError: it cannot be written.
        """
        path = Path(path)
        data = npz_bytes(self.arrays(meta))
        with atomic_write_bytes(path) as file:
            file.write(data)
        return path

    def _grow(self) -> None:
        def grown(column: Array) -> Array:
            more = np.full((_GROWTH * len(column), *column.shape[1:]), np.nan)
            more[: len(column)] = column
            return more

        self._times, self._command = grown(self._times), grown(self._command)
        self._measured = {name: grown(column) for name, column in self._measured.items()}


@dataclass(frozen=True, eq=False)
class PlayLog:
    """The motion as a log records it: F frames of n joints.

    time (F,) [s] from the start of the play; trajectory_time (F,) [s], NaN before and after the trajectory;
    command (F, n) [rad]; position (F, n) [rad] answered at read_at (F, n) [s], NaN where nothing was read.
    """

    time: Array
    trajectory_time: Array
    joint_names: tuple[str, ...]
    command: Array
    position: Array
    read_at: Array
    meta: Mapping[str, Any]

    @property
    def start(self) -> float:
        """When the trajectory began [s from the start of the play]; NaN if it never did."""
        played = np.flatnonzero(np.isfinite(self.trajectory_time))
        return float(self.time[played[0]] - self.trajectory_time[played[0]]) if len(played) else np.nan

    @property
    def end(self) -> float:
        """The trajectory's time that was played last [s]; NaN if it never began."""
        played = self.trajectory_time[np.isfinite(self.trajectory_time)]
        return float(played[-1]) if len(played) else np.nan


_SHAPES = {
    "time": ("F",),
    "trajectory_time": ("F",),
    "command": ("F", "n"),
    "position": ("F", "n"),
    "read_at": ("F", "n"),
}


def load_log(path: str | Path) -> PlayLog:
    """The record of a ``play.npz``.

    Raises:
        InputError: not there, truncated, damaged, or no log of a play.
    """
    path = Path(path)
    try:
        arrays = read_npz(read_file(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    missing = [name for name in (*_SHAPES, "joint_names", "meta") if name not in arrays]
    if missing:
        raise InputError(
            f"{path} is no log of a play: {', '.join(missing)} missing. "
            "Expected the play.npz of a screwkin send"
        )
    names = tuple(map(str, np.atleast_1d(arrays["joint_names"])))
    sizes = {"F": len(np.atleast_1d(arrays["time"])), "n": len(names)}
    for name, axes in _SHAPES.items():
        shape = tuple(sizes[axis] for axis in axes)
        if arrays[name].shape != shape or arrays[name].dtype != np.float64:
            kind = f"{arrays[name].dtype} {arrays[name].shape}"
            raise InputError(f"{path}: {name} is {kind}, expected float64 {shape}; the log is damaged")
    try:
        meta = read_json(str(arrays["meta"]))
    except InputError:
        meta = None
    if not isinstance(meta, dict):
        raise InputError(f"{path}: meta is not the text of a JSON object; the log is damaged")
    return PlayLog(**{name: arrays[name] for name in _SHAPES}, joint_names=names, meta=meta)
