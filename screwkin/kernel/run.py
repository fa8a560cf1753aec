"""The choice of a path: how a program is computed for so many samples on this computer.

All paths give the same numbers to rounding. Which is fastest was measured (docs/performance.md):
generated Python for a few samples, machine code for more where a C compiler is found, NumPy elsewhere.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any, Literal
from weakref import WeakKeyDictionary

import numpy as np

from screwkin.kernel import emit_python, native
from screwkin.kernel.program import Group, Program, kept, kept_with
from screwkin.model.robot import Robot
from screwkin.scalar import is_symbolic
from screwkin.se3 import leaves

Array = Any
Way = Literal["python", "numpy", "C"]

FROM = 1000
"""Samples of a motion, or of JAX arrays, from which a program is made at once."""
CALLS = 8
"""Calls after which a program is made: so many take as long. A thousand samples count as one more."""
PYTHON_UP_TO = 100
"""Samples up to which a loop of generated Python is faster than NumPy's calls."""
COMPILE_AFTER = 10
"""Samples for every operation after which a program is compiled: some seconds, once on a computer."""


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
        batch = common_batch(arrays, [len(group.shape) for group in program.inputs])
    count = math.prod(batch)
    flat = [_flat(a, batch, count, g) for a, g in zip(arrays, program.inputs, strict=True)]
    filled = [np.empty((count, group.size)) for group in program.outputs]
    if count:
        _ways(program)[path or chosen_path(program, count)](flat, filled)
        if count > PYTHON_UP_TO:
            program.memo[_SAMPLES] = program.memo.get(_SAMPLES, 0) + count
    return {g.name: a.reshape(*batch, *g.shape) for g, a in zip(program.outputs, filled, strict=True)}


def common_batch(arrays: Iterable[Any], inner: Iterable[int]) -> tuple[int, ...]:
    """The shape to which the batches of arrays broadcast, each in front of so many inner axes.

    Raises:
        ValueError: there is none.
    """
    first, *others = [a.shape[: a.ndim - axes] for a, axes in zip(arrays, inner, strict=True)]
    return first if all(shape == first for shape in others) else np.broadcast_shapes(first, *others)


def _flat(array: Array, batch: tuple[int, ...], count: int, group: Group) -> Array:
    """An input as C-contiguous rows (count, size)."""
    shape = (*batch, *group.shape)
    whole = array if array.shape == shape else np.broadcast_to(array, shape)
    rows = whole.reshape(count, group.size)
    return rows if rows.flags.c_contiguous else np.ascontiguousarray(rows)


_asked: WeakKeyDictionary[Robot, Counter[Hashable]] = WeakKeyDictionary()
_SAMPLES = "samples"


def pays(what: Hashable, robot: Robot, *about: Hashable, count: int) -> bool:
    """True if a program is worth making: for a very large batch, or as the robot has been asked before.

    A search over many robots, each asked a few times, makes none; a loop over the samples of one robot does.
    A robot of symbols has none.

    Args:
        what: names the program, with the robot and what else decides it.
        robot: the robot.
        about: the rest.
        count: samples of this call.
    """
    calls = _asked.get(robot)
    if calls is None:
        calls = _asked.setdefault(robot, Counter())
    calls[what, about] += 1 + count // FROM
    return calls[what, about] >= CALLS and not _is_symbolic(robot)


@kept
def _is_symbolic(robot: Robot) -> bool:
    records = [x for link in robot.links for x in (link.com, link.inertia, link.frame)]
    records += [x for joint in robot.joints for x in (joint.screw.s, joint.screw.s0)]
    records += [limb.frame for limb in robot.limbs]
    scalars = [leaf for record in records for leaf in leaves(record)]
    scalars += [link.mass for link in robot.links] + [joint.screw.pitch for joint in robot.joints]
    return any(map(is_symbolic, scalars))


def chosen_path(program: Program, count: int) -> Way:
    """The path that ``run`` takes for so many samples, with those that it was asked for before."""
    asked = program.memo.get(_SAMPLES, 0) + count
    worth = count > PYTHON_UP_TO and asked >= COMPILE_AFTER * program.operations
    if (worth or _is_kept(program)) and machine_code(program):
        return "C"
    return "python" if count <= PYTHON_UP_TO else "numpy"


def large_batches() -> Way:
    """The path of large batches on this computer: C where a compiler is found, else NumPy."""
    return "C" if native.compiler() else "numpy"


@kept_with
def machine_code(program: Program) -> native.Native | None:
    """The compiled program, None where that is not possible."""
    made = native.compiled(program)
    program.memo[_is_kept] = made is not None
    return made


def _is_kept(program: Program) -> bool:
    """As ``native.is_kept``, asked once: the file system's answer takes longer than a sample."""
    if _is_kept not in program.memo:
        program.memo[_is_kept] = native.is_kept(program)
    return bool(program.memo[_is_kept])


@kept_with
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


@kept_with
def python_function(program: Program) -> Callable[..., Sequence[list[float]]]:
    """The generated Python function: flat sequences of floats in, a list of floats for every output."""
    names: dict[str, Any] = {}
    exec(compile(emit_python.source(program), f"<{program.name}>", "exec"), names)  # noqa: S102
    made: Callable[..., Sequence[list[float]]] = names[program.name]
    return made
