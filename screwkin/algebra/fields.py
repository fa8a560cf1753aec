"""Fields of a record of arrays, checked one by one: what is wrong is collected, not raised."""

from __future__ import annotations

import json
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.files import read_json


def numbers_field(name: str, value: Any, shape: tuple[int, ...], faults: list[str]) -> Array:
    """A read-only float64 copy."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        faults.append(f"{name} has dtype {array.dtype}, expected float64")
    elif array.shape != shape:
        faults.append(f"{name} has shape {array.shape}, expected {shape}")
    elif not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        faults.append(f"{name} holds NaN or infinity, first in sample {row}")
    else:
        array = np.array(array, dtype=np.float64)
        array.flags.writeable = False
    return array


def flags_field(name: str, value: Any, shape: tuple[int, ...], faults: list[str]) -> NDArray[np.bool_]:
    """A read-only copy of flags."""
    array = np.array(value)
    if array.dtype != np.bool_:
        faults.append(f"{name} has dtype {array.dtype}, expected bool")
    elif array.shape != shape:
        faults.append(f"{name} has shape {array.shape}, expected {shape}")
    array.flags.writeable = False
    return array


def names_field(name: str, value: Any, faults: list[str]) -> tuple[str, ...]:
    """A row of names, each once."""
    array = np.asarray(value)
    if array.ndim != 1 or (array.size and array.dtype.kind != "U"):
        faults.append(f"{name} has dtype {array.dtype} and shape {array.shape}, expected a row of names")
        return ()
    names = tuple(array.tolist())
    if len(set(names)) < len(names):
        faults.append(f"{name} repeats a name: {', '.join(names)}")
    return names


def json_field(meta: Any, faults: list[str]) -> Mapping[str, Any]:
    """Read-only JSON data, as a file would give it back."""
    try:
        data = read_json(json.dumps(dict(meta), allow_nan=False))
    except (TypeError, ValueError, RecursionError) as error:
        faults.append(f"meta is not JSON data: {error}")
        data = {}
    return MappingProxyType(data)
