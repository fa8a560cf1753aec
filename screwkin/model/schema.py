"""The rows of a robot table: which keys they have, and what pydantic's errors mean in our words.

Each row is read by itself, so that every faulty row of a file is reported at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import Vector
from screwkin.errors import Fault, near
from screwkin.model.expression import listed
from screwkin.model.records import JointType, LimbKind, ShapeRole
from screwkin.model.values import (
    COUPLINGS,
    Chain,
    Colour,
    Factors,
    Length,
    Lengths,
    Mass,
    Moments,
    Name,
    Number,
    Place,
    Point,
    Positive,
    Size,
    Unit,
    Value,
)


class Row(BaseModel):
    """A row or an inline table; unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class RobotRow(Row):
    """[robot]: what the table describes."""

    name: Name = Field(description="name of the robot")
    description: str = Field("", description="one sentence")
    source: str = Field("", description="where the numbers come from")
    base_link: Name = Field(description="name of the link that carries the base frame")
    base: Literal["floating", "fixed"] = Field(description='"floating" or "fixed"')


class FrameRow(Row):
    """A frame in the zero pose: origin [m] and roll, pitch, yaw about the fixed base axes [rad]."""

    xyz: Point = Field(description="origin [x, y, z] in m")
    rpy: Point = Field(Vector(0, 0, 0), description="angles [roll, pitch, yaw] in rad")


class BoxRow(Row):
    """A box with edges along the base axes in the zero pose."""

    center: Point = Field(description="centre [x, y, z] in m")
    size: Size = Field(description="edges [lx, ly, lz] in m")


class ShapeRow(Row):
    """A solid or a mesh, for pictures and geometry: one of box, cylinder, sphere, capsule, mesh."""

    role: ShapeRole = Field(description='"visual" or "collision"')
    box: Size | None = Field(None, description="edges [lx, ly, lz] in m")
    cylinder: Lengths | None = Field(None, description="[radius, length along z] in m")
    sphere: Length | None = Field(None, description="radius in m")
    capsule: Lengths | None = Field(None, description="[radius, length along z without caps] in m")
    mesh: str | None = Field(None, description="path of a file, from this table's folder")
    scale: Factors = Field(Vector(1, 1, 1), description="factors [x, y, z] of a mesh")
    frame: FrameRow | None = Field(None, description="{ xyz = [x, y, z], rpy = [roll, pitch, yaw] }")
    colour: Colour = Field((), description="[red, green, blue] in [0, 1]")


class InertiaRow(Row):
    """Inertia about the CoM: the edges of a solid box that has it, or its six components [kg m^2]."""

    box: Size | None = Field(None, description="edges [lx, ly, lz] of a solid box in m")
    xx: Number = Field(None, description="a number in kg m^2")
    yy: Number = Field(None, description="a number in kg m^2")
    zz: Number = Field(None, description="a number in kg m^2")
    xy: Number = Field(0, description="a number in kg m^2")
    xz: Number = Field(0, description="a number in kg m^2")
    yz: Number = Field(0, description="a number in kg m^2")


class SpringRow(Row):
    """A link that bends: a stiffness matrix at its end, or the section and material of a beam."""

    root: Place = Field(description="[x, y, z] in m, where it begins to bend")
    end: Place = Field(description="[x, y, z] in m, where what it carries is fixed")
    stiffness: list[list[Value]] = Field(
        [], description="six rows of six: [m; f] per [rotation; translation] at the end, base axes"
    )
    E: Positive | None = Field(None, description="Young's modulus in Pa")
    G: Positive | None = Field(None, description="shear modulus in Pa")
    A: Positive | None = Field(None, description="area of the section in m^2")
    I: Moments = Field((), description="second moment in m^4, or two: [about, across]")  # noqa: E741
    J: Positive | None = Field(None, description="torsion constant in m^4; default: the sum of the moments")
    about: Place | None = Field(None, description="direction of the axis of the first of two moments")


