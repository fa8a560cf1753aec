"""Compiled programs as builtins of CPython: a call costs a fraction of what a foreign function's does.

``calls.c`` needs nothing but the stable ABIs of CPython and NumPy and a POSIX system. Elsewhere, and without
the GIL or a C compiler, there are no builtins, and ctypes calls.
"""

from __future__ import annotations

import ctypes
import struct
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.cache import digest
from screwkin.compiler.program import Group

MOST = 63
"""Arrays of a program that the builtins take."""
Batch = tuple[int, ...]
Allocate = Callable[[Batch], tuple[Array, ...]]
"""Arrays for all outputs of a batch."""


@cache
def source() -> str:
    """The builtins' C."""
    return Path(__file__).with_name("calls.c").read_text(encoding="utf-8")


def key() -> str:
    """What decides the builtins' machine code."""
    return digest(source(), sys.implementation.name)


def flags() -> tuple[str, ...]:
    """For the compiler: the interpreter defines what the builtins call."""
    return ("-pthread", *(("-undefined", "dynamic_lookup") if sys.platform == "darwin" else ()))


@cache
def possible() -> bool:
    """True on an interpreter whose builtins these can be, with arrays as ``calls.c`` reads them."""
    free = hasattr(sys, "_is_gil_enabled") and not sys._is_gil_enabled()
    if sys.implementation.name != "cpython" or free or sys.platform == "win32":
        return False
    return all(map(_as_declared, (np.zeros((2, 3)), np.zeros((5, 3, 2)).T, np.zeros(()))))


def _as_declared(x: Array) -> bool:
    """True if an array lies in memory as the struct ``array`` of ``calls.c`` says."""
    form = "nPPiPPPPi"
    fields = struct.unpack(form, ctypes.string_at(id(x), struct.calcsize(form)))
    _, kind, data, axes, shape, _, _, dtype, flags = fields
    known = (id(np.ndarray), x.ctypes.data, x.ndim, id(np.dtype(float)), x.flags.num)
    if (kind, data, axes, dtype, flags) != known:
        return False
    return tuple((ctypes.c_ssize_t * x.ndim).from_address(shape)) == x.shape if x.ndim else True


def call_plan(
    many: int,
    one: int,
    inputs: Sequence[Group],
    outputs: Sequence[Group],
    *,
    cores: int,
    shared_from: int,
    limit: float | None = None,
) -> bytes:
    """The struct ``plan`` of ``calls.c``.

    Args:
        many: address of the function of arrays.
        one: address of the same for one sample.
        inputs: arrays.
        outputs: arrays; without the guard.
        cores: processor cores that share large batches.
        shared_from: samples of a large batch.
        limit: of the guard, which is one more output; None: there is none.
    """
    every = (*inputs, *outputs)
    numbers = [cores, shared_from, limit is not None, len(inputs), len(outputs)]
    numbers += [group.size for group in every] + [len(group.shape) for group in every]
    numbers += [length for group in every for length in group.shape]
    return struct.pack(f"PPd{len(numbers)}n", many, one, limit or 0.0, *numbers)


def checked_call(
    method: Any, plan: bytes, outputs: Sequence[Group], allocate: Allocate
) -> Callable[..., Any]:
    """A function of arrays (*batch, *shape): a tuple of outputs, or None, see ``calls.c``."""
    shapes = tuple(group.shape for group in outputs)
    return _builtin(method(0), (plan, np.ndarray, np.dtype(float), float, np.empty, shapes, allocate))


def again(method: Any, plan: bytes, count: int, addresses: Sequence[int]) -> Any:
    """A function without arguments that computes so many samples of the arrays at these addresses."""
    places = struct.pack(f"{len(addresses)}P", *addresses)
    return _builtin(method(1), (plan, places, struct.pack("n", count)))


def _builtin(method: int, own: tuple[Any, ...]) -> Any:
    make = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    return make(("PyCFunction_NewEx", ctypes.pythonapi))(method, own, None)
