"""The records of a robot: links, joints, limbs, soles, closures, postures, and all of them together.

Every point, axis, CoM, inertia, box and sole is given in the zero pose (all q = 0), in base axes from the
base origin. Numbers are scalars: floats as a rule, sympy symbols in the symbolic twin of a table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from screwkin.algebra.scalar import Scalar, is_jax, is_symbolic
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Pose, Vector

JointType = Literal["revolute", "prismatic", "helical"]
ShapeKind = Literal["box", "cylinder", "sphere", "capsule", "mesh"]
ShapeRole = Literal["visual", "collision"]
LimbKind = Literal["leg", "arm", "other"]
FLOOR = "floor"
"""Name of what the robot stands on, which a closure may name like a link: its frames are the world's."""
LIMIT_TOLERANCE = 1e-9
"""Excess over a joint limit [rad or m] that counts as rounding: one number for the whole package."""


@dataclass(frozen=True)
class Box:
    """A box with edges along the base axes: centre and edge lengths [m]."""

    center: Vector
    size: Vector


@dataclass(frozen=True)
class Shape:
    """What a link looks like or occupies, for pictures and geometry; contact is that of ``Link.boxes``.

    Attributes:
        role: ``visual``, for pictures, or ``collision``.
        kind: a solid centred in its frame, or a mesh.
        pose: its frame in the zero pose, in base axes.
        size: of a box: edges; of a cylinder or capsule: radius, and length along z without caps; of a sphere:
            radius [m]; of a mesh: factors along the axes of its file.
        file: of a mesh: a path, or the URI of a file that was not found; else empty.
        colour: red, green, blue in [0, 1]; empty if unknown.
    """

    role: ShapeRole
    kind: ShapeKind
    pose: Pose
    size: tuple[Scalar, ...]
    file: str = ""
    colour: tuple[float, ...] = ()


@dataclass(frozen=True)
class Inertia:
    """Rotational inertia about the CoM, in base axes [kg m^2]."""

    xx: Scalar
    yy: Scalar
    zz: Scalar
    xy: Scalar = 0
    xz: Scalar = 0
    yz: Scalar = 0

    def times(self, w: Vector) -> Vector:
        """The inertia applied to an angular velocity."""
        return Vector(
            w.x * self.xx + w.y * self.xy + w.z * self.xz,
            w.x * self.xy + w.y * self.yy + w.z * self.yz,
            w.x * self.xz + w.y * self.yz + w.z * self.zz,
        )


@dataclass(frozen=True)
class LinkSpring:
    """A link that bends: its far part, with all that the link carries, hangs on a spring of six freedoms.

    Attributes:
        root: where the link begins to bend [m].
        end: where the spring sits [m].
        stiffness: six rows of six numbers: wrench [m; f] per displacement [rotation; translation], both at
            the end, base axes [N m/rad, N/m].
    """

    root: Vector
    end: Vector
    stiffness: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Link:
    """A body: mass [kg], CoM, inertia, its own frame, boxes for contact, and shapes beside them.

    It is rigid but for its ``spring``, which ``static_deflection`` allows for.
    """

    name: str
    mass: Scalar
    com: Vector
    inertia: Inertia
    frame: Pose
    boxes: tuple[Box, ...] = ()
    shapes: tuple[Shape, ...] = ()
    spring: LinkSpring | None = None


@dataclass(frozen=True)
class Joint:
    """A screw joint between two links, with limits in rad (m for prismatic), rad/s and N m.

    ``passive``: the table says that no motor turns it (which joints of a loop have motors where no table says
    so: ``mechanism.actuation``). Such a joint may have a spring and a damper, as a leaf or a heel has:
    ``stiffness`` [N m/rad or N/m], ``rest``, where the spring is relaxed [rad or m], and ``damping``
    [N m s/rad or N s/m].
    """

    name: str
    parent: str
    child: str
    type: JointType
    screw: Screw
    lower: float
    upper: float
    velocity: float
    effort: float
    passive: bool = field(default=False, kw_only=True)
    stiffness: float = field(default=0.0, kw_only=True)
    rest: float = field(default=0.0, kw_only=True)
    damping: float = field(default=0.0, kw_only=True)

    @property
    def springs(self) -> bool:
        """Whether a spring or a damper acts on it."""
        return self.stiffness > 0 or self.damping > 0


