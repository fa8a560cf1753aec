"""Programs as plain Python for one sample, and as NumPy for a batch: what needs no compiler."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compiler.program import Operand, Program, kept_with

BLOCK = 4096
"""Samples that ``run_numpy`` computes together: many for what a call costs, few for the cache."""

_TEXT = {
    "add": "({} + {})",
    "sub": "({} - {})",
    "mul": "{} * {}",
    "neg": "-{}",
    "rcp": "(1.0 / {})",
    "lt": "({} < {})",
    "le": "({} <= {})",
    "and": "({} and {})",
    "or": "({} or {})",
    "not": "(not {})",
    "where": "({1} if {0} else {2})",
}


def source(program: Program) -> str:
    """A module with one function: flat sequences of floats in, one list of floats for every output.

    A value that is used once stands inside the expression that uses it, which saves the interpreter its name.
    """
    uses = Counter(x for step in program.steps for x in step.operands if isinstance(x, int))
    uses.update(x for x in program.results if isinstance(x, int))
    text: dict[int, str] = {}
    depth: dict[int, int] = {}
    lines = [repr(f"Made by screwkin from a screw table: {program.about}"), ""]
    lines += ["from math import atan2, cos, inf, nan, sin, sqrt", "", ""]
    lines.append(f"def {program.name}({', '.join(group.name for group in program.inputs)}):")
    at = 0
    for group in program.inputs:
        names = [f"v{at + k}" for k in range(group.size)]
        if names:
            lines.append(f"    ({', '.join(names)},) = {group.name}")
        text.update({at + k: name for k, name in enumerate(names)})
        at += group.size

    def written(x: Operand) -> str:
        return text[x] if isinstance(x, int) else repr(x)

    for k, step in enumerate(program.steps):
        operands = [written(x) for x in step.operands]
        form = _TEXT.get(step.operation, step.operation + "({}" + ", {}" * (len(operands) - 1) + ")")
        value, deep = (
            form.format(*operands),
            1 + max((depth.get(x, 0) for x in step.operands if isinstance(x, int)), default=0),
        )
        if uses[at + k] == 1 and deep < 20:
            text[at + k] = f"({value})" if step.operation in ("mul", "neg") else value
            depth[at + k] = deep
        else:
            lines.append(f"    v{at + k} = {value}")
            text[at + k] = f"v{at + k}"
    results = iter(program.results)
    lists = [f"[{', '.join(written(next(results)) for _ in range(group.size))}]" for group in program.outputs]
    lines.append(f"    return {', '.join(lists)}" + ("," if len(lists) == 1 else ""))
    return "\n".join(lines) + "\n"


_ARRAY: Mapping[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "neg": np.negative,
    "rcp": np.reciprocal,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan2": np.arctan2,
    "lt": np.less,
    "le": np.less_equal,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    "where": np.where,
}


def run_numpy(program: Program, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
    """Compute a batch, block by block: flat inputs (B, size) to flat outputs (B, size), which are filled."""
    calls, numbers = _calls(program)
    for begin in range(0, len(outputs[0]), BLOCK):
        here = slice(begin, begin + BLOCK)
        values: list[Any] = [row for array in inputs for row in np.ascontiguousarray(array[here].T)]
        values += [None] * len(calls) + numbers
        with np.errstate(all="ignore"):  # branches that are not chosen may divide by zero
            for value, (function, a, b, c, spent) in enumerate(calls, program.arity):
                if b is None:
                    values[value] = function(values[a])
                elif c is None:
                    values[value] = function(values[a], values[b])
                else:
                    values[value] = function(values[a], values[b], values[c])
                for place in spent:
                    values[place] = None
        results = iter(program.results)
        for array in outputs:
            for k in range(array.shape[1]):
                x = next(results)
                array[here, k] = values[x] if isinstance(x, int) else x


Call = tuple[Callable[..., Any], int, int | None, int | None, list[int]]
"""A function, the places of its operands, and the values that nothing needs after it."""


@kept_with
def _calls(program: Program) -> tuple[list[Call], list[float]]:
    """Every step as a call; what is spent makes room while its memory is warm. And the numbers.

    Places are those of the values, then of the numbers.
    """
    first = program.arity + len(program.steps)
    numbers: dict[str, int] = {}
    seen = {x for x in program.results if isinstance(x, int)}
    calls: list[Call] = []
    for step in reversed(program.steps):
        spent = [x for x in dict.fromkeys(step.operands) if isinstance(x, int) and x not in seen]
        seen.update(spent)
        a, *others = [
            x if isinstance(x, int) else first + numbers.setdefault(repr(x), len(numbers))
            for x in step.operands
        ]
        b, c, *_ = (*others, None, None)
        calls.append((_ARRAY[step.operation], a, b, c, spent))
    return calls[::-1], [float(text) for text in numbers]
