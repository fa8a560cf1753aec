"""Records of a servo on a bench: what it was commanded, and where it was."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.files import LARGEST_RECORD, read_file, read_json
from screwkin.motors.pendulum import STEP, Pendulum, delayed, swing
from screwkin.motors.records import Motor

_MOST_SAMPLES = 1_000_000
_ROW = ("timestamp", "goal_position", "position")


@dataclass(frozen=True, eq=False)
class BenchLog:
    """One record of a pendulum on a servo.

    name: of its file; model: of the servo, empty where unknown; time, goal, position (T,) [s, rad], time
    increasing from 0; gain: of the firmware, None for the model's; voltage: of the supply [V], None for the
    model's; pendulum: what hangs on it.
    """

    name: str
    model: str
    time: Array
    goal: Array
    position: Array
    gain: float | None
    voltage: float | None
    pendulum: Pendulum


def load_bench_log(path: str | Path) -> BenchLog:
    """A record of a bench as JSON.

    It holds ``mass`` [kg] at ``length`` [m], optionally ``arm_mass`` [kg] of an even rod, ``kp``, ``vin``
    [V], ``motor``, and ``entries`` with ``timestamp`` [s], ``goal_position`` and ``position`` [rad].

    Raises:
        InputError: it cannot be read, or something in it is missing or no finite number.
    """
    path = Path(path)
    try:
        data = read_json(read_file(path, LARGEST_RECORD).decode("utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # InputError is one, and UnicodeError
        raise InputError(f"{path}: {error}") from None
    entries = data.get("entries") if isinstance(data, dict) else None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{path} is no log of a bench: expected mass, length, kp, vin and a list of entries")
    time, goal, position = _columns(path, entries)
    mass, length = _number(path, data, "mass"), _number(path, data, "length")
    rod = _number(path, data, "arm_mass", 0.0)
    hanging = Pendulum((mass + rod / 3) * length**2, (mass + rod / 2) * 9.81 * length)
    gain, voltage = _number(path, data, "kp"), _number(path, data, "vin")
    if min(mass, length, gain, voltage) <= 0.0 or rod < 0.0:
        raise InputError(f"{path}: mass, length, kp and vin must be above 0")
    return BenchLog(path.name, str(data.get("motor", "")), time, goal, position, gain, voltage, hanging)


def replayed_angles(motor: Motor, log: BenchLog, offset: float = 0.0, dt: float = STEP) -> Array:
    """Angles (T,) [rad] at the times of a log, simulated from its goals and its first position alone."""
    grid = np.arange(0.0, log.time[-1] + dt, dt)
    goals = delayed(np.interp(grid, log.time, log.goal), motor.lag, dt)
    hanging = Pendulum(log.pendulum.inertia, log.pendulum.weight, log.pendulum.offset + offset)
    angles = swing(as_logged(motor, log), hanging, goals, log.position[0], dt=dt)
    return np.interp(log.time, np.append(grid, grid[-1] + dt), angles)


def position_error(motor: Motor, log: BenchLog, offset: float = 0.0) -> float:
    """Mean absolute error [rad] of ``replayed`` against the log."""
    return float(np.abs(replayed_angles(motor, log, offset) - log.position).mean())


def as_logged(motor: Motor, log: BenchLog) -> Motor:
    """The motor at the gain and the supply of a log."""
    kp = motor.kp if log.gain is None else log.gain
    return replace(motor, kp=kp, voltage=motor.voltage if log.voltage is None else log.voltage)


def _columns(path: Path, entries: list[dict[str, Any]]) -> tuple[Array, Array, Array]:
    if not 2 <= len(entries) <= _MOST_SAMPLES:
        raise InputError(f"{path} has {len(entries)} entries; expected 2 to {_MOST_SAMPLES}")
    rows = []
    for i, entry in enumerate(entries):
        if entry.get("torque_enable") is False:
            raise InputError(f"{path}: entry {i} was recorded without torque; cut the log before it")
        rows.append([_number(f"{path}, entry {i}", entry, name) for name in _ROW])
    time, goal, position = np.array(rows).T
    if not (np.diff(time) > 0.0).all():
        raise InputError(f"{path}: timestamp does not increase from entry to entry")
    return time - time[0], goal, position


def _number(where: object, data: dict[str, Any], name: str, default: float | None = None) -> float:
    value = data.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{where}: {name} is {value!r}; expected a finite number")
    return float(value)
