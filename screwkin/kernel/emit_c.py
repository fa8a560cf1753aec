"""Programs as self-contained C99: no allocation, no dependency but the square root, double or float.

A program becomes one function over samples. It works on tiles of a few samples whose scalars lie side by
side, so that a compiler turns the straight-line body into vector instructions by itself. The caller's arrays
hold sample after sample; a single sample is computed where it lies.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Literal

from screwkin.kernel.program import Group, Operand, Program, Step
from screwkin.kernel.series import ARC, COSINE, QUARTER_TURN, SINE

Real = Literal["double", "float"]

TILE = 16
"""Samples in a tile: some vectors of doubles, and a working set that stays in the first-level cache."""

_INFIX = {"add": "+", "sub": "-", "mul": "*", "lt": "<", "le": "<=", "and": "&", "or": "|"}


def header(programs: Sequence[Program], guard: str, real: Real) -> str:
    """The header: how to call every function."""
    parts = [
        "/* Made by screwkin from a screw table. Units are SI, angles in rad. */",
        f"#ifndef {guard}\n#define {guard}\n",
        "#include <stddef.h>\n",
        f"typedef {real} screwkin_real;\n",
    ]
    parts += [_comment(program) + _prototype(program) + ";\n" for program in programs]
    return "\n".join([*parts, f"#endif /* {guard} */\n"])


def source(programs: Sequence[Program], include: str | None) -> str:
    """The definitions, to stand beside the header ``include``, or below its text if None."""
    above = f'#include "{include}"\n' if include else ""
    return "\n".join([f"{above}#include <math.h>\n", _prelude(), *(_function(p) for p in programs)])


def _comment(program: Program) -> str:
    def listed(groups: Sequence[Group]) -> str:
        return ", ".join(f"{g.name} ({' x '.join(map(str, g.shape)) or '1'})" for g in groups)

    text = f"""{program.about}
In, one after the other for every sample, row by row: {listed(program.inputs)}.
Out: {listed(program.outputs)}. {program.operations} operations a sample."""
    lines = [line for part in text.splitlines() for line in textwrap.wrap(part, 110)]
    return "/* " + "\n   ".join(lines) + " */\n"


def _prototype(program: Program) -> str:
    arguments = [f"const screwkin_real *{group.name}" for group in program.inputs]
    arguments += [f"screwkin_real *{group.name}" for group in program.outputs]
    return f"void {program.name}(size_t samples,\n    " + ",\n    ".join(arguments) + ")"


def _number(x: float) -> str:
    if math.isfinite(x):
        return f"R({x!r})"
    return "R(NAN)" if math.isnan(x) else "R(INFINITY)" if x > 0 else "R(-INFINITY)"


def _horner(coefficients: Sequence[float], variable: str) -> str:
    text = _number(coefficients[-1])
    for c in reversed(coefficients[:-1]):
        text = f"({text} * {variable} + {_number(c)})"
    return text


def _prelude() -> str:
    a, b, c = map(_number, QUARTER_TURN)
    return f"""typedef screwkin_real real;
#define R(x) ((real)(x))
#define TILE {TILE}
#define SINGLE (sizeof(real) == sizeof(float))
#define FLOOR(x) (SINGLE ? (real)floorf((float)(x)) : (real)floor((double)(x)))
#define SQRT(x) (SINGLE ? (real)sqrtf((float)(x)) : (real)sqrt((double)(x)))
#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline, unused))
#else
#define INLINE static inline
#endif

/* Between rows, sample after sample, and a tile, scalar after scalar: two by two, with vectors of two where
   there are such, which halves the loads and stores. */
#if defined(__SSE2__) || defined(__aarch64__)
typedef real pair __attribute__((vector_size(2 * sizeof(real)), aligned(sizeof(real)), may_alias));
#define TURN(from, below, to, under) \\
    const pair a = *(const pair *)(from), b = *(const pair *)(below); \\
    *(pair *)(to) = (pair){{a[0], b[0]}}, *(pair *)(under) = (pair){{a[1], b[1]}};
#else
#define TURN(from, below, to, under) \\
    (to)[0] = (from)[0], (to)[1] = (below)[0], (under)[0] = (from)[1], (under)[1] = (below)[1];
#endif

INLINE void take(real *restrict tile, const real *restrict rows, size_t size, size_t used, size_t count)
{{
    size_t k = 0;
    for (; count == TILE && k + 1 < used; k += 2)
        for (size_t i = 0; i < TILE; i += 2) {{
            const real *row = rows + i * size + k;
            real *column = tile + k * TILE + i;
            TURN(row, row + size, column, column + TILE)
        }}
    for (; k < used; ++k)
        for (size_t i = 0; i < TILE; ++i)
            tile[k * TILE + i] = rows[(i < count ? i : count - 1) * size + k];
}}

INLINE void give(real *restrict rows, const real *restrict tile, size_t size, size_t count)
{{
    size_t k = 0;
    for (; count == TILE && k + 1 < size; k += 2)
        for (size_t i = 0; i < TILE; i += 2) {{
            const real *column = tile + k * TILE + i;
            real *row = rows + i * size + k;
            TURN(column, column + TILE, row, row + size)
        }}
    for (; k < size; ++k)
        for (size_t i = 0; i < count; ++i)
            rows[i * size + k] = tile[k * TILE + i];
}}

