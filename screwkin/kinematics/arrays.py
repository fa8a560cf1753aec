"""Arrays at the door: shapes, kinds and values checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import is_jax
from screwkin.compiler.run import as_rows, common_batch
from screwkin.errors import ShapeError
from screwkin.kinematics.rigid import foreign, nearest_poses
from screwkin.model.state import RIGID

SHORT = ("float16", "bfloat16", "float32")
"""Floats with too few digits for positions: refused, not converted silently."""


@dataclass(frozen=True, eq=False)
class Argument:
    """An array that a program takes.

    Attributes:
        name: in the program.
        label: in messages.
        shape: its trailing shape.
        rigid: it is a pose.
        of: what it is about, where it is one of several.
    """

    name: str
    label: str
    shape: tuple[int, ...]
    rigid: bool = False
    of: str = ""


def input_rows(arguments: Sequence[Argument], arrays: Sequence[Any]) -> tuple[list[Array], tuple[int, ...]]:
    """Arrays as C-contiguous rows (count, size) of their common batch, whatever their values; and the batch.

    Raises:
        ShapeError: a wrong shape or kind, or batches that do not fit.
    """
    shaped = [of_shape(a.label, array, *a.shape) for a, array in zip(arguments, arrays, strict=True)]
    batch = one_batch({a.label: (x, len(a.shape)) for a, x in zip(arguments, shaped, strict=True)})
    return [as_rows(x, batch, a.shape) for a, x in zip(arguments, shaped, strict=True)], batch


def checked_inputs(
    arguments: Sequence[Argument], arrays: Sequence[Any]
) -> tuple[list[Array], tuple[int, ...]]:
    """The arrays, checked in every respect, and their common batch.

    Raises:
        ShapeError: a wrong shape, NaN or infinity, a pose that is not rigid, or batches that do not fit.
    """
    found = [checked(a.label, array, *a.shape) for a, array in zip(arguments, arrays, strict=True)]
    batch = one_batch({a.label: (x, len(a.shape)) for a, x in zip(arguments, found, strict=True)})
    for argument, array in zip(arguments, found, strict=True):
        if argument.rigid:
            check_rigid(argument.label, array)
    return found, batch


def checked(name: str, array: Any, *shape: int) -> Array:
    """The array as float64 NumPy or as JAX, with its trailing shape and its values checked.

    Raises:
        ShapeError: wrong trailing shape, NaN or infinity, or JAX floats of less than 64 bits.
    """
    array = of_shape(name, array, *shape)
    if not is_jax(array) and not np.isfinite(array).all():
        raise ShapeError(f"{name} holds NaN or infinity; every number must be finite")
    return array


def of_shape(name: str, array: Any, *shape: int) -> Array:
    """The array as float64 NumPy or as JAX, with its trailing shape checked.

    Raises:
        ShapeError: wrong trailing shape, no array of numbers, or floats of less than 64 bits.
    """
    if is_jax(array):
        if array.dtype.name in SHORT:
            raise ShapeError(
                f'{name} is a {array.dtype} JAX array; switch on jax.config.update("jax_enable_x64", True)'
            )
    elif type(array) is not np.ndarray or array.dtype != float:
        try:
            if array is None:
                raise TypeError("it is None")
            if getattr(array, "dtype", None) is not None and array.dtype.name in SHORT:
                raise ShapeError(
                    f"{name} is a {array.dtype} array; convert it by .astype(float): it has too few digits"
                )
            array = np.asarray(array, dtype=float)
        except (TypeError, ValueError) as error:
            if isinstance(error, ShapeError):
                raise
            raise ShapeError(f"{name} is not an array of numbers: {error}") from None
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim < len(shape):
        wanted = ", ".join(["...", *map(str, shape)])
        raise ShapeError(f"{name} has shape {tuple(array.shape)}, expected ({wanted})")
    return array


def check_rigid(name: str, T: Array) -> Array:
    """Checked poses (..., 4, 4) that are rigid displacements; JAX arrays, perhaps traced, are not read.

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


def exact_target(name: str, target: Array) -> Array:
    """A checked target (..., 4, 4) or (..., 3), its rotation made exact to the last digit if it is a pose.

    Raises:
        ShapeError: a matrix is no rigid displacement.
    """
    if target.shape[-2:] != (4, 4):
        return target
    deviation, poses = nearest_poses(target)
    return check_rigid(name, target) if deviation.size and deviation.max() > RIGID else poses


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
