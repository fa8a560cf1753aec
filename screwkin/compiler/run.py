"""The choice of a path: how a program is computed for so many samples on this computer.

All paths give the same numbers to rounding. The rule is static: generated Python for a few samples, NumPy for
more, machine code for programs that were prepared. Neither what was asked before nor a cache decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compiler import emit_python, native
from screwkin.compiler.program import Program, kept_with

Way = Literal["python", "numpy", "C"]

PYTHON_UP_TO = 100
"""Samples up to which a loop of generated Python is faster than NumPy's calls."""


def run(
    program: Program,
    inputs: Mapping[str, Array],
    batch: tuple[int, ...] | None = None,
    path: Way | None = None,
) -> dict[str, Array]:
    """Compute a program for a batch.

    Args:
        program: from a recorder.
        inputs: every input by name, (..., *shape), float64 NumPy; batches broadcast.
        batch: shape of the batch; default: what the inputs broadcast to.
        path: how; default: see ``chosen_path``.

    Returns:
        Every output by name, (*batch, *shape).
    """
    arrays = [np.asarray(inputs[group.name], dtype=float) for group in program.inputs]
    if batch is None:
        batch = common_batch(arrays, [len(group.shape) for group in program.inputs])
    rows = [as_rows(a, batch, group.shape) for a, group in zip(arrays, program.inputs, strict=True)]
    filled = run_rows(program, rows, math.prod(batch), path)
    return {g.name: a.reshape(*batch, *g.shape) for g, a in zip(program.outputs, filled, strict=True)}


def run_rows(program: Program, rows: Sequence[Array], count: int, path: Way | None = None) -> list[Array]:
    """Outputs as rows (count, size) from inputs as C-contiguous rows (count, size); see ``run``."""
    filled = [np.empty((count, group.size)) for group in program.outputs]
    if count:
        _ways(program)[path or chosen_path(program, count)](rows, filled)
    return filled


def common_batch(arrays: Iterable[Any], inner: Iterable[int]) -> tuple[int, ...]:
    """The shape to which the batches of arrays broadcast, each in front of so many inner axes.

    Raises:
        ValueError: there is none.
    """
    first, *others = [a.shape[: a.ndim - axes] for a, axes in zip(arrays, inner, strict=True)]
    return first if all(shape == first for shape in others) else np.broadcast_shapes(first, *others)


def as_rows(array: Array, batch: tuple[int, ...], shape: tuple[int, ...]) -> Array:
    """An array that broadcasts to (*batch, *shape) as C-contiguous rows (count, size)."""
    wanted = (*batch, *shape)
    whole = array if array.shape == wanted else np.broadcast_to(array, wanted)
    rows = whole.reshape(math.prod(batch), math.prod(shape))
    return rows if rows.flags.c_contiguous else np.ascontiguousarray(rows)


_PREPARED = "prepared"


def chosen_path(program: Program, count: int) -> Way:
    """The path that ``run`` takes: a static rule of the samples, and of what was prepared."""
    if is_prepared(program):
        return "C"
    return "python" if count <= PYTHON_UP_TO else "numpy"


def is_prepared(program: Program) -> bool:
    """True if machine code was asked for and is there."""
    return bool(program.memo.get(_PREPARED))


def compile_program(program: Program) -> bool:
    """Compile a program: from now on ``run`` takes machine code. False where there is no compiler."""
    program.memo[_PREPARED] = machine_code(program) is not None
    return is_prepared(program)


def large_batches() -> Way:
    """The path of bound and prepared functions on this computer: C where a compiler is found, else NumPy."""
    return "C" if native.compiler() else "numpy"


@kept_with
def machine_code(program: Program) -> native.Native | None:
    """The compiled program, None where that is not possible."""
    return native.compiled(program)


@kept_with
def _ways(program: Program) -> Mapping[str, Callable[[Sequence[Array], Sequence[Array]], None]]:
    def by_numpy(inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        emit_python.run_numpy(program, inputs, outputs)

    def by_python(inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        function = python_function(program)
        for i, sample in enumerate(zip(*(array.tolist() for array in inputs), strict=True)):
            try:
                answer = function(*sample)
            except (ArithmeticError, ValueError):  # by Python; other paths give infinity or NaN
                here = slice(i, i + 1)
                emit_python.run_numpy(program, [a[here] for a in inputs], [a[here] for a in outputs])
                continue
            for array, values in zip(outputs, answer, strict=True):
                array[i] = values

    def by_c(inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        compiled = machine_code(program)
        assert compiled is not None
        compiled(inputs, outputs)

    return {"numpy": by_numpy, "python": by_python, "C": by_c}


@kept_with
def python_function(program: Program) -> Callable[..., Sequence[list[float]]]:
    """The generated Python function: flat sequences of floats in, a list of floats for every output."""
    names: dict[str, Any] = {}
    exec(compile(emit_python.source(program), f"<{program.name}>", "exec"), names)  # noqa: S102
    made: Callable[..., Sequence[list[float]]] = names[program.name]
    return made
