"""Denavit-Hartenberg tables derived from screws: the common normals of successive axes.

The lines of a chain are the base's z axis, the joints' axes, and the tip's z axis. From each to the next
runs a common normal; the x axes lie along these normals, and the parameters are the distances and angles
between normals (d, theta) and between lines (a, alpha). Base and tool take what is left, Rz Tz before the
first and behind the last normal, so that a table of n joints has 4 n + 6 numbers: the least that determine
such a chain.

Where the normal is not unique, it is chosen so that equal tables come out of equal chains:

- skew axes: x points from an axis to the next, so a > 0;
- intersecting axes: a = 0 and x along  s_i x s_{i+1};
- parallel axes: the normal through the previous origin, so d = 0;
- coincident axes: the previous x axis goes on, so theta = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import IDENTITY, Pose, Vector, cross, dot, map_scalars, norm
from screwkin.errors import InputError, one_of
from screwkin.model.dh import (
    CONVENTIONS,
    QUARTER,
    ROUNDING,
    Convention,
    DHRow,
    DHTable,
    DHType,
    row_transform,
)
from screwkin.model.values import UNIT_TOLERANCE

PARALLEL = 1e-8
"""Sine of the angle below which axes count as parallel: the square root of machine precision.

Axes at a smaller angle meet so far away that rounding moves the tip further than taking them as parallel.
"""


def dh_from_screws(
    screws: Sequence[Screw],
    tool: Pose = IDENTITY,
    convention: Convention = "modified",
    names: Sequence[str] | None = None,
    parallel: float = PARALLEL,
) -> DHTable:
    """The table of a chain of revolute and prismatic joints.

    Args:
        screws: axes in the zero pose, in the base frame, base first; numbers, no batches and no symbols.
        tool: pose of the tip in the zero pose, in the base frame.
        convention: ``"standard"`` or ``"modified"``.
        names: names of the joints; default ``q1`` to ``qn``.
        parallel: sine of the angle below which axes count as parallel.

    Returns:
        A table with the same displacement of the tip for every q; d = offset = 0 wherever that may be chosen.

    Raises:
        InputError: a helical joint, an axis that is no unit vector, NaN or infinity; it names the joint.
        UnknownNameError: no such convention.
    """
    one_of("convention", convention, CONVENTIONS)
    names = [f"q{i + 1}" for i in range(len(screws))] if names is None else list(names)
    if len(names) != len(screws):
        raise InputError(f"{len(screws)} screws, but {len(names)} names; give each joint its name")
    joints = [_line_of(screw, name) for screw, name in zip(screws, names, strict=True)]
    tip = map_scalars(lambda x: _number(x, "tool"), tool)
    lines = [_Line(Vector(0.0, 0.0, 1.0), Vector(0.0, 0.0, 0.0)), *joints, _Line(tip.R.z, tip.p)]
    steps, turns, slides = _walk(lines, Vector(1.0, 0.0, 0.0), tip.R.x, parallel)
    kinds: list[DHType] = ["prismatic" if screw.is_translation else "revolute" for screw in screws]
    rows = []
    for i, (name, kind) in enumerate(zip(names, kinds, strict=True)):
        step = steps[i] if convention == "modified" else steps[i + 1]
        rows.append(DHRow(name, step.alpha, step.a, slides[i + 1], turns[i + 1], kind))
    first, last = (_turn(turns[0], slides[0]), _turn(turns[-1], slides[-1]))
    if convention == "modified":
        return DHTable(convention, tuple(rows), first, steps[-1].pose @ last)
    return DHTable(convention, tuple(rows), first @ steps[0].pose, last)


def fixed_rows(pose: Pose, name: str, convention: Convention) -> list[DHRow]:
    """A constant transform as at most two rows of the convention, for files that hold nothing else."""
    lines = [_Line(Vector(0.0, 0.0, 1.0), Vector(0.0, 0.0, 0.0)), _Line(pose.R.z, pose.p)]
    (step,), turns, slides = _walk(lines, Vector(1.0, 0.0, 0.0), pose.R.x, PARALLEL)
    if convention == "modified":
        pairs = [(0.0, 0.0, slides[0], turns[0]), (step.alpha, step.a, slides[1], turns[1])]
    else:
        pairs = [(step.alpha, step.a, slides[0], turns[0]), (0.0, 0.0, slides[1], turns[1])]
    return [DHRow(name, *numbers) for numbers in pairs if any(numbers)]


@dataclass(frozen=True)
class _Line:
    s: Vector
    s0: Vector


@dataclass(frozen=True)
class _Step:
    """Along a common normal, from a line to the next: distance and angle."""

    a: float
    alpha: float

    @property
    def pose(self) -> Pose:
        return row_transform(DHRow("", self.alpha, self.a, 0.0, 0.0), 0, "modified")


def _turn(offset: float, d: float) -> Pose:
    return row_transform(DHRow("", 0.0, 0.0, d, offset), 0, "modified")


def _walk(
    lines: Sequence[_Line], x: Vector, last_x: Vector, parallel: float
) -> tuple[list[_Step], list[float], list[float]]:
    """Steps between the lines, and the turn and slide along each line from one normal to the next.

    ``x`` is the x axis that comes with the first line, at the base origin, ``last_x`` that of the tip.
    """
    size = max(1e-3, *(abs(c) for line in lines for c in line.s0))
    origin, end = lines[0].s0, lines[-1].s0
    steps, turns, slides = [], [], []
    for here, there in pairwise(lines):
        foot, landing, normal, a = _common_normal(here, there, origin, x, size, parallel)
        turns.append(_angle(x, normal, here.s))
        slides.append(_length(dot(foot - origin, here.s), size))
        steps.append(_Step(a, _angle(here.s, there.s, normal)))
        origin, x = landing, normal
    turns.append(_angle(x, last_x, lines[-1].s))
    slides.append(_length(dot(end - origin, lines[-1].s), size))
    return steps, turns, slides


def _common_normal(
    here: _Line, there: _Line, origin: Vector, x: Vector, size: float, parallel: float
) -> tuple[Vector, Vector, Vector, float]:
    """Feet of the common normal on both lines, its direction and its length.

    ``origin`` is the previous foot on the first line, ``x`` the previous direction.
    """
    across = cross(here.s, there.s)
    sine = norm(across)
    between = there.s0 - here.s0
    if sine > parallel:
        square = sine * sine
        foot = here.s0 + here.s * (dot(cross(between, there.s), across) / square)
        landing = there.s0 + there.s * (dot(cross(between, here.s), across) / square)
        normal = across / sine
        a = _length(dot(between, normal), size)
        return (foot, landing, -normal, -a) if a < 0 else (foot, landing, normal, a)
    landing = there.s0 + there.s * dot(origin - there.s0, there.s)
    away = landing - origin
    away = away - here.s * dot(away, here.s)  # rounding off, and the tilt of nearly parallel axes
    a = _length(norm(away), size)
    return origin, landing, away / norm(away) if a else x, a


def _angle(a: Vector, b: Vector, about: Vector) -> float:
    """Angle from a to b, both across ``about``, in (-pi, pi]; rounding off quarter turns is taken away."""
    angle = math.atan2(dot(cross(a, b), about), dot(a, b))
    turns = round(angle / QUARTER)
    if abs(angle - turns * QUARTER) > ROUNDING:
        return angle
    return (2 if turns == -2 else turns) * QUARTER


def _length(value: float, size: float) -> float:
    """The value, or 0 if it is rounding of numbers of that size."""
    return 0.0 if abs(value) <= ROUNDING * size else float(value)


def _line_of(screw: Screw, name: str) -> _Line:
    if not screw.is_translation and screw.pitch != 0:
        raise InputError(
            f"joint {name!r} is helical (pitch {screw.pitch:g} m/rad): Denavit-Hartenberg parameters know "
            "only revolute and prismatic joints. Keep this chain as a screw table."
        )
    s, s0 = (map_scalars(lambda x: _number(x, f"joint {name!r}"), v) for v in (screw.s, screw.s0))
    length = norm(s)
    if abs(length - 1) > UNIT_TOLERANCE:
        given = ", ".join(f"{c:g}" for c in s)
        raise InputError(f"joint {name!r}: axis ({given}) has norm {length:.10g}, expected 1")
    return _Line(s / length, s0)


def _number(x: Scalar, where: str) -> float:
    try:
        value = float(x)
    except (TypeError, ValueError):
        raise InputError(f"{where}: {x} is no number; parameters are derived for numbers only") from None
    if not math.isfinite(value):
        raise InputError(f"{where}: holds {value}; write finite numbers")
    return value
