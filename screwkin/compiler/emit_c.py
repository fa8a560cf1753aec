"""Programs as self-contained C99: no allocation, no dependency but the square root, double or float.

A program becomes one function over samples, whose arrays hold sample after sample. Where the compiler knows
vectors (GCC and Clang), it computes as many samples at once as the processor's registers hold, and reads and
writes the rows of these samples itself; elsewhere one at a time, by the same text.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Sequence
from typing import Literal

from screwkin.compiler.graph import BOOLEAN
from screwkin.compiler.program import Group, Operand, Program, Step
from screwkin.compiler.series import ARC, COSINE, HALF_TURN, SINE

Real = Literal["double", "float"]

_INFIX = {"add": "+", "sub": "-", "mul": "*", "lt": "<", "le": "<=", "and": "&", "or": "|"}

_WORDS = """auto bits break case char const continue default do double else enum extern failed first float for
goto i if inline int k long main mask pack real register restrict return samples short signed sizeof static
struct switch typedef union unsigned void volatile while word at"""
"""What C and the generated text have a meaning for, besides numbered values."""


def argument(group: Group) -> str:
    """The name of an array in C: the group's, unless that is taken."""
    taken = group.name in _WORDS.split() or re.fullmatch(r"[sc]?v\d+", group.name)
    return group.name + "_" if taken else group.name


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


def source(programs: Sequence[Program], include: str | None, real: Real = "double") -> str:
    """The definitions, to stand beside the header ``include``, or below its text if None."""
    above = f'#include "{include}"\n' if include else ""
    return "\n".join([f"{above}#include <math.h>\n", _prelude(real), *(_function(p) for p in programs)])


def by_pointers(program: Program) -> str:
    """Definition of ``NAME_rows``: the same function, of pointers to all arrays."""
    pointers = ", ".join(f"arrays[{k}]" for k in range(len(program.inputs) + len(program.outputs)))
    return f"""void {program.name}_rows(size_t samples, screwkin_real *const *arrays)
{{
    {program.name}(samples, {pointers});
}}
"""


def _comment(program: Program) -> str:
    def listed(groups: Sequence[Group]) -> str:
        return ", ".join(f"{argument(g)} ({' x '.join(map(str, g.shape)) or '1'})" for g in groups)

    text = f"""{program.about}
In, one after the other for every sample, row by row: {listed(program.inputs)}.
Out: {listed(program.outputs)}. {program.operations} operations a sample. No two arrays overlap."""
    lines = [line for part in text.replace("*/", "* /").splitlines() for line in textwrap.wrap(part, 110)]
    return "/* " + "\n   ".join(lines) + " */\n"


def _prototype(program: Program) -> str:
    arguments = [f"const screwkin_real *{argument(group)}" for group in program.inputs]
    arguments += [f"screwkin_real *{argument(group)}" for group in program.outputs]
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


_BYTES = (("__AVX512F__", 64), ("__AVX2__", 32), ("__SSE2__", 16), ("__aarch64__", 16))
"""Of a vector register, where the compiler says that there is one."""


