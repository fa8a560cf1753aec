"""Screws, their displacements, and the transport of twists and wrenches.

A screw is a line with a pitch: axis ``s`` through ``s0``. A revolute joint has pitch 0, a helical one a
pitch in m/rad, a prismatic one the pitch ``INFINITE`` (its line's position then does not matter).
Equations are those of paper A in docs/papers.md.
"""

from __future__ import annotations

import math
from typing import Any

from screwkin.algebra.scalar import Scalar, over, plus, sqrt, times
from screwkin.algebra.se3 import UNTURNED, ZERO, Pose, Rotation, Twist, Vector, cross, dot, record, rotate
from screwkin.errors import InputError

INFINITE = math.inf
"""Pitch of a pure translation."""

_ALIGNED = 2.0**-50
"""A component of a unit vector this near to 0 or 1 [1] is one: the rounding of a few products."""


@record
class Screw:
    """An axis: unit vector s, a point s0 on it [m], pitch [m/rad] (``INFINITE`` for translation)."""

    s: Vector
    s0: Vector
    pitch: Scalar = 0

    @property
    def is_translation(self) -> bool:
        """True for infinite pitch."""
        return isinstance(self.pitch, float) and math.isinf(self.pitch)

    @property
    def twist(self) -> Twist:
        """Normalised screw (paper A, eq. 4): [s; s0 x s + h s], or [0; s] for a translation."""
        if self.is_translation:
            return Twist(ZERO, self.s)
        return Twist(self.s, cross(self.s0, self.s) + self.s * self.pitch)

    def flattened(self) -> tuple[tuple[Any, ...], Scalar]:
        """Leaves and static part for JAX: an infinite pitch is the joint's kind, not a number."""
        return ((self.s, self.s0), INFINITE) if self.is_translation else ((self.s, self.s0, self.pitch), None)

    @classmethod
    def unflattened(cls, pitch: Scalar, leaves: tuple[Any, ...]) -> Screw:
        """The screw of such leaves and static part."""
        return cls(*leaves, *(() if pitch is None else (pitch,)))


@record
class Wrench:
    """Moment about the origin and force: [m; f], in N m and N."""

    m: Vector
    f: Vector

    def __add__(self, other: Wrench) -> Wrench:
        return Wrench(self.m + other.m, self.f + other.f)

    def __sub__(self, other: Wrench) -> Wrench:
        return Wrench(self.m - other.m, self.f - other.f)

    def __neg__(self) -> Wrench:
        return Wrench(-self.m, -self.f)

    def __mul__(self, factor: Scalar) -> Wrench:
        return Wrench(self.m * factor, self.f * factor)

    __rmul__ = __mul__


def displacement(screw: Screw, theta: Scalar) -> Pose:
    """Screw displacement (paper A, eq. 1-2): points of the axis only advance, by pitch * theta.

    theta is an angle [rad], for a translation the distance [m].
    """
    if screw.is_translation:
        return Pose(UNTURNED, screw.s * theta)
    turned = rotate(screw.s, theta)
    return Pose(turned, screw.s0 - turned @ screw.s0 + screw.s * times(screw.pitch, theta))


@record
class Displacement:
    """A rigid displacement by its rotation and by where it takes one point: ``seen`` goes to ``now``.

    It serves wherever a ``Pose`` does. With the points on the axes, a product of screw displacements costs
    what one of joint frames does: the way from axis to axis is a constant with few components. The rotation
    is ``outer @ inner``: behind a skew axis, ``inner`` is the constant turn that a joint frame would hold.
    """

    outer: Rotation
    seen: Vector
    now: Vector
    inner: Rotation = UNTURNED

    @property
    def R(self) -> Rotation:
        """The rotation."""
        turned: Rotation = self.outer if self.inner is UNTURNED else self.outer @ self.inner
        return turned

    @property
    def p(self) -> Vector:
        """Where it takes the origin."""
        return self @ ZERO

    def __matmul__(self, other: Any) -> Any:
        if isinstance(other, Vector):
            return self.now + self.outer @ (self.inner @ (other - self.seen))
        return Pose(self.outer @ (self.inner @ other.R), self @ other.p)

    @property
    def inverse(self) -> Displacement:
        """The displacement back."""
        return Displacement(self.R.T, self.now, self.seen)


AT_REST = Displacement(UNTURNED, ZERO, ZERO)


