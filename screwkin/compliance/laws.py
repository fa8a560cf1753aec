"""Springs whose stiffness changes with their deflection: tables and functions, and what deflects them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.newton import newton
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError, LimitError, NoSolutionError, one_of
from screwkin.kinematics.arrays import checked
from screwkin.model.robot import Robot

Spring = Sequence[tuple[float, float]] | Callable[[Array], tuple[Array, Array]]
"""A spring's law: pairs of deflection [rad or m] and effort [N m or N] that increase through zero, straight
lines between; or a function of deflections (...) that returns efforts (...) and their slopes (...)."""

REACHED = 1e-12
"""Largest error of a deflection that a function's spring is solved for [rad or m]."""


def checked_springs(robot: Robot, springs: Mapping[str, Spring] | None) -> dict[int, Spring]:
    """Laws by index in q; tables as arrays of pairs.

    Raises:
        UnknownNameError: no such joint. InputError: a table does not increase, or has an effort at rest.
    """
    laws: dict[int, Spring] = {}
    for name, spring in (springs or {}).items():
        one_of("joint", name, robot.joint_names)
        laws[robot.joint_names.index(name)] = spring if callable(spring) else _pairs(name, spring)
    return laws


def spring_effort(law: Any, deflection: Array) -> tuple[Array, Array]:
    """Effort and slope (...) of a law at deflections (...); beyond a table's ends its last lines go on."""
    if callable(law):
        effort, slope = (np.asarray(x, float) for x in law(deflection))
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
    """Deflections of functions, all joints at once: their slopes are the only couplings."""
    if any(is_jax(effort) for effort in efforts.values()):
        raise InputError(
            f"springs of {', '.join(efforts)} are functions, which are solved in NumPy; give tables of pairs"
        )
    wanted = np.stack(np.broadcast_arrays(*efforts.values()), axis=-1)
    flat, names = wanted.reshape(-1, len(efforts)), list(efforts)

    def residual(x: Array, at: Array) -> tuple[Array, Array]:
        here = [spring_effort(laws[name], x[:, k]) for k, name in enumerate(names)]
        effort, slope = (np.stack(columns, axis=-1) for columns in zip(*here, strict=True))
        stiff = np.where(slope > 0, slope, np.nan)
        return (flat[at] - effort) / stiff, np.tile(np.eye(len(names)), (len(at), 1, 1))

    solved = newton(residual, np.zeros(flat.shape), REACHED)
    if not (solved.residual <= REACHED).all():
        left, _ = residual(solved.x, np.arange(len(flat)))
        sample, k = np.unravel_index(np.abs(np.nan_to_num(left, nan=np.inf)).argmax(), left.shape)
        raise NoSolutionError(
            f"{names[k]} carries {flat[sample, k]:.4g}, and its spring's function does not rise to it from "
            "rest; its slope must be positive"
        )
    return list(np.moveaxis(solved.x.reshape(wanted.shape), -1, 0))


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
