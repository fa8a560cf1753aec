"""The system's C and C++ compilers, and loops of compiled code over arrays."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Array = Any
FAST = ("-O3", "-march=native")


def compiler(plus_plus: bool = False) -> str | None:
    """The compiler's name; None where there is none."""
    names = ("g++", "clang++") if plus_plus else ("gcc", "clang", "cc")
    asked = os.environ.get("CXX" if plus_plus else "CC")
    return next((name for name in ([asked] if asked else names) if shutil.which(name)), None)


def compiled(source: Path, flags: Sequence[str], suffix: str = "") -> tuple[Path, float]:
    """A shared library beside its source, and how long it took [s].

    Raises:
        RuntimeError: the compiler's own words.
    """
    name = compiler(source.suffix == ".cpp")
    if name is None:
        raise RuntimeError("no compiler")
    library = source.with_name(f"{source.stem}{suffix}.so")
    begin = time.perf_counter()
    done = subprocess.run(
        [name, "-shared", "-fPIC", str(source), "-o", str(library), *flags], capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])
    return library, time.perf_counter() - begin


def pointer(array: Array) -> Any:
    """The address of a contiguous float64 array."""
    assert array.flags.c_contiguous
    assert array.dtype == np.float64
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


PAD = 8
"""Columns are so many numbers longer than the batch: powers of two would share their places in the cache."""


def over_columns(
    library: Path, rows: int, multiple: int = 1
) -> Callable[[Array], Callable[[], Array] | None]:
    """``loop(x, y, n, stride)`` of a library on samples in columns, x[i * stride + k].

    For inputs (B, inputs) it gives a function that computes outputs (B, rows); None where B is no multiple.
    """
    loop = ctypes.CDLL(str(library)).loop

    def prepared(x: Array) -> Callable[[], Array] | None:
        count = len(x)
        if count % multiple:
            return None
        stride = count + PAD
        columns, y = np.zeros((x.shape[1], stride)), np.zeros((rows, stride))
        columns[:, :count] = x.T
        arguments = pointer(columns), pointer(y), ctypes.c_long(count), ctypes.c_long(stride)

        def run() -> Array:
            loop(*arguments)
            return y[:, :count].T

        return run

    return prepared
