"""The robot as a value: what a screw table says, checked and evaluated.

Every point, axis, CoM, inertia, box and sole is told in the zero pose (all q = 0), in base axes from the
base origin. Numbers are scalars: floats as a rule, sympy symbols in the symbolic twin of a table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

from screwkin.algebra.scalar import Scalar, is_symbolic
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import UNTURNED, Pose, Vector, leaves
from screwkin.errors import UnknownNameError

JointType = Literal["revolute", "prismatic", "helical"]
LimbKind = Literal["leg", "arm"]


@dataclass(frozen=True)
class Box:
    """A box with edges along the base axes: centre and edge lengths [m]."""

    center: Vector
    size: Vector


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
class Link:
    """A rigid body: mass [kg], CoM, inertia, its own frame, and boxes for contact and pictures."""

    name: str
    mass: Scalar
    com: Vector
    inertia: Inertia
    frame: Pose
    boxes: tuple[Box, ...] = ()


@dataclass(frozen=True)
class Joint:
    """A screw joint between two links, with limits in rad (m for prismatic), rad/s and N m."""

    name: str
    parent: str
    child: str
    type: JointType
    screw: Screw
    lower: float
    upper: float
    velocity: float
    effort: float


@dataclass(frozen=True)
class Closure:
    """Two frames on two links that must coincide: it closes a loop of the tree."""

    name: str
    link_a: str
    frame_a: Pose
    link_b: str
    frame_b: Pose


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
class Robot:
    """A robot or mechanism. Links and joints stand in table order; q is in the order of ``joints``.

    waist: the frame that gaits steer, fixed to the base link, in base axes; None: found from the hips.
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

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, in table order."""
        return tuple(link.name for link in self.links)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def tip_names(self) -> tuple[str, ...]:
        """Names of the limbs' tips, in the order of limbs."""
        return tuple(limb.tip for limb in self.limbs)

    @cached_property
    def mass(self) -> Scalar:
        """Total mass [kg]."""
        return sum(link.mass for link in self.links)

    @cached_property
    def is_symbolic(self) -> bool:
        """True if any number is a symbol, as in the symbolic twin of a table."""
        records: list[Any] = [x for link in self.links for x in (link.com, link.inertia, link.frame)]
        records += [x for joint in self.joints for x in (joint.screw.s, joint.screw.s0, joint.screw.pitch)]
        records += [limb.frame for limb in self.limbs] + [link.mass for link in self.links]
        return any(is_symbolic(leaf) for record in records for leaf in leaves(record))

    @cached_property
    def joint_above(self) -> Mapping[str, int]:
        """For every link but the base: the index of the joint that carries it."""
        return {joint.child: i for i, joint in enumerate(self.joints)}

    @cached_property
    def traversal(self) -> tuple[int, ...]:
        """Joint indices ordered so that every parent comes before its children."""
        order: list[int] = []
        reached, left = {self.base_link}, list(range(len(self.joints)))
        while left:
            ready = [i for i in left if self.joints[i].parent in reached]
            order += ready
            reached |= {self.joints[i].child for i in ready}
            left = [i for i in left if i not in ready]
        return tuple(order)

    def path_to(self, link: str) -> tuple[int, ...]:
        """Indices of the joints from the base to a link, in that order."""
        path: list[int] = []
        while link != self.base_link:
            i = self.joint_above[link]
            path.append(i)
            link = self.joints[i].parent
        return tuple(reversed(path))

    def link(self, name: str) -> Link:
        """The link of that name."""
        return _named(self.links, name, "link")

    def joint(self, name: str) -> Joint:
        """The joint of that name."""
        return _named(self.joints, name, "joint")

    def limb(self, name: str) -> Limb:
        """The limb of that name, or the limb that bears a tip of that name."""
        for limb in self.limbs:
            if limb.tip == name:
                return limb
        return _named(self.limbs, name, "limb")

    def posture(self, name: str) -> Posture:
        """The posture of that name."""
        return _named(self.postures, name, "posture")

    def frame(self, name: str) -> tuple[str, Pose]:
        """Link and zero pose of a frame: ``base``, a link or a tip.

        Raises:
            UnknownNameError: no such frame.
        """
        if name == "base":
            return self.base_link, Pose(UNTURNED, Vector(0, 0, 0))
        for limb in self.limbs:
            if limb.tip == name:
                return limb.link, limb.frame
        for link in self.links:
            if link.name == name:
                return link.name, link.frame
        raise UnknownNameError("frame", name, ("base", *self.tip_names, *self.link_names))

    def with_inertia_floor(self, mass: float = 1e-6, inertia: float = 1e-6) -> Robot:
        """The robot with every link at least so heavy: what simulators need for massless brackets."""

        def raised(link: Link) -> Link:
            i = link.inertia
            floor = Inertia(max(i.xx, inertia), max(i.yy, inertia), max(i.zz, inertia), i.xy, i.xz, i.yz)
            return replace(link, mass=max(link.mass, mass), inertia=floor)

        return replace(self, links=tuple(raised(link) for link in self.links))


def _named(items: tuple[Any, ...], name: str, what: str) -> Any:
    for item in items:
        if item.name == name:
            return item
    raise UnknownNameError(what, name, [item.name for item in items])
