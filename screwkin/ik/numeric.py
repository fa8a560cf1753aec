"""Numeric methods: iterations from a guess, for limbs and for limbs that share joints, batched over samples.

All samples are iterated at once; those that have arrived rest. ``pinv`` and ``dls`` are the plain iterations
of paper B on the unscaled Jacobian (rows in rad and m); ``lm`` and ``newton`` divide lengths by the limb's
size. What has not arrived inside the limits is begun anew from a fixed set of other starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Literal, get_args

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton, solved
from screwkin.errors import InputError
from screwkin.ik.system import Bounded, System

Numeric = Literal["newton", "lm", "dls", "pinv"]

CUT = 1e-15
"""Singular values below this share of the largest are dropped by the pseudoinverse: hardly any is."""
BEND = 0.3
"""How far the second start is from the guess [rad]: it leaves the saddle of a straight limb."""
HOPELESS = 12
"""Starts after which a sample that has arrived from none of them is given up."""
PLAIN = 3
"""Every third start iterates as the first does; the others never leave the limits."""
LATER = 100
"""Bound on the steps from every start but the first: most that arrive do so in 20."""
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
            others are fixed: next to the guess, then evenly spread within the limits.
    """

    position_tolerance: float = 1e-10
    rotation_tolerance: float = 1e-10
    max_iterations: int = 500
    damping: float = 0.01
    gain: float = 1.0
    finish: Numeric = "newton"
    starts: int = 20

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
        method: how to iterate.
        guess: (B, n), the first start.
        settings: tolerances and the like.

    Returns:
        x (B, n), and the steps (B,) from the start that led there.
    """
    best = _ended(system, method, guess, settings)
    later = replace(settings, max_iterations=min(settings.max_iterations, LATER))
    for k in range(1, settings.starts):
        at = np.flatnonzero(best.rank == 1 if k >= HOPELESS else best.rank > 0)
        if not len(at):
            break
        end = _ended(system.part(at), method, start(system, guess[at], k), later, k % PLAIN != 0)
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


def start(system: System, guess: Array, k: int) -> Array:
    """The start (B, n) number k: near the guess for k = 1, then spread evenly within the limits.

    Source: the additive recurrence of Roberts (2018), a generalised golden ratio.
    """
    n = guess.shape[1]
    ratio = 2.0
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (n + 1))
    share = (0.5 + k * ratio ** -np.arange(1.0, n + 1)) % 1.0
    reach = np.where(system.turning, np.pi, system.length)
    low = np.where(np.isfinite(system.lower), system.lower, np.minimum(-reach, system.upper - 2 * reach))
    high = np.where(np.isfinite(system.upper), system.upper, np.maximum(reach, low + 2 * reach))
    if k > 1:
        return np.broadcast_to(low + share * (high - low), guess.shape).copy()
    bend = BEND * np.where(system.turning, 1.0, system.length) * (0.5 + share)
    inward = np.where(guess + bend <= high, bend, -bend)
    return guess + inward


def arrived(system: System, lack: Array, settings: IkSettings) -> Array:
    """(B,) bool: a residual (B, m) is within both tolerances, for every limb."""
    good = np.ones(len(lack), dtype=bool)
    for rows in system.slices:
        own = lack[:, rows]
        good &= np.linalg.norm(own[:, -3:], axis=1) <= settings.position_tolerance
        good &= np.linalg.norm(own[:, :-3], axis=1) <= settings.rotation_tolerance
    return good


def _ended(
    system: System, method: Numeric, start: Array, settings: IkSettings, bounded: bool = False
) -> _Ends:
    """Iterations from one start, their end put inside the limits where the tolerances allow it."""
    if bounded:
        inside = Bounded(system.chains, system.targets)
        u, iterations = _METHODS[method](inside, system.variables(start), settings)
        x = system.inner(u)[0]
    else:
        x, iterations = _METHODS[method](system, start, settings)
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

    def residual(x: Array, samples: Array) -> tuple[Array, Array]:
        lack, J = system.residual(x, samples)
        return lack * system.weights, J * system.weights[:, None]

    tolerance = min(settings.rotation_tolerance, settings.position_tolerance / system.length)
    result = newton(residual, x, tolerance, settings.max_iterations)
    return result.x, result.iterations


_METHODS = {"pinv": _pinv, "dls": _dls, "lm": _lm, "newton": _newton}
