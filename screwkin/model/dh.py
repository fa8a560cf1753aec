"""Denavit-Hartenberg tables, standard and modified, and the screws that they describe.

The pose of the tip is  base @ A_1 @ ... @ A_n @ tool  with, for theta = offset + q (revolute joint) or
d + q for d (prismatic joint),

- standard:           A_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i)
- modified (Craig):   A_i = Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta_i) Tz(d_i)

so joint i moves about the z axis of frame i - 1 in a standard table, of frame i in a modified one, whose rows
hold the alpha and a before their joint. Angles in rad, lengths in m. Quarter turns are exact: a table
of right angles gives axes in whole numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from screwkin.algebra.scalar import Scalar, cos, minus, plus, sin, structural, times
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import IDENTITY, Pose, Rotation, Twist, Vector
from screwkin.errors import ShapeError

Convention = Literal["standard", "modified"]
DHType = Literal["revolute", "prismatic"]
CONVENTIONS: tuple[Convention, ...] = get_args(Convention)
"""The conventions of a table."""

QUARTER = math.pi / 2
ROUNDING = 16 * 2.0**-52
"""An angle [rad] this near to a quarter turn is one: the rounding of a few operations."""


@dataclass(frozen=True)
class DHRow:
    """A joint: alpha and offset [rad], a and d [m]; q adds to the offset, of a prismatic joint to d."""

    joint: str
    alpha: float
    a: float
    d: float
    offset: float
    type: DHType = "revolute"


@dataclass(frozen=True)
class DHTable:
    """The rows of a chain, the pose ``base`` before them, ``tool`` behind them, and the chain's names."""

    convention: Convention
    rows: tuple[DHRow, ...]
    base: Pose = IDENTITY
    tool: Pose = IDENTITY
    name: str = "chain"
    tip: str = "tip"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        return tuple(row.joint for row in self.rows)


def dh_frames(table: DHTable, q: Sequence[Scalar]) -> list[Pose]:
    """Frames 0 to n of a chain in the base frame; frame 0 is ``table.base``, the tool is not applied.

    Args:
        table: of n joints.
        q: n scalars of any kind [rad or m].

    Raises:
        ShapeError: q has not one value for each joint.
    """
    if len(q) != len(table.rows):
        raise ShapeError(f"chain {table.name!r} has {len(table.rows)} joints, but q holds {len(q)} values")
    frames = [table.base]
    for row, value in zip(table.rows, q, strict=True):
        frames.append(frames[-1] @ row_transform(row, value, table.convention))
    return frames


def dh_fk(table: DHTable, q: Sequence[Scalar]) -> Pose:
    """Pose of the tip in the base frame.

    Args:
        table: of n joints.
        q: n scalars of any kind [rad or m].

    Raises:
        ShapeError: q has not one value for each joint.
    """
    return dh_frames(table, q)[-1] @ table.tool


def dh_jacobian(table: DHTable, frames: Sequence[Pose]) -> list[Twist]:
    """Twist of the tip per unit rate of each joint, at the base origin: z and origin of its frame.

    ``frames`` are those of ``dh_frames``.
    """
    return [axis.twist for axis in _axes(table, frames)]


def screws_from_dh(table: DHTable) -> tuple[list[Screw], Pose]:
    """The joints' screws and the tip's pose in the zero pose, in the base frame.

    Args:
        table: of n joints; lengths in [m], angles in [rad].

    Returns:
        n screws, their points in [m], and the pose of the tip.
    """
    frames = dh_frames(table, [0] * len(table.rows))
    return _axes(table, frames), frames[-1] @ table.tool


def row_transform(row: DHRow, q: Scalar, convention: Convention) -> Pose:
    """A_i of the module's formulas, for the joint at q."""
    revolute = row.type == "revolute"
    d = structural(row.d) if revolute else plus(structural(row.d), q)
    c, s = _turned(row.offset, q if revolute else 0)
    ca, sa = exact_wave(row.alpha)
    a = structural(row.a)
    if convention == "standard":
        x, y = Vector(c, s, 0), Vector(-s, c, 0)
        up = Vector(0, 0, 1)
        return Pose(Rotation(x, y * ca + up * sa, up * ca - y * sa), x * a + up * d)
    z = Vector(0, -sa, ca)
    y = Vector(0, ca, sa)
    e = Vector(1, 0, 0)
    return Pose(Rotation(e * c + y * s, y * c - e * s, z), e * a + z * d)


def exact_wave(angle: float) -> tuple[Scalar, Scalar]:
    """Cosine and sine of a constant; structure at quarter turns."""
    turns = round(angle / QUARTER)
    if abs(angle - turns * QUARTER) <= ROUNDING * max(1, abs(turns)):
        return (1, 0, -1, 0)[turns % 4], (0, 1, 0, -1)[turns % 4]
    return math.cos(angle), math.sin(angle)


def _turned(offset: float, q: Scalar) -> tuple[Scalar, Scalar]:
    """Cosine and sine of offset + q; quarter turns of the offset only swap them and change signs."""
    c0, s0 = exact_wave(offset)
    if type(c0) is int:
        c, s = cos(q), sin(q)
        return minus(times(c, c0), times(s, s0)), plus(times(s, c0), times(c, s0))
    theta = plus(offset, q)
    return cos(theta), sin(theta)


def _axes(table: DHTable, frames: Sequence[Pose]) -> list[Screw]:
    """The screw of each joint where it is."""
    moving = frames[:-1] if table.convention == "standard" else frames[1:]
    kinds = [0 if row.type == "revolute" else INFINITE for row in table.rows]
    return [Screw(frame.R.z, frame.p, pitch) for frame, pitch in zip(moving, kinds, strict=True)]