def _prelude(real: Real) -> str:
    size, letter, magic = (8, "", "0x1.8p52") if real == "double" else (4, "f", "0x1.8p23")
    single = (3.140625, math.pi - 3.140625)  # pi as HALF_TURN has it, the first with 8 bits
    high, low = map(_number, HALF_TURN if real == "double" else single)
    widths = "\n".join(
        f"#elif defined({macro})\n#define BYTES {width}\n"
        f"#define EACH(F) {{{', '.join(f'F({i})' for i in range(width // size))}}}"
        for macro, width in _BYTES
    )
    return f"""#ifdef __FAST_MATH__
#error "-ffast-math takes the rounding out of these functions; -O2 -ffp-contract=fast does what can be done"
#endif

typedef screwkin_real real;
typedef {"long long" if real == "double" else "int"} bits;
#define R(x) ((real)(x))
#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline, unused))
#else
#define INLINE static inline
#endif

/* A pack holds one scalar of several samples, a mask what is true of each. */
#if defined(SCREWKIN_SCALAR) || !defined(__GNUC__)
{widths}
#endif
#ifdef BYTES
typedef real pack __attribute__((vector_size(BYTES)));
typedef bits mask __attribute__((vector_size(BYTES)));
#define WIDTH (BYTES / sizeof(real))
#define NOT(m) (~(m))
#else
typedef real pack;
typedef int mask;
#define WIDTH 1
#define EACH(F) F(0)
#define NOT(m) (!(m))
#endif
#define ALL(x) ((pack){{0}} + R(x))
typedef union {{
    pack x;
#ifdef BYTES
    mask bits;
#else
    {"unsigned long long" if real == "double" else "unsigned int"} bits;
#endif
}} word;

INLINE pack choose(mask m, pack a, pack b)
{{
#ifdef BYTES
    return (pack)(((mask)a & m) | ((mask)b & ~m));
#else
    return m ? a : b;
#endif
}}

INLINE pack root(pack x)
{{
#ifdef BYTES
#define ROOT(i) sqrt{letter}(x[i])
    return (pack)EACH(ROOT);
#else
    return sqrt{letter}(x);
#endif
}}

/* Between packs and rows, which are so many scalars apart. */
INLINE pack gather(const real *from, const size_t step)
{{
#define HERE(i) from[(i) * step]
    return (pack)EACH(HERE);
}}

INLINE void scatter(real *to, const size_t step, pack x)
{{
#ifdef BYTES
    for (size_t i = 0; i < WIDTH; ++i)
        to[i * step] = x[i];
#else
    (void)step;
    *to = x;
#endif
}}

#ifdef BYTES
INLINE void copy(real *to, const real *from, size_t count)
{{
    for (size_t i = 0; i < count; ++i)
        to[i] = from[i];
}}

/* A pack's rows where there are fewer: the last of them again and again. */
INLINE void fill(real *rows, const real *from, size_t size, size_t samples)
{{
    for (size_t i = 0; i < WIDTH; ++i)
        copy(rows + i * size, from + (i < samples ? i : samples - 1) * size, size);
}}
#endif

/* Sine and cosine: the angle less whole half turns, two polynomials, and the sign of an odd number of half
   turns, which is the last bit of their number where it stands beside a large one. */
INLINE void sine_cosine(pack x, pack *s, pack *c)
{{
    const word turns = {{x * {_number(1 / math.pi)} + R({magic})}};
    const pack k = turns.x - R({magic}), r = (x - k * {high}) - k * {low}, u = r * r;
    word sine = {{r + r * u * {_horner(SINE, "u")}}};
    word cosine = {{R(1) - R(0.5) * u + u * u * {_horner(COSINE, "u")}}};
    sine.bits ^= turns.bits << {8 * size - 1};
    cosine.bits ^= turns.bits << {8 * size - 1};
    *s = sine.x;
    *c = cosine.x;
}}

/* Angle of the point (x, y): the arc tangent of the smaller over the larger, and where the point lies. */
INLINE pack angle(pack y, pack x)
{{
    const pack ax = choose((mask)(x < R(0)), -x, x), ay = choose((mask)(y < R(0)), -y, y);
    const mask steeper = (mask)(ax < ay);
    const pack large = choose(steeper, ay, ax), small = choose(steeper, ax, ay);
    const pack t = small / choose((mask)(large == R(0)), ALL(1), large);
    const pack steep = choose((mask)(t > R({math.tan(math.pi / 8)!r})), ALL(1), ALL(0));
    const pack z = (t - steep) / (R(1) + steep * t), u = z * z;
    const pack arc = z + z * u * {_horner(ARC, "u")} + steep * R({math.pi / 4!r});
    const pack turned = choose(steeper, R({math.pi / 2!r}) - arc, arc);
    const pack half = choose((mask)(x < R(0)), R({math.pi!r}) - turned, turned);
    return choose((mask)(y < R(0)), -half, half);
}}
"""


