"""Inverse kinematics of a limb: closed form, hybrid and numeric methods, batched over samples.

Numeric methods iterate all samples at once; those that have arrived rest. ``pinv`` and ``dls`` are the plain
iterations of paper B on the unscaled Jacobian (rows in rad and m); ``lm`` and ``newton`` divide lengths by
the limb's size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Literal, get_args

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton
from screwkin.errors import InputError
from screwkin.ik.closed import closed_form, solve_closed
from screwkin.ik.hybrid import hybrid_seed
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.kinematics.serial_chain import Chain, missing

Numeric = Literal["newton", "lm", "dls", "pinv"]
Method = Literal["auto", "closed", "hybrid", "newton", "lm", "dls", "pinv"]


CUT = 1e-15
"""Singular values below this share of the largest are dropped by the pseudoinverse: hardly any is."""


@dataclass(frozen=True)
class IkSettings:
    """What a numeric method leaves open.

    Attributes:
        position_tolerance: distance at which a sample has arrived [m].
        rotation_tolerance: angle at which it has arrived [rad].
        max_iterations: bound on the steps.
        damping: lambda of ``dls``; its square is added to J J^T (rows in rad and m).
        gain: share of the step that ``pinv`` and ``dls`` take.
        finish: the numeric method that ``hybrid`` continues with.
    """

    position_tolerance: float = 1e-10
    rotation_tolerance: float = 1e-10
    max_iterations: int = 500
    damping: float = 0.01
    gain: float = 1.0
    finish: Numeric = "newton"

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "finish":
                if value not in get_args(Numeric):
                    raise InputError(f"finish is {value!r}; valid: {', '.join(get_args(Numeric))}")
            elif not (isinstance(value, int | float) and np.isfinite(value) and value > 0):
                raise InputError(f"{field.name} is {value!r}; it must be a positive number")


def solve_limb(
    chain: Chain,
    target: Array,
    method: Method,
    guess: Array,
    settings: IkSettings,
    batch: tuple[int, ...],
    nearest: bool = True,
) -> LimbSolutions:
    """Joint positions that put the tip of a limb at its targets.

    Args:
        chain: n joints.
        target: poses (B, 4, 4), or positions (B, 3), in the base frame.
        method: ``"auto"`` is closed where the geometry has a closed form and the target is a pose.
        guess: (B, n); numeric methods start there.
        settings: of the numeric methods.
        batch: shape with B samples, for the result.
        nearest: let the closed form end with the least-squares answer where there is no solution.

    Raises:
        InputError: the method does not fit the limb or the target.
    """
    if method == "auto":
        method = "newton" if target.ndim == 2 or not _has_closed_form(chain) else "closed"
    if target.ndim == 2 and method in ("closed", "hybrid"):
        raise InputError(f"method {method} needs poses (..., 4, 4); positions (..., 3) need a numeric method")
    if method == "closed":
        q, error, valid = solve_closed(closed_form(chain), target, guess, nearest)
        return ordered(chain, method, q, valid, error, np.ones(error.shape, dtype=int), guess, batch)
    start = hybrid_seed(chain, target, guess) if method == "hybrid" else guess
    solver = settings.finish if method == "hybrid" else method
    q, iterations = _NUMERIC[solver](chain, target, start, settings)
    q = chain.wrapped(q)
    lack, _ = missing(chain, q, target)
    error = np.linalg.norm(lack, axis=1)
    one = (slice(None), None)
    return ordered(
        chain, method, q[one], arrived(lack, settings)[one], error[one], iterations[one], guess, batch
    )


def _has_closed_form(chain: Chain) -> bool:
    try:
        closed_form(chain)
    except InputError:
        return False
    return True


def arrived(lack: Array, settings: IkSettings) -> Array:
    """(B,) bool: what lacks (B, 6 or 3) is within both tolerances."""
    near = np.linalg.norm(lack[:, -3:], axis=1) <= settings.position_tolerance
    return near & (np.linalg.norm(lack[:, :-3], axis=1) <= settings.rotation_tolerance)


def _iterated(
    chain: Chain, target: Array, q: Array, settings: IkSettings, step: Callable[[Array, Array], Array]
) -> tuple[Array, Array]:
    """Repeat q += step(J, lack) for every sample until it has arrived; and how often."""
    q, iterations = q.copy(), np.zeros(len(q), dtype=int)
    at = np.arange(len(q))
    for left in range(settings.max_iterations, -1, -1):
        lack, J = missing(chain, q[at], target[at])
        on = ~arrived(lack, settings)
        at = at[on]
        if not left or not len(at):
            break
        q[at] = chain.wrapped(q[at] + step(J[on], lack[on]))
        iterations[at] += 1
    return q, iterations


def _pinv(chain: Chain, target: Array, q: Array, settings: IkSettings) -> tuple[Array, Array]:
    def step(J: Array, lack: Array) -> Array:
        return settings.gain * (np.linalg.pinv(J, rcond=CUT) @ lack[..., None])[..., 0]

    return _iterated(chain, target, q, settings, step)


def _dls(chain: Chain, target: Array, q: Array, settings: IkSettings) -> tuple[Array, Array]:
    def step(J: Array, lack: Array) -> Array:
        Jt = J.swapaxes(1, 2)
        lifted = J @ Jt + settings.damping**2 * np.eye(J.shape[1])
        return settings.gain * (Jt @ np.linalg.solve(lifted, lack[..., None]))[..., 0]

    return _iterated(chain, target, q, settings, step)


def _lm(chain: Chain, target: Array, q: Array, settings: IkSettings) -> tuple[Array, Array]:
    """Levenberg-Marquardt with a damping that follows the error (Sugihara 2011): no step is ever refused."""

    def step(J: Array, lack: Array) -> Array:
        weights = _weights(chain, lack)
        J, lack = J * weights[:, None], lack * weights
        Jt = J.swapaxes(1, 2)
        damping = 0.5 * (lack**2).sum(axis=1) + 1e-12
        lifted = Jt @ J + damping[:, None, None] * np.eye(J.shape[2])
        return np.asarray(np.linalg.solve(lifted, Jt @ lack[..., None])[..., 0])

    return _iterated(chain, target, q, settings, step)


def _newton(chain: Chain, target: Array, q: Array, settings: IkSettings) -> tuple[Array, Array]:
    """The safeguarded Newton method of ``algebra.newton``."""

    def residual(x: Array, samples: Array) -> tuple[Array, Array]:
        lack, J = missing(chain, x, target[samples])
        weights = _weights(chain, lack)
        return lack * weights, J * weights[:, None]

    tolerance = min(settings.rotation_tolerance, settings.position_tolerance / chain.length)
    result = newton(residual, q, tolerance, settings.max_iterations)
    return result.x, result.iterations


def _weights(chain: Chain, lack: Array) -> Array:
    """One for angles, the inverse of the limb's size for lengths."""
    return np.r_[np.ones(lack.shape[1] - 3), np.full(3, 1 / chain.length)]


_NUMERIC = {"pinv": _pinv, "dls": _dls, "lm": _lm, "newton": _newton}
