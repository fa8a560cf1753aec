"""The choice of a path: how a program is computed for so many samples on this computer.

All paths give the same numbers to rounding. Which is fastest was measured (docs/performance.md):
generated Python for a few samples, machine code for more where a C compiler is found, NumPy elsewhere.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np

from screwkin.files import atomic_path
from screwkin.kernel import emit_python, native
from screwkin.kernel.program import Program

Array = Any
Way = Literal["python", "numpy", "C"]

FROM = 1000
"""Samples from which callers make programs at all; for fewer, running the formulas themselves is quicker."""
PYTHON_UP_TO = 16
"""Samples up to which a loop of generated Python is faster than NumPy's calls."""
COMPILE_FROM = 10_000
"""Samples from which a program that was never compiled here is compiled: some seconds, once and for all."""


def run(
    program: Program,
    inputs: Mapping[str, Array],
    batch: tuple[int, ...] | None = None,
    path: Way | None = None,
) -> dict[str, Array]:
    """Compute a program for a batch.

    Args:
        program: from ``kernels``.
        inputs: every input by name, (..., *shape), float64 NumPy; batches broadcast.
        batch: shape of the batch; default: what the inputs broadcast to.
        path: how; default: the fastest for so many samples here.

    Returns:
        Every output by name, (*batch, *shape).
    """
    arrays = [np.asarray(inputs[group.name], dtype=float) for group in program.inputs]
    if batch is None:
        shapes = [a.shape[: a.ndim - len(g.shape)] for a, g in zip(arrays, program.inputs, strict=True)]
        batch = np.broadcast_shapes(*shapes)
    count = int(np.prod(batch))
    flat = [
        np.ascontiguousarray(np.broadcast_to(a, (*batch, *g.shape)).reshape(count, g.size))
        for a, g in zip(arrays, program.inputs, strict=True)
    ]
    filled = [np.empty((count, group.size)) for group in program.outputs]
    if count:
        _ways(program)[path or chosen_path(program, count)](flat, filled)
    return {g.name: a.reshape(*batch, *g.shape) for g, a in zip(program.outputs, filled, strict=True)}


def chosen_path(program: Program, count: int) -> Way:
    """The path that ``run`` takes for so many samples."""
    if native.compiler() and (count >= COMPILE_FROM or native.is_kept(program)) and machine_code(program):
        return "C"
    return "python" if count <= PYTHON_UP_TO else "numpy"


def large_batches() -> Way:
    """The path of large batches on this computer: C where a compiler is found, else NumPy."""
    return "C" if native.compiler() else "numpy"


@cache
def machine_code(program: Program) -> native.Native | None:
    """The compiled program, None where that is not possible."""
    return native.compiled(program)


@cache
def _ways(program: Program) -> Mapping[str, Callable[[Sequence[Array], Sequence[Array]], None]]:
    def by_numpy(inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        emit_python.run_numpy(program, inputs, outputs)

    def by_python(inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        function = python_function(program)
        for i, sample in enumerate(zip(*(array.tolist() for array in inputs), strict=True)):
            try:
                told = function(*sample)
            except (ArithmeticError, ValueError):  # by Python; other paths give infinity or NaN
                here = slice(i, i + 1)
                emit_python.run_numpy(program, [a[here] for a in inputs], [a[here] for a in outputs])
                continue
            for array, values in zip(outputs, told, strict=True):
                array[i] = values

    def by_c(inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        compiled = machine_code(program)
        assert compiled is not None
        compiled(inputs, outputs)

    return {"numpy": by_numpy, "python": by_python, "C": by_c}


@cache
def python_function(program: Program) -> Callable[..., Sequence[list[float]]]:
    """The generated Python function: flat sequences of floats in, a list of floats for every output.

    The module is written to the cache folder and imported from there.
    """
    text = emit_python.source(program)
    file = native.cache_folder() / f"{program.name}_{native.digest(text)[:16]}.py"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with atomic_path(file) as beside:
            beside.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"screwkin_kernel_{program.name}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made_function: Callable[..., Sequence[list[float]]] = getattr(module, program.name)
    return made_function
