"""What a play on servos leaves behind: commands and measurements frame by frame, in one npz file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.files import atomic_write_bytes, npz_bytes

Array = NDArray[np.float64]
MEASURED = ("position", "speed", "load", "voltage", "temperature")
_GROWTH = 2


class Log:
    """Frames of n joints as they are played; NaN where a servo was not read in that frame.

    Its file holds: ``time`` (F,) planned and ``sent`` (F,) true time of every frame [s] from the start of the
    play, ``trajectory_time`` (F,) [s] (NaN before and after the trajectory), ``joint_names``, ``ids`` (n,),
    ``command`` (F, n) [rad], ``position`` (F, n) [rad], ``speed`` [rad/s], ``load`` [share of the greatest
    torque], ``voltage`` [V], ``temperature`` [degrees Celsius], each (F, n), and ``meta``, JSON text.
    """

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

    def measured(self, joint: int, values: Mapping[str, float]) -> None:
        """What a servo answered in the frame begun last; ``values`` has all that is MEASURED."""
        for name in MEASURED:
            self._measured[name][self.frames - 1, joint] = values[name]

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
