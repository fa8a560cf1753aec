"""CasADi: the formulas on SX scalars, run by its virtual machine or as the C code that it writes."""

from __future__ import annotations

import contextlib
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi
import numpy as np

from benchmarks.alternatives.elimination import solve
from benchmarks.alternatives.formulas import input_size, limb_works, unpacked
from benchmarks.alternatives.record import LANES, Array, Way, outputs, pivots_of
from benchmarks.compiler import FAST, compiled, over_columns
from screwkin.model.robot import Robot


class Node:
    """An SX scalar that takes part in formulas: operators give nodes again."""

    def __init__(self, x: Any) -> None:
        self.x = x

    def __add__(self, other: Any) -> Node:
        return Node(self.x + _sx(other))

    def __radd__(self, other: Any) -> Node:
        return Node(_sx(other) + self.x)

    def __sub__(self, other: Any) -> Node:
        return Node(self.x - _sx(other))

    def __rsub__(self, other: Any) -> Node:
        return Node(_sx(other) - self.x)

    def __mul__(self, other: Any) -> Node:
        return Node(self.x * _sx(other))

    def __rmul__(self, other: Any) -> Node:
        return Node(_sx(other) * self.x)

    def __truediv__(self, other: Any) -> Node:
        return Node(self.x / _sx(other))

    def __rtruediv__(self, other: Any) -> Node:
        return Node(_sx(other) / self.x)

    def __neg__(self) -> Node:
        return Node(-self.x)


def _sx(x: Any) -> Any:
    return x.x if isinstance(x, Node) else x


Node.__scalar_namespace__ = SimpleNamespace(  # type: ignore[attr-defined]
    sin=lambda a: Node(casadi.sin(_sx(a))),
    cos=lambda a: Node(casadi.cos(_sx(a))),
    sqrt=lambda a: Node(casadi.sqrt(_sx(a))),
    atan2=lambda a, b: Node(casadi.atan2(_sx(a), _sx(b))),
    where=lambda c, a, b: Node(casadi.if_else(_sx(c), _sx(a), _sx(b))),
)


def function(robot: Robot) -> Any:
    """W1 as a CasADi function of one input vector and one output vector."""
    x = casadi.SX.sym("x", input_size(robot))
    given = unpacked(robot, [Node(x[i]) for i in range(x.numel())])
    works = limb_works(robot, *given)
    rates = [solve(work.A, work.b, pivots) for work, pivots in zip(works, pivots_of(robot), strict=True)]
    out = casadi.vertcat(*(_sx(y) for y in outputs(works, rates, len(robot.joints))))
    return casadi.Function("w1", [x], [casadi.cse(out)])


def _operations(f: Any) -> int:
    """Instructions that compute: loads, stores and constants are none."""
    idle = (casadi.OP_CONST, casadi.OP_INPUT, casadi.OP_OUTPUT, casadi.OP_PARAMETER)
    return sum(f.instruction_id(k) not in idle for k in range(f.n_instructions()))


def _mapped(f: Any) -> Callable[[Array], Callable[[], Array]]:
    """CasADi's own loop over samples, through its buffers that copy nothing."""

    def prepared(x: Array) -> Callable[[], Array]:
        many = f.map(len(x)) if len(x) > 1 else f
        buffer, call = many.buffer()
        x, y = np.ascontiguousarray(x), np.empty((len(x), f.size1_out(0)))
        buffer.set_arg(0, memoryview(x))
        buffer.set_res(0, memoryview(y))

        def run(_held: Any = (many, buffer, x)) -> Array:
            call()
            return y

        return run

    return prepared


_LANES = """
#include "lanes.hpp"
#define casadi_real Many
#include "w1.c"
/* Samples in columns: x[i*stride + k]; n is a multiple of LANES. */
extern "C" void loop(const double *x, double *y, long n, long stride) {{
  Many in[{inputs}], out[{outputs}];
  const Many *arg[1] = {{in}}; Many *res[1] = {{out}};
  for (long k = 0; k < n; k += LANES) {{
    for (int i = 0; i < {inputs}; ++i) std::memcpy(&in[i], &x[i*stride + k], sizeof(Many));
    w1(arg, res, 0, 0, 0);
    for (int i = 0; i < {outputs}; ++i) std::memcpy(&y[i*stride + k], &out[i], sizeof(Many));
  }}
}}
"""
"""Written by hand around the generated function: CasADi itself computes one sample at a time."""


def ways(robot: Robot, folder: Path) -> list[Way]:
    """All ways that CasADi offers, each built and timed once."""
    begin = time.perf_counter()
    f = function(robot)
    seconds, count = time.perf_counter() - begin, _operations(f)
    made = [Way("CasADi, virtual machine", seconds, count, _mapped(f))]
    begin = time.perf_counter()
    with contextlib.chdir(folder):  # it writes into the working directory only
        f.generate("w1.c")
    seconds += time.perf_counter() - begin
    loop = folder / "w1_lanes.cpp"
    loop.write_text(_LANES.format(inputs=f.size1_in(0), outputs=f.size1_out(0)))
    shutil.copy(LANES, folder)
    for told, flags in (("", ()), (" -ffast-math", ("-ffast-math",))):
        library, took = compiled(folder / "w1.c", [*FAST, *flags], told.strip())
        external = casadi.external("w1", str(library))
        made.append(Way(f"CasADi, its C code and map{told}", seconds + took, count, _mapped(external)))
        library, took = compiled(loop, [*FAST, *flags, "-Wno-psabi", "-lmvec", "-lm"], told.strip())
        lanes = over_columns(library, f.size1_out(0), multiple=8)
        made.append(Way(f"CasADi, its C code on SIMD lanes{told}", seconds + took, count, lanes))
    return made
