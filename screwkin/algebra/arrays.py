"""The type of arrays: NumPy arrays; where JAX arrays go in, JAX arrays come out."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]
"""An array of any shape, float64 unless a docstring says otherwise."""

Integers = np.ndarray[Any, np.dtype[np.int64]]
"""An array of integers."""

Booleans = np.ndarray[Any, np.dtype[np.bool_]]
"""An array of truth values."""


def numpy_of(*arrays: object) -> Any:
    """The module that computes with such arrays: ``jax.numpy`` if one is a JAX array, else ``numpy``."""
    jax = sys.modules.get("jax")
    if jax is None or not any(isinstance(array, jax.Array) for array in arrays):
        return np
    return importlib.import_module("jax.numpy")


def stretches(flags: Booleans) -> list[tuple[int, int]]:
    """First and one-past-last index of every run of True.

    Example:
        >>> stretches(np.array([True, True, False, True]))
        [(0, 2), (3, 4)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