@dataclass(frozen=True)
class CoupledJoint(Joint):
    """A joint without a coordinate of its own: its position is ``ratio`` times its leader's plus ``offset``.

    The leader is a joint with a coordinate; the offset has the unit of this joint's position [rad or m], the
    ratio that of the two positions.
    """

    leader: str
    ratio: float
    offset: float


@dataclass(frozen=True)
class Closure:
    """Two frames on two links that must coincide: it closes a loop.

    One of the links may be the ``FLOOR``, whose frame is given in the world.
    """

    name: str
    link_a: str
    frame_a: Pose
    link_b: str
    frame_b: Pose

    @property
    def on_floor(self) -> bool:
        """Whether it holds a link on the floor."""
        return FLOOR in (self.link_a, self.link_b)


@dataclass(frozen=True)
class Frame:
    """A named place on a link: of a sensor, a tool, or a link that was fixed to it; ``pose`` in base axes."""

    name: str
    link: str
    pose: Pose


@dataclass(frozen=True)
class Limb:
    """A leg or an arm: its tip is a frame on its last link, where its virtual chain is attached."""

    name: str
    kind: LimbKind
    link: str
    tip: str
    frame: Pose
    chain: tuple[str, ...]


@dataclass(frozen=True)
class Sole:
    """The contact polygon of a leg: corners in the zero pose, counter-clockwise seen from above."""

    limb: str
    corners: tuple[Vector, ...]


@dataclass(frozen=True)
class Posture:
    """Named joint positions, and the height of the base above the floor [m]."""

    name: str
    base_height: float
    q: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class RobotRecord:
    """The evaluated content of a robot table, unchecked: what readers build and writers write.

    Attributes:
        name, description, source: of the robot, and where its numbers come from.
        base: ``floating``, or ``fixed`` to the world.
        base_link: name of the link that carries the base frame.
        links, joints, limbs, soles, closures, postures: in table order; q is in the order of ``joints``.
        waist: the frame that gaits steer, fixed to the base link, in base axes; None: from the hips.
        servos: the table ``[servos]``, as it stands.
        parameters: values of the named parameters: floats, or symbols.
        text: of the table that it was read from; empty if there is none.
        path: of that table; empty if there is none.
        coupled: joints that follow one of ``joints``, in table order.
        frames: named places on links, besides the links' own and the limbs' tips.
    """

    name: str
    description: str
    source: str
    base: Literal["floating", "fixed"]
    base_link: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    limbs: tuple[Limb, ...] = ()
    soles: tuple[Sole, ...] = ()
    closures: tuple[Closure, ...] = ()
    postures: tuple[Posture, ...] = ()
    waist: Pose | None = None
    servos: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Scalar] = field(default_factory=dict)
    text: str = ""
    path: str = ""
    coupled: tuple[CoupledJoint, ...] = ()
    frames: tuple[Frame, ...] = ()

    @cached_property
    def tree(self) -> tuple[Joint, ...]:
        """All joints of the tree: those with a coordinate, in the order of q, then the coupled ones."""
        return (*self.joints, *self.coupled)


def open_scalars(value: Any) -> Iterator[Scalar]:
    """Components of a record that are no single numbers: symbols, tracers, batches, nodes of a graph."""
    if is_dataclass(value):
        for f in fields(value):
            if f.name not in ("parameters", "servos"):
                yield from open_scalars(getattr(value, f.name))
    elif isinstance(value, tuple):
        for item in value:
            yield from open_scalars(item)
    elif is_open(value):
        yield value


def is_open(x: Scalar) -> bool:
    """True for a scalar that is no single number yet."""
    if isinstance(x, int | float | str):
        return False
    return is_symbolic(x) or is_jax(x) or isinstance(x, np.ndarray) or hasattr(x, "__scalar_namespace__")


def same_content(a: RobotRecord, b: RobotRecord) -> bool:
    """Whether two robots are the same in every field but text, path and the names of parameters."""
    names = [f.name for f in fields(RobotRecord) if f.name not in ("text", "path", "parameters")]
    return all(_plain(getattr(a, name)) == _plain(getattr(b, name)) for name in names)


def _plain(value: Any) -> Any:
    """A record as nested tuples, which compare by their numbers."""
    if is_dataclass(value):
        return tuple(_plain(getattr(value, f.name)) for f in fields(value))
    return tuple(map(_plain, value)) if isinstance(value, tuple) else value
