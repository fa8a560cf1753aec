"""Springs whose stiffness changes with their deflection: tables and functions, and what deflects them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.newton import Residual, newton
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError, LimitError, NoSolutionError, one_of
from screwkin.kinematics.arrays import checked
from screwkin.model.robot import Robot

Spring = Sequence[tuple[float, float]] | Callable[[Array], tuple[Array, Array]]
"""A spring's law: pairs of deflection [rad or m] and effort [N m or N] that increase through zero, straight
lines between; or a function of deflections (...) that returns efforts (...) and their slopes (...)."""

REACHED = 1e-12
"""Largest error of a deflection that a function's spring is solved for [rad or m]."""
FULL_STEPS = 8
"""Steps of Newton's method, each shorter than the one before; where it takes more, they are damped."""
LONGEST = 0.5
"""The longest of these steps [rad or m]."""


def checked_springs(robot: Robot, springs: Mapping[str, Spring] | None) -> dict[int, Spring]:
    """Laws by index in q; tables as arrays of pairs.

    Raises:
        UnknownNameError: no such joint. InputError: a table does not increase, or has an effort at rest.
    """
    places = {name: i for i, name in enumerate(robot.joint_names)} if springs else {}
    return {
        one_of("joint", name, places): spring if callable(spring) else _pairs(name, spring)
        for name, spring in (springs or {}).items()
    }


def spring_effort(law: Any, deflection: Array) -> tuple[Array, Array]:
    """Effort and slope (...) of a law at deflections (...); beyond a table's ends its last lines go on."""
    if callable(law):
        effort, slope = law(deflection)
        effort, slope = np.asarray(effort, float), np.asarray(slope, float)
        if effort.shape == slope.shape == deflection.shape:
            return effort, slope
        return np.broadcast_to(effort, deflection.shape), np.broadcast_to(slope, deflection.shape)
    slopes = np.diff(law[:, 1]) / np.diff(law[:, 0])
    piece = np.clip(np.searchsorted(law[:, 0], deflection, side="right") - 1, 0, len(slopes) - 1)
    return law[piece, 1] + slopes[piece] * (deflection - law[piece, 0]), slopes[piece]


def spring_deflections(laws: Mapping[str, Any], efforts: Sequence[Array]) -> list[Array]:
    """Deflections (...) at which springs have efforts (...), one for each joint's law.

    Raises:
        LimitError: one is beyond a table's ends. NoSolutionError: a function does not reach its effort.
    """
    known: dict[str, Array] = {}
    functions: dict[str, Array] = {}
    for (name, law), effort in zip(laws.items(), efforts, strict=True):
        if callable(law):
            functions[name] = effort
            continue
        refuse_beyond(name, law[:, 1], effort, "carries")
        known[name] = numpy_of(effort).interp(effort, law[:, 1], law[:, 0])
    if functions:
        known |= zip(functions, _solved(laws, functions), strict=True)
    return [known[name] for name in laws]


def _solved(laws: Mapping[str, Any], efforts: Mapping[str, Array]) -> list[Array]:
    """Deflections of functions, of every joint by itself; joints on one function ask it in one call."""
    if any(is_jax(effort) for effort in efforts.values()):
        raise InputError(
            f"springs of {', '.join(efforts)} are functions, which are solved in NumPy; give tables of pairs"
        )
    alike: dict[int, list[str]] = {}
    for name in efforts:
        alike.setdefault(id(laws[name]), []).append(name)
    names = [name for group in alike.values() for name in group]
    wanted = np.stack(np.broadcast_arrays(*(efforts[name] for name in names)))
    flat, size = wanted.reshape(-1, 1), wanted[0].size
    chosen = [laws[group[0]] for group in alike.values()]
    ends = np.cumsum([size * len(group) for group in alike.values()])

    def residual(x: Array, at: Array) -> tuple[Array, Array]:
        cuts, column = [0, *np.searchsorted(at, ends).tolist()], x[:, 0]
        here = [spring_effort(law, column[a:b]) for law, a, b in zip(chosen, cuts, cuts[1:], strict=False)]
        effort, slope = (np.concatenate(parts)[:, None] for parts in zip(*here, strict=True))
        return (flat[at] - effort) / np.where(slope > 0, slope, np.nan), np.ones((len(at), 1, 1))

    everyone = np.arange(len(flat))
    x, left = np.zeros(flat.shape), np.inf
    for _ in range(FULL_STEPS):
        step, _ = residual(x, everyone)
        x += np.clip(step, -LONGEST, LONGEST)
        worst = float(np.abs(step).max(initial=0.0))
        if not REACHED < worst < left:
            break
        left = worst
    if not worst <= REACHED:
        x = _safely(residual, flat, lambda k: names[k // size])
    found = dict(zip(names, x.reshape(wanted.shape), strict=True))
    return [found[name] for name in efforts]


def _safely(residual: Residual, efforts: Array, name: Callable[[int], str]) -> Array:
    """Deflections (m, 1) at efforts (m, 1), where full steps do not lead there."""
    solved = newton(residual, np.zeros(efforts.shape), REACHED)
    if (solved.residual <= REACHED).all():
        return solved.x
    worst = int(np.nan_to_num(solved.residual, nan=np.inf).argmax())
    raise NoSolutionError(
        f"{name(worst)} carries {efforts[worst, 0]:.4g}, and its spring's function does not rise to it from "
        "rest; its slope must be positive"
    )


def refuse_beyond(name: str, ends: Array, values: Any, verb: str) -> None:
    """Raise a LimitError for values beyond the two ends of a spring's table."""
    if is_jax(values) or not ((values < ends[0]) | (values > ends[-1])).any():
        return
    worst = float(np.ravel(values)[np.abs(np.ravel(values)).argmax()])
    raise LimitError(
        f"{name} {verb} {worst:.4g}, and its spring's table ends at {ends[0]:.4g} and {ends[-1]:.4g}; give "
        "further pairs"
    )


def _pairs(name: str, table: Any) -> Any:
    pairs = checked(f"springs[{name!r}]", table, 2)
    if pairs.ndim != 2 or len(pairs) < 2 or (np.diff(pairs, axis=0) <= 0).any():
        raise InputError(f"springs[{name!r}]: deflections and efforts must increase from pair to pair")
    if abs(np.interp(0.0, pairs[:, 0], pairs[:, 1])) > 0 or not pairs[0, 0] <= 0 <= pairs[-1, 0]:
        raise InputError(f"springs[{name!r}] has an effort without deflection; give a pair (0, 0)")
    return pairs
