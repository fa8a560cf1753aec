"""Arrays at the door: shapes, kinds and values checked, then taken apart into scalars."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.errors import ShapeError
from screwkin.kernel.rigid import deviation
from screwkin.kernel.run import FROM
from screwkin.model.robot import Robot
from screwkin.model.state import RIGID, State, not_rigid
from screwkin.scalar import is_jax
from screwkin.se3 import NO_TWIST, Pose, Twist, pose_from_array, twist_from_array, unstack

Array = Any


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
    bad = not_rigid(T) if T.size < 16 * FROM else deviation(T) > RIGID
    if bad.any():
        sample = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ShapeError(
            f"{name} is not a rigid pose{f' in sample {sample}' if sample else ''}: expected an orthonormal, "
            "right-handed 3 x 3 rotation and the last row 0 0 0 1"
        )
    return T


def parts(robot: Robot, state: State) -> tuple[Pose, list[Any], tuple[int, ...]]:
    """Base pose, joint scalars and batch shape of a checked state."""
    T = checked("state.T_world_base", state.T_world_base, 4, 4)
    q = checked("state.q", state.q, len(robot.joints))
    try:
        batch = np.broadcast_shapes(T.shape[:-2], q.shape[:-1])
    except ValueError:
        raise ShapeError(
            f"batch of state.T_world_base {T.shape[:-2]} and of state.q {q.shape[:-1]} do not broadcast"
        ) from None
    return pose_from_array(rigid("state.T_world_base", T)), unstack(q), batch


def compiles(state: State, batch: tuple[int, ...]) -> bool:
    """True where a program computes rather than the formula itself: a large batch of NumPy arrays."""
    return not (is_jax(state.T_world_base) or is_jax(state.q)) and int(np.prod(batch)) >= FROM


def joint_scalars(robot: Robot, name: str, values: Any) -> list[Any]:
    """One scalar per joint from a checked (..., n) array."""
    return unstack(checked(name, values, len(robot.joints)))


def twist_of(name: str, value: Any) -> Twist:
    """A Twist from a checked (..., 6) array; None is rest."""
    return NO_TWIST if value is None else twist_from_array(checked(name, value, 6))