def advance(before: Displacement, screw: Screw, theta: Scalar) -> Displacement:
    """The displacement ``before``, after the screw's own: what the next body of a chain undergoes (eq. 3)."""
    s = before.inner @ screw.s
    now, axis = before @ screw.s0, before.outer @ s
    if screw.is_translation:
        return Displacement(before.outer, screw.s0, now + axis * theta, before.inner)
    now = now + axis * times(screw.pitch, theta)
    onto, along = _aligned(s)
    inner = before.inner if onto is UNTURNED else onto.T @ before.inner
    return Displacement(before.outer @ onto @ rotate(along, theta), screw.s0, now, inner)


def _aligned(s: Vector) -> tuple[Rotation, Vector]:
    """A constant turn, and the direction that it takes onto s: a coordinate axis, if s lies skew in a plane.

    Two turns about coordinate axes take fewer operations than one about a skew line.
    """
    if not all(isinstance(component, int | float) for component in s):
        return UNTURNED, s
    x, y, z = (round(c) if abs(c - round(c)) < _ALIGNED else c for c in s)
    match (x == 0, y == 0, z == 0):
        case (True, False, False):
            return Rotation(Vector(1, 0, 0), Vector(0, z, -y), Vector(0, y, z)), Vector(0, 0, 1)
        case (False, True, False):
            return Rotation(Vector(z, 0, -x), Vector(0, 1, 0), Vector(x, 0, z)), Vector(0, 0, 1)
        case (False, False, True):
            return Rotation(Vector(x, y, 0), Vector(-y, x, 0), Vector(0, 0, 1)), Vector(1, 0, 0)
    return UNTURNED, Vector(x, y, z)


def carry(pose: Pose | Displacement, screw: Screw) -> Screw:
    """The screw where the pose takes it."""
    s = pose.outer @ (pose.inner @ screw.s) if isinstance(pose, Displacement) else pose.R @ screw.s
    return Screw(s, pose @ screw.s0, screw.pitch)


def transport(pose: Pose, twist: Twist) -> Twist:
    """The twist in the frame to which ``pose`` takes coordinates (eq. 6): the adjoint action."""
    omega = pose.R @ twist.omega
    return Twist(omega, pose.R @ twist.v + cross(pose.p, omega))


def transport_wrench(pose: Pose, wrench: Wrench) -> Wrench:
    """The wrench in the frame to which ``pose`` takes coordinates: the coadjoint action."""
    force = pose.R @ wrench.f
    return Wrench(pose.R @ wrench.m + cross(pose.p, force), force)


def turn(rotation: Rotation, twist: Twist) -> Twist:
    """The twist with its components in rotated axes, same origin."""
    return Twist(rotation @ twist.omega, rotation @ twist.v)


def at(point: Vector, twist: Twist) -> Twist:
    """The same motion at another point: [omega; velocity of the body's point there]."""
    return Twist(twist.omega, twist.v + cross(twist.omega, point))


def wrench_at(point: Vector, wrench: Wrench) -> Wrench:
    """The same wrench with its moment taken about another point."""
    return Wrench(wrench.m - cross(point, wrench.f), wrench.f)


def power(wrench: Wrench, twist: Twist) -> Scalar:
    """Power of a wrench on a twist, both at the same point [W]."""
    return plus(dot(wrench.m, twist.omega), dot(wrench.f, twist.v))


def reciprocal_product(a: Twist, b: Twist) -> Scalar:
    """Reciprocal product of two screws as twists; zero when a wrench on one does no work on the other."""
    return plus(dot(a.omega, b.v), dot(a.v, b.omega))


def screw_from_twist(twist: Twist) -> tuple[Screw, Scalar]:
    """Axis, pitch and magnitude of a twist: Poinsot's decomposition.

    A twist of numbers without rotation gives infinite pitch; in a batch or in symbols every twist must turn.

    Raises:
        InputError: the twist is zero, so that it has no axis.
    """
    squared = dot(twist.omega, twist.omega)
    if isinstance(squared, int | float) and squared == 0:
        speed = sqrt(dot(twist.v, twist.v))
        if isinstance(speed, int | float) and speed == 0:
            raise InputError("the zero twist has no screw axis")
        return Screw(twist.v / speed, ZERO, INFINITE), speed
    rate = sqrt(squared)
    pitch = over(dot(twist.omega, twist.v), squared)
    return Screw(twist.omega / rate, cross(twist.omega, twist.v) / squared, pitch), rate
