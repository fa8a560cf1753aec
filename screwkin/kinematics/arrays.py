"""Arrays at the door: shapes, kinds and values checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import is_jax
from screwkin.compiler.run import common_batch
from screwkin.errors import ShapeError
from screwkin.kinematics.formula import axes
from screwkin.kinematics.rigid import foreign
from screwkin.model.robot import Robot
from screwkin.model.state import State


def checked(name: str, array: Any, *shape: int) -> Array:
    """The array as float64 NumPy or as JAX, with its trailing shape and its values checked.

    Raises:
        ShapeError: wrong trailing shape, NaN or infinity, or a float32 JAX array.
    """
    if is_jax(array):
        if array.dtype == np.float32:
            raise ShapeError(
                f'{name} is a float32 JAX array; switch on jax.config.update("jax_enable_x64", True)'
            )
    else:
        try:
            if array is None:
                raise TypeError("it is None")
            array = np.asarray(array, dtype=float)
        except (TypeError, ValueError) as error:
            raise ShapeError(f"{name} is not an array of numbers: {error}") from None
        if not np.isfinite(array).all():
            raise ShapeError(f"{name} holds NaN or infinity; every number must be finite")
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim < len(shape):
        wanted = ", ".join(["...", *map(str, shape)])
        raise ShapeError(f"{name} has shape {tuple(array.shape)}, expected ({wanted})")
    return array


def rigid(name: str, T: Array) -> Array:
    """Checked poses (..., 4, 4) that are rigid displacements; JAX arrays, perhaps traced, are taken as told.

    Raises:
        ShapeError: a matrix is no rigid displacement.
    """
    if is_jax(T):
        return T
    bad = foreign(T)
    if bad.any():
        sample = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ShapeError(
            f"{name} is not a rigid pose{f' in sample {sample}' if sample else ''}: expected an orthonormal, "
            "right-handed 3 x 3 rotation and the last row 0 0 0 1"
        )
    return T


Told = tuple[str, Any, int]
"""An argument: its name for messages, its value, and the size of its last axis."""


def told(robot: Robot, state: State, more: Mapping[str, Told] | None = None) -> dict[str, Array]:
    """The inputs of a formula by their names on its tape, checked: a state, and more.

    Raises:
        ShapeError: a wrong shape, NaN or infinity, a base pose that is not rigid, or batches that do not fit.
    """
    found = {
        "T_world_base": checked("state.T_world_base", state.T_world_base, 4, 4),
        "q": checked("state.q", state.q, len(robot.joints)),
    }
    names = {"T_world_base": "state.T_world_base", "q": "state.q"}
    for key, (name, value, size) in (more or {}).items():
        found[key], names[key] = checked(name, value, size), name
    one_batch({names[key]: (a, axes(key)) for key, a in found.items()})
    rigid("state.T_world_base", found["T_world_base"])
    return found


def or_rest(twist: Any) -> Any:
    """A twist or its derivative, zero where none is told."""
    return np.zeros(6) if twist is None else twist


def one_batch(arrays: Mapping[str, tuple[Array, int]]) -> tuple[int, ...]:
    """The batch to which arrays broadcast; each by its name for messages, with its number of other axes.

    Raises:
        ShapeError: there is none.
    """
    try:
        return common_batch(*zip(*arrays.values(), strict=True))
    except ValueError:
        batches = {name: a.shape[: a.ndim - inner] for name, (a, inner) in arrays.items()}
        each = " and of ".join(f"{name} {batch}" for name, batch in batches.items() if batch)
        raise ShapeError(f"batch of {each} do not broadcast") from None
