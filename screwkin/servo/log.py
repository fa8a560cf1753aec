"""What a play on servos leaves behind: commands and measurements frame by frame.

While it plays, records are appended to ``play.jsonl``, each one line of JSON, so that whatever ends the play,
all is there but the last frame: ``{"play": 1, "joint_names": [...], "ids": [...], "meta": {...}}``, and then
in the order in which it happened ``["frame", time, sent, trajectory_time, [command of every joint]]`` and
``["read", joint, read_at, position, speed, load, voltage, temperature]``, ``null`` for what is not known. A
last line without its end is left out.

At the end of a play ``play.npz`` takes its place: ``time`` (F,) planned and ``sent`` (F,) true time of every
frame [s] from the start of the play, ``trajectory_time`` (F,) [s] (NaN before and after the trajectory),
``joint_names``, ``ids`` (n,), ``command`` (F, n) [rad], ``position`` (F, n) [rad], ``speed`` [rad/s],
``load`` [share of the greatest torque], ``voltage`` [V], ``temperature`` [degrees Celsius], ``read_at`` [s]
when that was answered, each (F, n), NaN where a servo was not read in that frame, and ``meta``, JSON text.
"""

from __future__ import annotations

import errno
import json
import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, OutputError
from screwkin.files import atomic_write_bytes, npz_bytes, read_file, read_json, read_npz

MEASURED = ("position", "speed", "load", "voltage", "temperature")
JOURNAL = ".jsonl"
"""Suffix of the log of a play that goes on."""

_FORMAT = 1
_EVERY = 0.05  # s, after which measurements are written even within a frame
_ROOM = 400  # bytes of disk for a joint in a frame, in both files


class Log:
    """Frames of n joints as they are played.

    Args:
        names: of the joints.
        ids: of their servos.
        file: unbuffered, what is appended to; by default memory.
        meta: what is known before the play.

    Raises:
        OutputError: nothing can be written. What goes wrong later stands in ``failure``: a log that fails is
            no reason to leave servos alone.
    """

    def __init__(
        self,
        names: Sequence[str],
        ids: Sequence[int],
        file: BinaryIO | None = None,
        meta: Mapping[str, Any] | None = None,
    ) -> None:
        self.names, self.ids, self.frames = tuple(names), tuple(ids), 0
        self.failure: OutputError | None = None
        self._file: BinaryIO = file or BytesIO()
        self._pending: list[str] = []
        self._written = -math.inf
        head = {"play": _FORMAT, "joint_names": self.names, "ids": self.ids, "meta": dict(meta or {})}
        self._pending.append(json.dumps(head))
        self.flush()
        if self.failure is not None:
            raise self.failure

    def frame(self, time: float, sent: float, trajectory_time: float, command: Array) -> None:
        """Begin a frame: when it was due, when it was sent [s], and what was commanded (n,) [rad]."""
        at = float(trajectory_time) if math.isfinite(trajectory_time) else None
        self._pending.append(json.dumps(["frame", float(time), float(sent), at, command.tolist()]))
        self.frames += 1

    def measured(self, joint: int, values: Mapping[str, float], time: float) -> None:
        """What a servo answered at a time [s] in the frame begun last."""
        known = (float(values.get(name, math.nan)) for name in MEASURED)
        row = [None if math.isnan(value) else value for value in known]
        self._pending.append(json.dumps(["read", int(joint), float(time), *row]))
        if time - self._written > _EVERY:
            self.flush(time)

    def flush(self, time: float = -math.inf) -> None:
        """Write what has been gathered, at a time [s]; once that fails, nothing is written any more."""
        data = "".join(f"{line}\n" for line in self._pending).encode()
        self._pending.clear()
        self._written = time
        if self.failure is not None:
            return
        try:
            while data:
                count = self._file.write(data)
                if not count:
                    raise OSError(errno.EIO, "nothing was written")
                data = data[count:]
        except OSError as error:
            self.failure = OutputError(f"the log cannot be written: {error.strerror or error}")

    def arrays(self, meta: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        """The fields as they stand in the npz file; ``meta`` adds to what was known before."""
        self.flush()
        self._file.seek(0)
        return _arrays(self._file.read(), meta)

    def save(self, path: str | Path, meta: Mapping[str, Any]) -> Path:
        """Write the npz file beside, then rename it: it is whole or not there.

        Raises:
            OutputError: it cannot be written.
        """
        return _save(path, self.arrays(meta))


def check_room(folder: Path, frames: int, joints: int) -> None:
    """Refuse a play whose log the disk cannot take.

    Raises:
        OutputError: says what is free and what is needed.
    """
    needed, free = _ROOM * frames * joints, shutil.disk_usage(folder).free
    if needed > free:
        raise OutputError(
            f"the log needs {needed / 1e6:.1f} MB in {folder}, where {free / 1e6:.1f} MB are free"
        )


def close_journal(path: Path, meta: Mapping[str, Any]) -> Path:
    """Put ``play.npz`` in the place of a ``play.jsonl``, as at the end of a play.

    Args:
        path: of the journal.
        meta: what it does not yet say, as how the play ended.

    Raises:
        InputError: it holds no play. OutputError: the npz file cannot be written; the journal stays.
    """
    saved = _save(path.with_suffix(".npz"), _arrays(read_file(path), meta))
    path.unlink(missing_ok=True)
    return saved


def _save(path: str | Path, arrays: Mapping[str, NDArray[Any]]) -> Path:
    path = Path(path)
    data = npz_bytes(arrays)
    with atomic_write_bytes(path) as file:
        file.write(data)
    return path


def _arrays(data: bytes, meta: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """The fields of an npz file from the lines of a journal.

    Raises:
        InputError: they are no play, or damaged before the last.
    """
    whole, _, _ = data.rpartition(b"\n")
    records = [_record(line, i) for i, line in enumerate(whole.split(b"\n"))]
    head = records[0]
    if not isinstance(head, dict) or head.get("play") != _FORMAT:
        raise InputError("it does not begin as the log of a play does")
    try:
        frames = [record for record in records[1:] if record[0] == "frame"]
        n = len(head["joint_names"])
        measured = np.full((len(MEASURED) + 1, len(frames), n), np.nan)
        i = -1
        for record in records[1:]:
            if record[0] == "frame":
                i += 1
            else:
                measured[:, max(i, 0), record[1]] = record[2:]
        times = np.array([record[1:4] for record in frames], dtype=float).reshape(-1, 3)
        command = np.array([record[4] for record in frames], dtype=float).reshape(-1, n)
        known = dict(head["meta"])
        names, ids = np.array(head["joint_names"], dtype=np.str_), np.array(head["ids"], dtype=np.int64)
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(f"a record that no play writes ({error}); the log is damaged") from None
    return {
        **dict(zip(("time", "sent", "trajectory_time"), times.T, strict=True)),
        "joint_names": names,
        "ids": ids,
        "command": command,
        **dict(zip(("read_at", *MEASURED), measured, strict=True)),
        "meta": np.array(json.dumps(known | dict(meta))),
    }


def _record(line: bytes, i: int) -> Any:
    try:
        return json.loads(line)
    except ValueError:
        raise InputError(f"line {i + 1} is no JSON; the log is damaged") from None


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
    """The record of a ``play.npz``, or of the ``play.jsonl`` of a play that nobody brought to its end.

    Raises:
        InputError: not there, truncated, damaged, or no log of a play.
    """
    path = Path(path)
    try:
        data = read_file(path)
        arrays = _arrays(data, {}) if path.suffix == JOURNAL else read_npz(data)
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