def _function(program: Program) -> str:
    read = _read(program)
    inputs = [group for group in program.inputs if group.name in read]
    groups = [*inputs, *program.outputs]
    takes = [f"const real *restrict {argument(g)}" for g in inputs]
    takes += [f"real *restrict {argument(g)}" for g in program.outputs]
    body = "\n".join(f"    {line}" for line in _Body(program).lines)
    here = ", ".join(f"{argument(g)} + at * {g.size}" for g in groups)
    few = [f"{argument(g)}_few" for g in groups]
    rows = "\n".join(f"        real {name}[{g.size} * WIDTH];" for name, g in zip(few, groups, strict=True))
    fills = "\n".join(f"        fill({argument(g)}_few, {argument(g)}, {g.size}, samples);" for g in inputs)
    gives = "\n".join(
        f"        copy({argument(g)}, {argument(g)}_few, {g.size} * samples);" for g in program.outputs
    )
    spare = "".join(f"    (void){argument(g)};\n" for g in program.inputs if g.name not in read)
    return f"""static void {program.name}_pack({", ".join(takes)})
{{
{body}
}}

{_prototype(program)}
{{
{spare}#ifdef BYTES
    if (samples == 0)
        return;
    if (samples < WIDTH) {{
{rows}
{fills}
        {program.name}_pack({", ".join(few)});
{gives}
        return;
    }}
#endif
    for (size_t first = 0; first < samples; first += WIDTH) {{
        const size_t at = samples - first < WIDTH ? samples - WIDTH : first; /* some of them twice */
        {program.name}_pack({here});
    }}
}}
"""


def _read(program: Program) -> set[str]:
    """Which input groups the program reads."""
    used = {x for step in program.steps for x in step.operands if isinstance(x, int)}
    used |= {x for x in program.results if isinstance(x, int)}
    read, at = set(), 0
    for group in program.inputs:
        if used & set(range(at, at + group.size)):
            read.add(group.name)
        at += group.size
    return read


class _Body:
    """Statements of a program: a value is read where it is first needed, and written once it is known."""

    def __init__(self, program: Program) -> None:
        self.lines: list[str] = []
        self._arity = program.arity
        self._masks = {program.arity + k for k, s in enumerate(program.steps) if s.operation in BOOLEAN}
        self._rows = [(g, k) for g in program.inputs for k in range(g.size)]
        self._known: set[int] = set()
        self._turned: set[str] = set()
        places = [(g, k) for g in program.outputs for k in range(g.size)]
        results = list(zip(program.results, places, strict=True))
        wanted: dict[int, list[tuple[Group, int]]] = {}
        for x, place in results:
            if isinstance(x, int) and x >= program.arity:
                wanted.setdefault(x, []).append(place)
            else:
                self._write(x, *place)
        for value, step in enumerate(program.steps, program.arity):
            value_text = self._expression(step)
            kind = "mask" if value in self._masks else "pack"
            self.lines.append(f"const {kind} v{value} = {value_text};")
            for place in wanted.get(value, ()):
                self._write(value, *place)

    def _write(self, x: Operand, group: Group, k: int) -> None:
        self.lines.append(f"scatter({argument(group)} + {k}, {group.size}, {self._pack(x)});")

    def _name(self, x: Operand) -> str:
        """A value's name, or a number."""
        if not isinstance(x, int):
            return _number(x)
        if x < self._arity and x not in self._known:
            self._known.add(x)
            group, k = self._rows[x]
            self.lines.append(f"const pack v{x} = gather({argument(group)} + {k}, {group.size});")
        return f"v{x}"

    def _pack(self, x: Operand) -> str:
        if not isinstance(x, int):
            return f"ALL({_number(x)})"
        return f"choose({self._name(x)}, ALL(1), ALL(0))" if x in self._masks else self._name(x)

    def _mask(self, x: Operand) -> str:
        return self._name(x) if x in self._masks else f"(mask)({self._name(x)} != R(0))"

    def _expression(self, step: Step) -> str:
        operation, operands = step.operation, step.operands
        if operation in ("sin", "cos"):
            angle = self._name(operands[0])
            if angle not in self._turned:
                self._turned.add(angle)
                self.lines += [f"pack s{angle}, c{angle};", f"sine_cosine({angle}, &s{angle}, &c{angle});"]
            return f"{operation[0]}{angle}"
        if operation in ("and", "or"):
            return f" {_INFIX[operation]} ".join(map(self._mask, operands))
        if operation == "not":
            return f"NOT({self._mask(operands[0])})"
        if operation == "where":
            return f"choose({self._mask(operands[0])}, {', '.join(map(self._pack, operands[1:]))})"
        if operation == "atan2":
            return f"angle({', '.join(map(self._pack, operands))})"
        a, *rest = [self._pack(x) if x in self._masks else self._name(x) for x in operands]
        if operation in ("lt", "le"):
            return f"(mask)({a} {_INFIX[operation]} {rest[0]})"
        if rest:
            return f"{a} {_INFIX[operation]} {rest[0]}"
        return {"neg": f"-{a}", "rcp": f"R(1) / {a}", "sqrt": f"root({a})"}[operation]
