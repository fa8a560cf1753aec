"""Numeric methods: iterations from a guess, for limbs and for limbs that share joints, batched over samples.

All samples are iterated at once; those that have arrived rest. ``pinv`` and ``dls`` are the plain iterations
of paper B on the unscaled Jacobian (rows in rad and m); ``lm`` and ``newton`` divide lengths by the limb's
size. What has not arrived inside the limits is begun anew from fixed other starts, by bounded least squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Literal, get_args

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.bounded import bounded_least_squares
from screwkin.algebra.newton import Residual, newton, solved
from screwkin.errors import InputError
from screwkin.ik.starts import ROUND, later_starts
from screwkin.ik.system import System

Numeric = Literal["newton", "lm", "dls", "pinv"]

CUT = 1e-15
"""Singular values below this share of the largest are dropped by the pseudoinverse: hardly any is."""
FREE = 3
"""Every third start may leave the limits: it shows whether a target is reached beyond them."""
LATER = 60
"""Bound on the steps from every start but the first: most that arrive do so in 15."""
BETTER = 0.99
"""Share of the residual below which the end of a later start replaces that of an earlier one."""


@dataclass(frozen=True)
class IkSettings:
    """What a numeric method leaves open.

    Attributes:
        position_tolerance: distance at which a sample has arrived [m].
        rotation_tolerance: angle at which it has arrived [rad].
        max_iterations: bound on the steps from every start.
        damping: lambda of ``dls``; its square is added to J J^T (rows in rad and m).
        gain: share of the step that ``pinv`` and ``dls`` take.
        finish: the numeric method that ``hybrid`` continues with.
        starts: number of starts, the guess first, for samples that do not arrive inside the limits; the
            others are fixed: next to the guess, then within the limits where the tips are near their targets.
    """

    position_tolerance: float = 1e-10
    rotation_tolerance: float = 1e-10
    max_iterations: int = 500
    damping: float = 0.01
    gain: float = 1.0
    finish: Numeric = "newton"
    starts: int = 64

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "finish":
                if value not in get_args(Numeric):
                    raise InputError(f"finish is {value!r}; valid: {', '.join(get_args(Numeric))}")
            elif not (isinstance(value, int | float) and np.isfinite(value) and value > 0):
                raise InputError(f"{field.name} is {value!r}; it must be a positive number")

    @property
    def tolerances(self) -> tuple[float, float]:
        """Of angle [rad] and distance [m]."""
        return self.rotation_tolerance, self.position_tolerance


ONE_START = IkSettings(starts=1)
"""From the guess alone: where a limb is to move about a posture, not to find another one."""


@dataclass(frozen=True, eq=False)
class _Ends:
    """Where iterations of B samples have ended: x (B, n), steps (B,), size of the residual (B,), rank (B,).

    The rank is 0 for a solution inside the limits, 1 for another one, 2 for none.
    """

    x: Array
    iterations: Array
    size: Array
    rank: Array


def solve_system(system: System, method: Numeric, guess: Array, settings: IkSettings) -> tuple[Array, Array]:
    """Joint positions that bring all tips of a system to their targets.

    Of all starts the first solution inside the limits is taken, else the solution nearest to the guess, else
    the end of least residual.

    Args:
        system: n joints.
        method: how to iterate from the guess.
        guess: (B, n), the first start.
        settings: tolerances and the like.

    Returns:
        x (B, n), and the steps (B,) from the start that led there.
    """
    best = _ended(system, settings, *_METHODS[method](system, guess, settings))
    starts = np.empty((ROUND, *guess.shape))
    for k in range(settings.starts - 1):
        at = np.flatnonzero(best.rank > 0)
        if not len(at):
            break
        number, row = divmod(k, ROUND)
        part = system.part(at)
        if row == 0:
            starts[:, at] = later_starts(part, guess[at], number)
        end = _ended(part, settings, *_bounded(part, starts[row, at], settings, k % FREE == FREE - 1))
        better = end.rank < best.rank[at]
        nearer = _far(system, end.x, guess[at]) < _far(system, best.x[at], guess[at])
        better |= (end.rank == 1) & (best.rank[at] == 1) & nearer
        better |= (end.rank == 2) & (best.rank[at] == 2) & (end.size < BETTER * best.size[at])
        for field in fields(_Ends):
            getattr(best, field.name)[at[better]] = getattr(end, field.name)[better]
    return best.x, best.iterations


def _far(system: System, x: Array, guess: Array) -> Array:
    """Squared distance (B,) from the guess, whole turns apart."""
    apart = np.where(system.turning, 2 * np.sin((x - guess) / 2), x - guess)
    return np.asarray((apart**2).sum(axis=1))


def arrived(system: System, lack: Array, settings: IkSettings) -> Array:
    """(B,) bool: a residual (B, m) is within both tolerances, for every limb."""
    good = np.ones(len(lack), dtype=bool)
    for rows in system.slices:
        own = lack[:, rows]
        good &= np.linalg.norm(own[:, -3:], axis=1) <= settings.position_tolerance
        good &= np.linalg.norm(own[:, :-3], axis=1) <= settings.rotation_tolerance
    return good


def _ended(system: System, settings: IkSettings, x: Array, iterations: Array) -> _Ends:
    """Where iterations have ended, x put inside the limits where the tolerances allow it."""
    x = system.wrapped(x)
    everyone = np.arange(len(x))
    lack, _ = system.residual(x, everyone)
    good = arrived(system, lack, settings)
    at = np.flatnonzero(good & ~system.within(x))
    if len(at):
        held = np.clip(x[at], system.lower, system.upper)
        rest, _ = system.residual(held, at)
        still = arrived(system, rest, settings)
        x[at[still]], lack[at[still]] = held[still], rest[still]
    rank = np.where(good, np.where(system.within(x), 0, 1), 2)
    return _Ends(x, iterations, np.linalg.norm(lack * system.weights, axis=1), rank)


def _iterated(
    system: System, x: Array, settings: IkSettings, step: Callable[[Array, Array], Array]
) -> tuple[Array, Array]:
    """Repeat x += step(J, lack) for every sample until it has arrived; and how often."""
    x, iterations = x.copy(), np.zeros(len(x), dtype=int)
    at = np.arange(len(x))
    for left in range(settings.max_iterations, -1, -1):
        lack, J = system.residual(x[at], at)
        on = ~arrived(system, lack, settings)
        at = at[on]
        if not left or not len(at):
            break
        x[at] = system.wrapped(x[at] + step(J[on], lack[on]))
        iterations[at] += 1
    return x, iterations


def _pinv(system: System, x: Array, settings: IkSettings) -> tuple[Array, Array]:
    def step(J: Array, lack: Array) -> Array:
        return settings.gain * (np.linalg.pinv(J, rcond=CUT) @ lack[..., None])[..., 0]

    return _iterated(system, x, settings, step)


def _dls(system: System, x: Array, settings: IkSettings) -> tuple[Array, Array]:
    def step(J: Array, lack: Array) -> Array:
        Jt = J.swapaxes(1, 2)
        lifted = J @ Jt + settings.damping**2 * np.eye(J.shape[1])
        return settings.gain * (Jt @ np.linalg.solve(lifted, lack[..., None]))[..., 0]

    return _iterated(system, x, settings, step)


def _lm(system: System, x: Array, settings: IkSettings) -> tuple[Array, Array]:
    """Levenberg-Marquardt with a damping that follows the error (Sugihara 2011): no step is ever refused."""

    def step(J: Array, lack: Array) -> Array:
        J, lack = J * system.weights[:, None], lack * system.weights
        Jt = J.swapaxes(1, 2)
        damping = 0.5 * (lack**2).sum(axis=1) + 1e-12
        lifted = Jt @ J + damping[:, None, None] * np.eye(J.shape[2])
        return np.nan_to_num(solved(lifted, (Jt @ lack[..., None])[..., 0]))

    return _iterated(system, x, settings, step)


def _newton(system: System, x: Array, settings: IkSettings) -> tuple[Array, Array]:
    """The safeguarded Newton method of ``algebra.newton``."""
    result = newton(_weighted(system), x, _tolerance(system, settings), settings.max_iterations)
    return result.x, result.iterations


def _bounded(system: System, x: Array, settings: IkSettings, free: bool) -> tuple[Array, Array]:
    """Bounded least squares within the limits, or without any."""
    wide = np.inf if free else 0.0
    low, high = system.lower - wide, system.upper + wide
    steps = min(settings.max_iterations, LATER)
    result = bounded_least_squares(_weighted(system), x, low, high, _tolerance(system, settings), steps)
    return result.x, result.iterations


def _weighted(system: System) -> Residual:
    """The residual with its lengths divided by the limbs' size."""

    def residual(x: Array, samples: Array) -> tuple[Array, Array]:
        lack, J = system.residual(x, samples)
        return lack * system.weights, J * system.weights[:, None]

    return residual


def _tolerance(system: System, settings: IkSettings) -> float:
    return min(settings.rotation_tolerance, settings.position_tolerance / system.length)


_METHODS = {"pinv": _pinv, "dls": _dls, "lm": _lm, "newton": _newton}
