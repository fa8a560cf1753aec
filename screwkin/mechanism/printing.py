"""Screw tables and symbolic models as plain text, Markdown or LaTeX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from screwkin.algebra.scalar import Scalar, is_symbolic
from screwkin.algebra.se3 import Vector, cross
from screwkin.errors import one_of
from screwkin.mechanism.symbolic import SymbolicLimb, symbolic_limb, symbolic_loops
from screwkin.model.coupled import coupling_text
from screwkin.model.records import CoupledJoint
from screwkin.model.robot import Robot

Style = Literal["text", "markdown", "latex"]
Symbol = Any

_WIDE = 100
"""Characters beyond which a vector is printed one component a line."""
_MARK = "~"


@dataclass(frozen=True)
class ScrewRow:
    """One joint of a screw table: axis s, a point s0 of it [m], pitch [m/rad], moment s0 x s [m].

    A prismatic joint has infinite pitch and no moment: where its axis runs does not matter. A coupled joint
    says what it ``follows``.
    """

    joint: str
    type: str
    s: Vector
    s0: Vector
    pitch: Scalar
    moment: Vector | None
    follows: CoupledJoint | None = None


def screw_rows(robot: Robot) -> list[ScrewRow]:
    """The screw table of a robot, numeric or symbolic, in table order; coupled joints last."""
    rows = []
    for joint in robot.tree:
        s, s0, pitch = joint.screw.s, joint.screw.s0, joint.screw.pitch
        moment = None if joint.screw.is_translation else cross(s0, s)
        follows = joint if isinstance(joint, CoupledJoint) else None
        rows.append(ScrewRow(joint.name, joint.type, s, s0, pitch, moment, follows))
    return rows


def screw_table(robot: Robot, style: Style = "text") -> str:
    """The screw table as text: joint, type, s, s0, pitch, moment s0 x s.

    Args:
        robot: from ``parse_robot``; with ``symbolic=True`` parameters are printed by name.
        style: plain text, a Markdown table, or a LaTeX tabular.

    Raises:
        InputError: no such style.
    """
    return _table(*screw_cells(robot, style), style)


def screw_cells(robot: Robot, style: Style = "text") -> tuple[list[str], list[list[str]]]:
    """Header and rows of the screw table.

    Args:
        robot: numeric or symbolic.
        style: plain text, Markdown or LaTeX.

    Raises:
        InputError: no such style.
    """
    _check(style)
    write = _Writer(style, {})
    header = ["joint", "type", "s", "s0 [m]", "pitch [m/rad]", "s0 x s [m]"]
    if style == "latex":
        header = ["joint", "type", "$s$", r"$s_0$ [m]", "$h$ [m/rad]", r"$s_0 \times s$ [m]"]
    cells = []
    for row in screw_rows(robot):
        moment = "-" if row.moment is None else write.vector(row.moment)
        pitch = write.infinite if row.moment is None else write.math(row.pitch)
        name = write.name(row.joint)
        cells.append([name, row.type, write.vector(row.s), write.vector(row.s0), pitch, moment])
        if robot.coupled:
            follows = "" if row.follows is None else coupling_text(row.follows).partition(" = ")[2]
            cells[-1].append(write.name(follows))
    if robot.coupled:
        header.append("position")
    return header, cells


def print_symbolic(robot: Robot, limb: str | None = None, style: Style = "text") -> str:
    """Forward kinematics, screw Jacobian and network block of a limb, or the loops of a linkage, in symbols.

    Sines and cosines are abbreviated as in textbooks: c345 is cos(q3 + q4 + q5), the joints counted along the
    limb; crx is the cosine of the tip's virtual rotation about x.

    Args:
        robot: from ``parse_robot(text, symbolic=True)``.
        limb: name of a limb or tip; default: the first limb of the table, or all loops if it has no limb.
        style: plain text, Markdown or LaTeX.

    Raises:
        UnknownNameError: no such limb.
        InputError: no such style, or a table without limbs and loops.
    """
    _check(style)
    if limb is None and not robot.limbs:
        parts = symbolic_loops(robot)
    else:
        parts = (symbolic_limb(robot, robot.limbs[0].name if limb is None else limb),)
    return "\n\n".join(_printed(part, style) for part in parts)


def _printed(part: SymbolicLimb, style: Style) -> str:
    real = [name for name in part.symbols if "." not in name]
    short = {name: f"q{i}" for i, name in enumerate(real, 1)}
    short |= {name: name.split(".")[1] for name in part.symbols if "." in name}
    names = {part.symbols[name]: short[name] for name in part.symbols}
    write = _Writer(style, names | dict(zip(part.origin, "xyz", strict=False)))
    legend = ", ".join(f"{write.joint(short[name])} = {write.name(name)}" for name in real)
    legend += f"; {write.math(_sum_of_two())} is the cosine of {write.joint('q1')} + {write.joint('q2')}"
    if part.origin:
        legend += ", " + ", ".join(write.math(c) for c in part.origin) + " are the origin of the tip"
    blocks = [_heading(part.name, 2, style), f"{legend}."]
    if part.fk is not None and part.jacobian is not None:
        rows = [(f"{axis} axis", part.fk[:3, k]) for k, axis in enumerate("xyz")]
        rows.append(("origin", part.fk[:3, 3]))
        blocks.append(_heading("Pose of the tip in the base frame", 3, style))
        blocks.append(_vectors(["", "in base axes"], [(name, (v,)) for name, v in rows], write))
        blocks.append(_heading("Screw Jacobian in base axes, at the base origin", 3, style))
        blocks.append(_screws(real, part.jacobian, write))
    point = "the waist, waist upright" if "waist.px" in part.couplings else "the base origin"
    blocks.append(_heading(f"Rows of the network matrix for this circuit, at {point}", 3, style))
    blocks.append(_screws(part.couplings, part.network_block, write))
    return "\n\n".join(blocks)


def _sum_of_two() -> Symbol:
    import sympy

    return sympy.Symbol(f"{_MARK}c12")


def _screws(names: Sequence[str], columns: Any, write: _Writer) -> str:
    """One row for every coupling: its angular and its linear part."""
    rows = [(write.name(n), (columns[:3, k], columns[3:, k])) for k, n in enumerate(names)]
    return _vectors(["coupling", *write.parts], rows, write)


def _vectors(header: list[str], rows: Sequence[tuple[str, tuple[Any, ...]]], write: _Writer) -> str:
    if write.style != "text":
        cells = [[name, *(write.vector(v) for v in vectors)] for name, vectors in rows]
        return _table(header, cells, write.style)
    width = max(len(name) for name, _ in rows)
    lines = []
    for name, vectors in rows:
        labels = header[1:] if len(vectors) > 1 else [""]
        text = "  ".join(
            f"{label} = {write.vector(v)}".removeprefix(" = ")
            for label, v in zip(labels, vectors, strict=True)
        )
        if len(text) + width <= _WIDE:
            lines.append(f"{name:<{width}}  {text}")
            continue
        heads = iter([name])
        for label, v in zip(labels, vectors, strict=True):
            for axis, component in zip("xyz", v, strict=True):
                quantity = f"{label}_{axis}".removeprefix("_")
                lines.append(f"{next(heads, ''):<{width}}  {quantity} = {write.math(component)}")
    return "\n".join(lines)


def _check(style: str) -> None:
    one_of("style", style, get_args(Style))


def _heading(text: str, level: int, style: Style) -> str:
    if style == "markdown":
        return f"{'#' * level} {text}"
    if style == "latex":
        return rf"\{'sub' * (level - 2)}section*{{{_escaped(text)}}}"
    return f"{text}\n{('=' if level == 2 else '-') * len(text)}"


def _escaped(text: str) -> str:
    return text.replace("_", r"\_")


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], style: Style) -> str:
    """Cells in columns: aligned, as a Markdown table, or as a LaTeX tabular."""
    if style == "latex":
        body = [" & ".join(row) + r" \\" for row in rows]
        head = " & ".join(header) + r" \\ \hline"
        return "\n".join([rf"\begin{{tabular}}{{{'l' * len(header)}}}", head, *body, r"\end{tabular}"])
    if style == "markdown":
        lines = [f"| {' | '.join(row)} |" for row in (header, *rows)]
        return "\n".join([lines[0], "|" + "---|" * len(header), *lines[1:]])
    widths = [max(len(row[k]) for row in (header, *rows)) for k in range(len(header))]
    padded = [[f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)] for row in (header, *rows)]
    return "\n".join("  ".join(row).rstrip() for row in padded)


class _Writer:
    """Scalars, vectors and names in one style, sines and cosines abbreviated."""

    def __init__(self, style: Style, short: Mapping[Symbol, str]) -> None:
        """``short`` gives the printed names of the symbols that are no parameters."""
        self.style = style
        self.short = dict(short)
        self.infinite = "inf" if style == "text" else r"$\infty$"
        self.parts = ("omega", "v") if style == "text" else (r"$\omega$", "$v$")

    def name(self, name: str) -> str:
        """A name from the table."""
        return _escaped(name) if self.style == "latex" else name

    def joint(self, short: str) -> str:
        """A joint's abbreviated coordinate."""
        return short if self.style == "text" else f"$q_{{{short[1:]}}}$"

    def math(self, x: Scalar) -> str:
        """One scalar, as mathematics of its own."""
        return self._plain(x) if self.style == "text" else f"${self._plain(x)}$"

    def vector(self, v: Any) -> str:
        """Three scalars in parentheses, in LaTeX one below the other where they are long."""
        text = [self._plain(c) for c in v]
        if self.style == "text":
            return f"({', '.join(text)})"
        if self.style == "latex" and sum(map(len, text)) > _WIDE:
            return r"$\begin{pmatrix} " + r" \\ ".join(text) + r" \end{pmatrix}$"
        return f"$({', '.join(text)})$"

    def _plain(self, x: Scalar) -> str:
        if not is_symbolic(x):
            return f"{x:.6g}"
        import sympy

        # Abbreviated symbols bear a mark that sorts them behind the parameters: calf*c34, not c34*calf.
        waves = [w for w in x.atoms(sympy.sin, sympy.cos) if w.free_symbols & set(self.short)]
        x = x.xreplace({w: sympy.Symbol(_MARK + self._wave(w)) for w in waves})
        x = x.xreplace({q: sympy.Symbol(_MARK + name) for q, name in self.short.items()})
        if self.style == "text":
            return str(sympy.sstr(x, full_prec=False)).replace(_MARK, "")
        names = {s: _latex_name(s.name) for s in x.free_symbols}
        return str(sympy.latex(x, symbol_names=names, full_prec=False))

    def _wave(self, wave: Any) -> str:
        """``c345`` for the cosine of q3 + q4 + q5; other arguments in full."""
        letter, angle = type(wave).__name__[0], wave.args[0]
        parts = angle.as_coefficients_dict()
        if all(n == 1 and q in self.short for q, n in parts.items()):
            names = sorted((self.short[q].removeprefix("q") for q in parts), key=lambda n: (len(n), n))
            return letter + ("".join(names) if all(len(n) == 1 for n in names) else ",".join(names))
        text = angle.xreplace({q: type(q)(name) for q, name in self.short.items()})
        return f"{type(wave).__name__}({text})"


def _latex_name(name: str) -> str:
    """LaTeX of a symbol: an abbreviated sine or cosine, a joint, or a parameter by its full name."""
    if not name.startswith(_MARK):
        return name if len(name) == 1 else rf"\mathrm{{{_escaped(name)}}}"
    name = name.removeprefix(_MARK)
    if name.startswith(("cos(", "sin(")):
        return rf"\{name}"
    if name in ("x", "y", "z"):
        return name
    return rf"\mathrm{{{name[0]}}}_{{{name[1:]}}}" if name[0] in "cs" else f"{name[0]}_{{{name[1:]}}}"
