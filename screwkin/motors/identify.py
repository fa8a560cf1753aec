"""Identification of a servo's motor from records of a bench, with the error on records held back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, UnknownNameError
from screwkin.motors.bench import BenchLog, as_logged, position_error
from screwkin.motors.pendulum import Pendulum, delayed, swing
from screwkin.motors.records import Friction, FrictionModel, Motor, MotorModel

STEP = 2e-3
"""Duration of a step while fitting [s]; errors are reported at the bench's own."""
TYPICAL_ERROR = 0.03
"""Beyond such an error [rad] a sample counts linearly: a servo stuck elsewhere says little by how far."""
PRIOR = 0.1
"""What a figure costs that doubles: this share of all samples being wrong by the typical error. What the logs
do not show stays as it was."""
SCALES = ((1.0, 1.0), (0.6, 2.0))
"""Starts: factors of the torque constant and the friction."""
_SAMPLE_EVERY = 5
_MOST_STEPS = 30

_Range = tuple[float, float, float]
_MOTOR: Mapping[str, _Range] = {"lag": (0.005, 0.0, 0.05), "offset": (0.0, -0.2, 0.2)}
_PLAIN: Mapping[str, _Range] = {"coulomb": (0.01, 0.0, 0.2), "viscous": (0.01, 0.0, 0.2)}
_REST: Mapping[str, _Range] = {
    "stribeck": (0.01, 0.0, 0.2),
    "speed": (1.0, 0.05, 6.0),
    "shape": (1.3, 0.5, 4.0),
}
_SIDES = ("load_motor", "load_external")
_LOAD: Mapping[str, _Range] = dict.fromkeys(_SIDES, (0.1, 0.0, 0.9))
_LOAD_REST: Mapping[str, _Range] = {f"{side}_stribeck": (0.05, 0.0, 0.9) for side in _SIDES}
_SQUARES: Mapping[str, _Range] = {f"{side}_square": (0.01, 0.0, 0.5) for side in _SIDES}
FRICTIONS: Mapping[FrictionModel, Mapping[str, _Range]] = {
    "m1": _PLAIN,
    "m2": {**_PLAIN, **_REST},
    "m3": {**_PLAIN, "load": _LOAD["load_motor"]},
    "m4": {
        **_PLAIN,
        **_REST,
        "load": _LOAD["load_motor"],
        "load_stribeck": _LOAD_REST["load_motor_stribeck"],
    },
    "m5": {**_PLAIN, **_REST, **_LOAD, **_LOAD_REST},
    "m6": {**_PLAIN, **_REST, **_LOAD, **_LOAD_REST, **_SQUARES},
}
"""Coefficients of every friction model: first guess, bounds; torques in shares of the stall torque."""


@dataclass(frozen=True)
class Identification:
    """The figures that were fitted, and how well they replay.

    offset: angle of the pendulum when it hangs straight down, as the bench reads it, with opposite sign
    [rad]; fitted, held_back: mean absolute position error [rad] by the log's name.
    """

    model: MotorModel
    friction: FrictionModel
    offset: float
    fitted: Mapping[str, float]
    held_back: Mapping[str, float]


def identify(
    start: MotorModel,
    logs: Sequence[BenchLog],
    held_back: Sequence[BenchLog] = (),
    friction: FrictionModel = "m3",
    progress: Callable[[float], None] | None = None,
) -> Identification:
    """Fit a motor to what a servo did on a bench.

    Torque constant, resistance, rotor inertia, greatest current, lag, friction and the bench's zero are
    fitted; the firmware's gain, dead zone, punch and greatest duty stay those of ``start``.

    Args:
        start: the model whose firmware it is, and where the search starts.
        logs: fitted together.
        held_back: only compared.
        friction: model of the friction, see ``FRICTIONS``.
        progress: called with the share done.

    Raises:
        InputError: no logs. UnknownNameError: no such friction model.
    """
    from scipy.optimize import least_squares

    if friction not in FRICTIONS:
        raise UnknownNameError("friction model", friction, tuple(FRICTIONS))
    if not logs:
        raise InputError("nothing to fit: give at least one log that is not held back")
    bench = _Bench.of(start.motor, logs)
    spec = _spec(start.motor, friction)
    names, report = tuple(spec), progress or (lambda share: None)
    first, low, high = np.array(list(spec.values())).T
    scale = np.maximum(np.abs(first), 0.02 * (high - low))
    pull = TYPICAL_ERROR * np.sqrt(PRIOR * bench.samples) / scale
    best: Any = None
    for i, (of_constant, of_friction) in enumerate(SCALES):
        scaled = {"constant": of_constant, **dict.fromkeys(FRICTIONS[friction], of_friction)}
        guess = first * [scaled.get(name, 1.0) for name in names]
        found = least_squares(
            lambda x: np.append(bench.residuals(names, x[None])[:, 0].ravel(), (x - first) * pull),
            np.clip(guess, low + 1e-9 * (high - low), high - 1e-9 * (high - low)),
            lambda x: np.vstack([bench.jacobian(names, x, scale, high), np.diag(pull)]),
            bounds=(low, high),
            x_scale=scale,
            loss="soft_l1",
            f_scale=TYPICAL_ERROR,
            ftol=1e-3,
            xtol=1e-4,
            max_nfev=_MOST_STEPS,
        )
        best = found if best is None or found.cost < best.cost else best
        report((i + 1) / len(SCALES))
    motor, offset = _motor(start.motor, names, best.x)
    model = MotorModel(
        start.model,
        (),
        f"identified from {', '.join(log.name for log in logs)} with friction {friction}",
        True,
        motor,
        registers=start.registers,
    )
    return Identification(
        model, friction, offset, _errors(motor, logs, offset), _errors(motor, held_back, offset)
    )