/* Sine and cosine: the angle less whole quarter turns, then two polynomials. */
INLINE void sine_cosine(real x, real *s, real *c)
{{
    const real k = FLOOR(x * R({2 / math.pi!r}) + R(0.5));
    const real r = ((x - k * {a}) - k * {b}) - k * {c}, u = r * r;
    const real sine = r + r * u * {_horner(SINE, "u")};
    const real cosine = R(1) - R(0.5) * u + u * u * {_horner(COSINE, "u")};
    const real quarter = k - R(4) * FLOOR(k * R(0.25));
    const real odd = quarter - R(2) * FLOOR(quarter * R(0.5));
    const real first = odd > R(0.5) ? cosine : sine, second = odd > R(0.5) ? sine : cosine;
    *s = quarter > R(1.5) ? -first : first;
    *c = (quarter > R(0.5)) & (quarter < R(2.5)) ? -second : second;
}}

/* Angle of the point (x, y): the arc tangent of the smaller over the larger, and where the point lies. */
INLINE real angle(real y, real x)
{{
    const real ax = x < R(0) ? -x : x, ay = y < R(0) ? -y : y;
    const real large = ax < ay ? ay : ax, small = ax < ay ? ax : ay;
    const real t = small / (large > R(0) ? large : R(1));
    const real steep = t > R({math.tan(math.pi / 8)!r}) ? R(1) : R(0);
    const real z = (t - steep) / (R(1) + steep * t), u = z * z;
    const real arc = z + z * u * {_horner(ARC, "u")} + steep * R({math.pi / 4!r});
    const real turned = ax < ay ? R({math.pi / 2!r}) - arc : arc;
    const real half = x < R(0) ? R({math.pi!r}) - turned : turned;
    return y < R(0) ? -half : half;
}}
"""


def _function(program: Program) -> str:
    name, read = program.name, _read(program)
    inputs = [group for group in program.inputs if group.name in read]
    groups = [*inputs, *program.outputs]
    takes = [f"const real *restrict {g.name}" for g in inputs]
    takes += [f"real *restrict {g.name}" for g in program.outputs]
    arguments, body = ", ".join(takes), "\n".join(f"    {line}" for line in _statements(program))
    one = ", ".join(g.name for g in groups)
    tile = ", ".join(f"{g.name}_tile" for g in groups)
    lane = ", ".join(f"{g.name} + i" for g in groups)
    spare = "".join(f"    (void){g.name};\n" for g in program.inputs if g.name not in read)
    buffers = "\n".join(f"    real {g.name}_tile[{g.size} * TILE];" for g in groups)
    loads = "\n".join(
        f"        take({g.name}_tile, {g.name} + first * {g.size}, {g.size}, {max(read[g.name]) + 1}, count);"
        for g in inputs
    )
    stores = "\n".join(
        f"        give({g.name} + first * {g.size}, {g.name}_tile, {g.size}, count);" for g in program.outputs
    )
    return f"""INLINE void {name}_sample({arguments}, const size_t w)
{{
{body}
}}

static void {name}_lanes({arguments})
{{
    for (size_t i = 0; i < TILE; ++i)
        {name}_sample({lane}, TILE);
}}

{_prototype(program)}
{{
{spare}{buffers}
    if (samples == 1) {{
        {name}_sample({one}, 1);
        return;
    }}
    for (size_t first = 0; first < samples; first += TILE) {{
        const size_t count = samples - first < TILE ? samples - first : TILE;
{loads}
        {name}_lanes({tile});
{stores}
    }}
}}
"""


def _read(program: Program) -> dict[str, list[int]]:
    """Which scalars of every input group the program reads; groups of which it reads none are left out."""
    used = {x for step in program.steps for x in step.operands if isinstance(x, int)}
    used |= {x for x in program.results if isinstance(x, int)}
    read, at = {}, 0
    for group in program.inputs:
        here = [k for k in range(group.size) if at + k in used]
        if here:
            read[group.name] = here
        at += group.size
    return read


def _statements(program: Program) -> list[str]:
    lines, at = [], 0
    read = _read(program)
    for group in program.inputs:
        lines += [f"const real v{at + k} = {group.name}[{k} * w];" for k in read.get(group.name, ())]
        at += group.size
    turned: dict[Operand, int] = {}
    for k, step in enumerate(program.steps):
        lines += _statement(at + k, step, turned)
    results = iter(program.results)
    for group in program.outputs:
        lines += [f"{group.name}[{k} * w] = {_operand(next(results))};" for k in range(group.size)]
    return lines


def _operand(x: Operand) -> str:
    return f"v{x}" if isinstance(x, int) else _number(x)


def _statement(value: int, step: Step, turned: dict[Operand, int]) -> list[str]:
    operation, (first, *rest) = step.operation, step.operands
    a = _operand(first)
    if operation in ("sin", "cos"):
        lines = []
        if first not in turned:
            turned[first] = value
            lines = [f"real s{value}, c{value};", f"sine_cosine({a}, &s{value}, &c{value});"]
        return [*lines, f"const real v{value} = {operation[0]}{turned[first]};"]
    b = _operand(rest[0]) if rest else ""
    if operation in _INFIX:
        kind = "int" if operation in ("lt", "le", "and", "or") else "real"
        return [f"const {kind} v{value} = {a} {_INFIX[operation]} {b};"]
    told = {
        "neg": f"-{a}",
        "rcp": f"R(1) / {a}",
        "sqrt": f"SQRT({a})",
        "atan2": f"angle({a}, {b})",
        "not": f"!{a}",
        "where": f"{a} ? {b} : {_operand(rest[1]) if len(rest) > 1 else ''}",
    }[operation]
    return [f"const {'int' if operation == 'not' else 'real'} v{value} = {told};"]