class LinkRow(Row):
    """[[link]]: a rigid body. CoM and inertia may be left out of a massless one."""

    name: Name = Field(description="name of the link")
    mass: Mass = Field(description="mass in kg; 0 for a massless bracket")
    com: Point | None = Field(None, description="centre of mass [x, y, z] in m")
    inertia: InertiaRow | None = Field(
        None, description="{ box = [lx, ly, lz] } or { xx, yy, zz, xy, xz, yz }"
    )
    frame: FrameRow | None = Field(None, description="{ xyz = [x, y, z], rpy = [roll, pitch, yaw] }")
    boxes: list[BoxRow] = Field([], description="[{ center = [x, y, z], size = [lx, ly, lz] }]")
    shapes: list[ShapeRow] = Field([], description='[{ role = "visual", mesh = "foot.stl", frame = {...} }]')
    spring: SpringRow | None = Field(None, description="{ root, end, and stiffness or E, G, A, I }")


class MimicRow(Row):
    """A coupling: position = ratio * that of another joint + offset."""

    joint: Name = Field(description="name of the joint that it follows")
    ratio: Value = Field(1.0, description="its rate per unit rate of that joint")
    offset: Value = Field(0.0, description="its position where that joint is at 0, in rad or m")


class JointRow(Row):
    """[[joint]]: a screw. Limits left out are no limits."""

    name: Name = Field(description="name of the joint")
    parent: Name = Field(description="name of the link it stands on")
    child: Name = Field(description="name of the link it carries")
    type: JointType = Field(description='"revolute", "prismatic" or "helical"')
    s: Unit = Field(description="unit vector [x, y, z] of its axis")
    s0: Point = Field(description="a point [x, y, z] of its axis, in m")
    pitch: Number = Field(0, description="advance in m/rad, for a helical joint only")
    lower: Value = Field(-math.inf, description="lower limit in rad or m")
    upper: Value = Field(math.inf, description="upper limit in rad or m")
    velocity: Positive = Field(math.inf, description="greatest speed in rad/s or m/s")
    effort: Positive = Field(math.inf, description="greatest torque or force in N m or N")
    passive: bool = Field(False, description="true for a joint without a motor")
    stiffness: Value = Field(0.0, description="of a passive joint's spring in N m/rad or N/m")
    rest: Value = Field(0.0, description="position in rad or m at which its spring is relaxed")
    damping: Value = Field(0.0, description="of a passive joint's damper in N m s/rad or N s/m")
    mimic: MimicRow | None = Field(None, description='{ joint = "leader", ratio = 1.0, offset = 0.0 }')


class ClosureRow(Row):
    """[[closure]]: two frames that coincide, on two links or on a link and the floor."""

    name: Name = Field(description="name of the closure")
    link_a: Name = Field(description="name of a link")
    frame_a: FrameRow = Field(description="{ xyz = [x, y, z], rpy = [roll, pitch, yaw] } on link_a")
    link_b: Name = Field(description='name of another link; or "floor", whose frame is in the world')
    frame_b: FrameRow = Field(description="{ xyz = [x, y, z], rpy = [roll, pitch, yaw] } on link_b")


class PlaceRow(Row):
    """[[frame]]: a named place on a link, such as that of a sensor."""

    name: Name = Field(description="name of the frame")
    link: Name = Field(description="name of the link that it is fixed to")
    pose: FrameRow = Field(description="{ xyz = [x, y, z], rpy = [roll, pitch, yaw] }")


class LimbRow(Row):
    """[[limb]]: a leg or an arm, and its tip."""

    name: Name = Field(description="name of the limb")
    kind: LimbKind = Field(description='"leg", "arm", or "other", as a head or a tail, which rests in walks')
    link: Name = Field(description="name of its last link")
    tip: Name = Field(description="name of the frame at its end")
    frame: FrameRow = Field(description="{ xyz = [x, y, z], rpy = [roll, pitch, yaw] } of the tip")
    chain: Chain = Field(COUPLINGS, description="couplings of its virtual chain, from floor to tip")


class MirrorRow(Row):
    """[[limb]] with ``mirror``: another limb reflected in the xz plane, with all its rows."""

    name: Name = Field(description="name of the limb")
    mirror: Literal["y"] = Field(description='"y": the sign of y changes')
    of: Name = Field(description="name of the limb to reflect")


