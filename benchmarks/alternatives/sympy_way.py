"""sympy: the formulas on symbols, common subexpressions found by cse, code by lambdify or the C printer."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import sympy

from benchmarks.alternatives.elimination import solve
from benchmarks.alternatives.formulas import input_size, limb_works, unpacked
from benchmarks.alternatives.record import LANES, Array, Way, outputs, pivots_of
from benchmarks.compiler import FAST, compiled, over_columns
from screwkin.algebra.se3 import leaves, map_scalars
from screwkin.model.robot import Robot

Program = tuple[list[Any], list[tuple[Any, Any]], list[Any]]
"""Input symbols, assignments in order, outputs."""


def program(robot: Robot) -> Program:
    """W1 as straight-line assignments.

    Positions and Jacobians go through cse as whole expressions. The elimination runs on the names that cse
    gives, and every intermediate result gets a name of its own: as one expression it would explode.
    """
    x = list(sympy.symbols(f"x:{input_size(robot)}", real=True))
    works = limb_works(robot, *unpacked(robot, x))
    told: list[Any] = []
    for work in works:
        told += [*leaves(work.tip), *(a for row in work.A for a in row), *work.b]
    symbolic = [a for a in told if isinstance(a, sympy.Basic)]
    tape, reduced = sympy.cse(symbolic, symbols=sympy.numbered_symbols("c"), order="none")
    names = sympy.numbered_symbols("e")

    def keep(a: Any) -> Any:
        if not isinstance(a, sympy.Basic) or a.is_Atom:
            return a
        name = next(names)
        tape.append((name, a))
        return name

    following = iter(reduced)
    value = lambda a: next(following) if isinstance(a, sympy.Basic) else a  # noqa: E731
    rates, tips = [], []
    for work, pivots in zip(works, pivots_of(robot), strict=True):
        tips.append(map_scalars(value, work.tip))
        A = [[keep(value(a)) for a in row] for row in work.A]
        rates.append(solve(A, [keep(value(a)) for a in work.b], pivots, keep))
    flat = outputs(works, rates, len(robot.joints))
    count = 12 * len(works)
    return x, list(tape), [a for tip in tips for a in leaves(tip)] + flat[count:]


def _operations(made: Program) -> int:
    return sum(int(sympy.count_ops(a)) for a in [*(a for _, a in made[1]), *made[2]])


def _lambdified(made: Program, module: str) -> Callable[..., Any]:
    x, tape, out = made
    function: Callable[..., Any] = sympy.lambdify([x], out, modules=module, cse=lambda _: (tape, out))
    return function


def _by_numpy(made: Program) -> Callable[[Array], Callable[[], Array]]:
    function = _lambdified(made, "numpy")

    def prepared(x: Array) -> Callable[[], Array]:
        columns = list(np.ascontiguousarray(x.T))
        return lambda: np.stack(np.broadcast_arrays(*function(columns)), axis=1)

    return prepared


def _by_jax(made: Program) -> Callable[[Array], Callable[[], Array]]:
    import jax
    import jax.numpy as jnp

    function = _lambdified(made, "jax")
    compiled_function = jax.jit(lambda columns: jnp.stack(function(list(columns))))

    def prepared(x: Array) -> Callable[[], Array]:
        with jax.enable_x64(True):
            columns = jnp.asarray(np.ascontiguousarray(x.T))

        def run() -> Array:
            with jax.enable_x64(True):
                return np.asarray(compiled_function(columns)).T

        return run

    return prepared


def c_source(made: Program) -> str:
    """A loop over samples in columns, printed by sympy assignment by assignment.

    As C it computes one sample after the other, unless the compiler finds more; as C++ a register of them.
    """
    x, tape, out = made
    lines = [f"    const real {a} = load(&x[{i}*stride + k]);" for i, a in enumerate(x)]
    lines += [f"    const real {name} = {sympy.ccode(value)};" for name, value in tape]
    lines += [f"    store(&y[{i}*stride + k], {sympy.ccode(value)});" for i, value in enumerate(out)]
    return _FRAME.replace("LINES", "\n".join(lines))


_FRAME = """
#ifdef __cplusplus
#include "lanes.hpp"
typedef Many real;
#define EXTERN extern "C"
#else
#include <math.h>
typedef double real;
enum { LANES = 1 };
static inline double load(const double *x) { return *x; }
static inline void store(double *y, double value) { *y = value; }
#define EXTERN
#endif
EXTERN void loop(const double *x, double *y, long n, long stride) {
  #pragma omp simd
  for (long k = 0; k < n; k += LANES) {
LINES
  }
}
"""


SETTINGS = ("-ffast-math", "-ffast-math -fdisable-tree-sincos")
"""gcc joins sine and cosine of an angle into one call, which it cannot vectorise; the second undoes that."""


def ways(robot: Robot, folder: Path) -> list[Way]:
    """All ways that sympy offers, each built and timed once."""
    begin = time.perf_counter()
    made = program(robot)
    common = time.perf_counter() - begin
    count = _operations(made)
    begin = time.perf_counter()
    by_numpy = _by_numpy(made)
    ways_ = [Way("sympy, lambdify to NumPy", common + time.perf_counter() - begin, count, by_numpy)]
    begin = time.perf_counter()
    by_jax = _by_jax(made)
    ways_.append(Way("sympy, lambdify to JAX", common + time.perf_counter() - begin, count, by_jax))
    begin = time.perf_counter()
    source = folder / "w1_sympy.c"
    source.write_text(c_source(made))
    in_lanes = folder / "w1_sympy_lanes.cpp"
    in_lanes.write_text(c_source(made))
    shutil.copy(LANES, folder)
    printed = common + time.perf_counter() - begin
    rows = len(made[2])
    for told in ("", *SETTINGS):
        flags = [*FAST, *told.split(), "-fopenmp-simd", "-lmvec", "-lm"]
        library, took = compiled(source, flags, _suffix(told))
        name = " ".join(["sympy, C printer in a loop", *told.split()])
        ways_.append(Way(name, printed + took, count, over_columns(library, rows)))
    for told in ("", SETTINGS[0]):
        flags = [*FAST, *told.split(), "-lmvec", "-lm"]
        library, took = compiled(in_lanes, flags, _suffix(told))
        name = " ".join(["sympy, C printer on SIMD lanes", *told.split()])
        ways_.append(Way(name, printed + took, count, over_columns(library, rows, multiple=8)))
    return ways_


def _suffix(flags: str) -> str:
    return flags.replace(" ", "")