def _errors(motor: Motor, logs: Sequence[BenchLog], offset: float) -> dict[str, float]:
    return {log.name: position_error(motor, log, offset) for log in logs}


def _spec(motor: Motor, friction: FrictionModel) -> dict[str, _Range]:
    """First guess and bounds of every unknown, torques of friction scaled to the motor."""
    torque, current = float(motor.stall_torque), float(motor.voltage / motor.resistance)
    spec: dict[str, _Range] = {
        name: (value, 0.2 * value, 5.0 * value)
        for name, value in (("constant", motor.constant), ("resistance", motor.resistance))
    }
    spec["armature"] = (motor.armature, 0.02 * motor.armature, 10.0 * motor.armature)
    spec["max_current"] = (current, 0.1 * current, 5.0 * current)
    torques = ("coulomb", "viscous", "stribeck")
    for name, bounds in {**_MOTOR, **FRICTIONS[friction]}.items():
        least, low, high = bounds
        factor = torque if name in torques else 1.0 / torque if name.endswith("_square") else 1.0
        spec[name] = (factor * least, factor * low, factor * high)
    return spec


def _motor(motor: Motor, names: Sequence[str], x: Array) -> tuple[Motor, Any]:
    """Motor and offset of unknowns x (..., P); figures have the shape (...)."""
    values = dict(
        zip(names, (float(v) for v in x) if x.ndim == 1 else np.moveaxis(x, -1, 0)[..., None], strict=True)
    )
    for shared in ("load", "load_stribeck"):
        if shared in values:
            both = values.pop(shared)
            values |= {shared.replace("load", side): both for side in _SIDES}
    offset = values.pop("offset")
    friction = {f.name: values.pop(f.name) for f in fields(Friction) if f.name in values}
    return replace(motor, **values, friction=Friction(**friction)), offset


@dataclass(frozen=True, eq=False)
class _Bench:
    """Logs side by side on one grid of times: goals, positions (K, L), and until when each lasts (K, L)."""

    motor: Motor
    pendulum: Pendulum
    goals: Array
    positions: Array
    lasts: Array

    @classmethod
    def of(cls, motor: Motor, logs: Sequence[BenchLog]) -> _Bench:
        grid = np.arange(0.0, max(log.time[-1] for log in logs), STEP)
        goals = np.stack([np.interp(grid, log.time, log.goal) for log in logs], axis=1)
        positions = np.stack([np.interp(grid, log.time, log.position) for log in logs], axis=1)
        logged = [as_logged(motor, log) for log in logs]
        hanging = Pendulum(
            *(np.array([getattr(log.pendulum, f.name) for log in logs]) for f in fields(Pendulum))
        )
        lasts = np.stack([grid <= log.time[-1] for log in logs], axis=1)
        kp, voltage = np.array([[own.kp, own.voltage] for own in logged]).T
        return cls(replace(motor, kp=kp, voltage=voltage), hanging, goals, positions, lasts)

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return len(self.goals[::_SAMPLE_EVERY]) * self.goals.shape[1]

    def residuals(self, names: Sequence[str], x: Array) -> Array:
        """Position errors (S, P, L) [rad] at every few steps, for P sets of unknowns (P, n)."""
        motor, offset = _motor(self.motor, names, x)
        hanging = replace(self.pendulum, offset=self.pendulum.offset + offset)
        goals = delayed(self.goals[:-1, None], motor.lag, STEP)
        angles = swing(motor, hanging, goals, self.positions[0], dt=STEP)
        return ((angles - self.positions[:, None]) * self.lasts[:, None])[::_SAMPLE_EVERY]

    def jacobian(self, names: Sequence[str], x: Array, scale: Array, high: Array) -> Array:
        """Derivatives of all residuals by finite differences, in one simulation."""
        h = 1e-3 * scale
        h = np.where(x + h > high, -h, h)
        rows = self.residuals(names, np.vstack([x, x + np.diag(h)]))
        slopes = (rows[:, 1:] - rows[:, :1]) / h[:, None]
        return np.asarray(slopes.transpose(0, 2, 1).reshape(-1, len(x)))