class SoleRow(Row):
    """[[sole]]: the contact polygon of a leg."""

    limb: Name = Field(description="name of a leg")
    corners: list[Point] = Field(description="three or more points, counter-clockwise seen from above")


class PostureRow(Row):
    """[[posture]]: joint positions by name; joints left out are at 0. Walks begin at the one named `home`."""

    name: Name = Field(description="name of the posture")
    base_height: Value | None = Field(
        None, description="height of the base above the floor in m; must be given where the base floats"
    )
    q: dict[str, Value] = Field({}, description="{ joint = position, ... } in rad or m")


ROWS: Mapping[str, type[Row]] = {
    "link": LinkRow,
    "joint": JointRow,
    "closure": ClosureRow,
    "frame": PlaceRow,
    "limb": LimbRow,
    "sole": SoleRow,
    "posture": PostureRow,
}
"""Arrays of tables, by their key."""

TABLES = ("robot", "parameters", "waist", *ROWS, "servos")
"""All keys at the top of a file."""

_PARTS: Mapping[str, type[Row]] = {
    "inertia": InertiaRow,
    "frame": FrameRow,
    "frame_a": FrameRow,
    "frame_b": FrameRow,
    "pose": FrameRow,
    "end_frame": FrameRow,
    "start_frame": FrameRow,
    "boxes": BoxRow,
    "shapes": ShapeRow,
    "mimic": MimicRow,
    "spring": SpringRow,
}

Kind = TypeVar("Kind", bound=Row)


def label(table: str, index: int, row: object) -> str:
    """Where a row stands: ``[[joint]] 3 'right_knee'``, counted from 1."""
    name = row.get("limb" if table == "sole" else "name") if isinstance(row, dict) else None
    return f"[[{table}]] {index + 1}" + (f" {name!r}" if isinstance(name, str) else "")


def kind_of(table: str, row: object) -> type[Row]:
    """The model of a row; a limb is a mirrored one as soon as it says so."""
    mirrored = table == "limb" and isinstance(row, dict) and ("mirror" in row or "of" in row)
    return MirrorRow if mirrored else ROWS[table]


def read_row(
    kind: type[Kind],
    row: object,
    where: str,
    names: Mapping[str, Scalar],
    numbers: Mapping[str, float],
) -> tuple[Kind | None, list[Fault]]:
    """One row of a table, or all its faults.

    Args:
        kind: the row's model.
        row: what the file holds there.
        where: the row's place, for the faults.
        names: values of the parameters for the mechanism's numbers: floats or symbols.
        numbers: their numeric values, for limits and postures.
    """
    try:
        return kind.model_validate(row, context=(names, numbers)), []
    except ValidationError as error:
        faults = [_fault(kind, where, dict(one)) for one in error.errors(include_url=False)]
        return None, [fault for fault in faults if fault is not None]


def _fault(kind: type[Row], where: str, error: Mapping[str, Any]) -> Fault | None:
    """A pydantic error in our words; None for one that is reported at its parameter."""
    loc: Sequence[str | int] = error["loc"]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc).lstrip(".")
    context = error.get("ctx", {})
    if error["type"] == "fault":
        return None if context["unresolved"] else Fault(where, key, context["found"], context["fix"])
    owner = _owner(kind, loc)
    last = str(loc[-1]) if loc else ""
    if error["type"] == "extra_forbidden":
        fix = f"{near(last, owner.model_fields)}Keys: {listed(owner.model_fields)}"
        return Fault(where, key, "is unknown", fix)
    field = owner.model_fields.get(last)
    meant = field.description if field else f"a table with the keys {listed(owner.model_fields)}"
    if error["type"] == "missing":
        return Fault(where, key, "is missing", f"Write {last} = {meant}")
    return Fault(where, key, f"found {error['input']!r}", f"Expected {meant}")


def _owner(kind: type[Row], loc: Sequence[str | int]) -> type[Row]:
    """The model that holds the last key of a place."""
    for part in loc[:-1]:
        kind = _PARTS.get(str(part), kind)
    return kind
