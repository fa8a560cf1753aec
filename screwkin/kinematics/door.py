"""A program behind its checks: what every public function of arrays does, in as little time as can be.

The checks are a formula themselves, part of the program: one more output, the *guard*, tells whether all
inputs are finite and poses rigid. Only where it objects are the arrays read again, to say what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from struct import Struct
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, is_jax, where
from screwkin.compiler.memory import results
from screwkin.compiler.program import Group, Program, Recorder
from screwkin.compiler.run import compile_program, is_prepared, machine_code, python_function, run_rows
from screwkin.kinematics.arrays import Argument, checked_inputs, input_rows
from screwkin.kinematics.rigid import deviations
from screwkin.model.state import RIGID

FLOAT = np.dtype(float)
LIMIT = RIGID**2
"""Of the guard: sums of squares are larger than the square of their largest."""


class Door:
    """Calls of a program with arrays of any batch.

    Args:
        recorder: a recording with all outputs.
        arguments: its inputs, with what messages call them.

    Attributes:
        guarded: the program with the guard as one more output.
        names: of the other outputs.
    """

    def __init__(self, recorder: Recorder, arguments: Sequence[Argument]) -> None:
        by_name = {argument.name: argument for argument in arguments}
        self.arguments = tuple(by_name[group.name] for group in recorder.inputs)
        recorder.output("guard", [_guard(recorder, self.arguments)])
        self.guarded = recorder.program()
        *outputs, _ = self.guarded.outputs
        self.names = [group.name for group in outputs]
        self._inputs, self._outputs = _layouts(self.guarded.inputs), _layouts(outputs)
        self._recorder = recorder

    @cached_property
    def program(self) -> Program:
        """The program as recorded, without the guard."""
        return self._recorder.program(len(self.names))

    def prepare(self) -> Door:
        """Compile the program, if there is a compiler; later calls use machine code."""
        compile_program(self.guarded)
        return self

    def __call__(self, arrays: Sequence[Any]) -> Sequence[Array]:
        """Every output (*batch, *shape), from the inputs in their order.

        Raises:
            ShapeError: a wrong shape, NaN or infinity, a pose that is not rigid, or batches that do not fit.
        """
        found = self.by_machine(*arrays) if is_prepared(self.guarded) else self._one_sample(arrays)
        if found is not None:
            return found
        if any(map(is_jax, arrays)):
            return self._by_jax(arrays)
        rows, batch = input_rows(self.arguments, arrays)
        if is_prepared(self.guarded):  # batches that broadcast, or arrays of another kind
            whole = [x.reshape(*batch, *s) for x, (s, _) in zip(rows, self._inputs, strict=True)]
            found = self.by_machine(*whole)
            if found is not None:
                return found
        *outputs, guard = run_rows(self.guarded, rows, math.prod(batch))
        if not (guard <= LIMIT).all():
            checked_inputs(self.arguments, arrays)
        return [x.reshape(*batch, *s) for x, (s, _) in zip(outputs, self._outputs, strict=True)]

    def batch(self, arrays: Sequence[Any]) -> tuple[int, ...] | None:
        """The batch of C-contiguous float64 arrays that have one and the same; None of any others."""
        batch: tuple[int, ...] | None = None
        for array, (shape, _) in zip(arrays, self._inputs, strict=True):
            if type(array) is not np.ndarray or array.dtype is not FLOAT or not array.flags.c_contiguous:
                return None
            axes = array.ndim - len(shape)
            own = array.shape
            if axes < 0 or own[axes:] != shape:
                return None
            if batch is None:
                batch = own[:axes]
            elif own[:axes] != batch:
                return None
        return batch

    @cached_property
    def by_machine(self) -> Callable[..., tuple[Array, ...] | None]:
        """Machine code that reads plain arrays where they are; None where the general way has to look."""
        native = machine_code(self.guarded)
        return (lambda *arrays: None) if native is None else native.checked(LIMIT, self._empty)

    def _empty(self, batch: tuple[int, ...]) -> tuple[Array, ...]:
        return results(batch, [shape for shape, _ in self._outputs])

    @cached_property
    def _python(self) -> Callable[..., Sequence[list[float]]]:
        return python_function(self.guarded)

    def _one_sample(self, arrays: Sequence[Any]) -> list[Array] | None:
        """One sample by generated Python; None if it is not one, or if anything about it is doubtful."""
        rows: list[Any] = []
        try:
            for array, (shape, layout) in zip(arrays, self._inputs, strict=True):
                if type(array) is np.ndarray and array.dtype is FLOAT and array.shape == shape:
                    rows.append(layout.unpack(array))
                elif type(array) is float and not shape:
                    rows.append((array,))
                else:
                    return None
            *outputs, (guard,) = self._python(*rows)
        except (ArithmeticError, ValueError):  # not contiguous; or by Python: others give infinity or NaN
            return None
        if not guard <= LIMIT:
            return None
        found = []
        for values, (shape, layout) in zip(outputs, self._outputs, strict=True):
            array = np.empty(shape)
            layout.pack_into(array, 0, *values)  # in half of the time that np.array takes
            found.append(array)
        return found

    def _by_jax(self, arrays: Sequence[Any]) -> list[Any]:
        from screwkin.compiler import xla_call

        inputs, _ = checked_inputs(self.arguments, arrays)
        named = {a.name: x for a, x in zip(self.arguments, inputs, strict=True)}
        found = xla_call.run(self.program, named)
        return [found[name] for name in self.names]


def _layouts(groups: Sequence[Group]) -> list[tuple[tuple[int, ...], Any]]:
    """Shape and packed layout of every array."""
    return [(group.shape, Struct(f"{group.size}d")) for group in groups]


def _guard(recorder: Recorder, arguments: Sequence[Argument]) -> Scalar:
    """0 where all inputs are finite and poses rigid; else how far a pose is from one, or infinity.

    Of a pose the sum of the squares of all deviations, which takes fewer operations than the largest of them.
    """
    total: Scalar = 0
    squares: Scalar = 0.0
    for argument in arguments:
        scalars = recorder.shared(argument.name, *argument.shape)
        if argument.rigid:
            for entry in deviations(scalars):
                squares = squares + entry * entry
            scalars = scalars[3:12:4]
        for x in scalars:
            total = total + x
    if isinstance(total, int):  # no inputs
        return 0.0
    return where((total < math.inf) & (total > -math.inf), squares, math.inf)
