"""Screws, their displacements, and the transport of twists and wrenches.

A screw is a line with a pitch: axis ``s`` through ``s0``. A revolute joint has pitch 0, a helical one a
pitch in m/rad, a prismatic one the pitch ``INFINITE`` (its line's position then does not matter).
"""

from __future__ import annotations

import math

from screwkin.scalar import Scalar, plus, times
from screwkin.se3 import UNTURNED, Pose, Rotation, Twist, Vector, cross, dot, record, rotate

INFINITE = math.inf
"""Pitch of a pure translation."""


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
        """Normalised screw (Bioloid paper, eq. 4): [s; s0 x s + h s], or [0; s] for a translation."""
        if self.is_translation:
            return Twist(Vector(0, 0, 0), self.s)
        return Twist(self.s, cross(self.s0, self.s) + self.s * self.pitch)


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
    """Screw displacement (Bioloid paper, eq. 1-2): points of the axis only advance, by pitch * theta.

    theta is an angle [rad], for a translation the distance [m].
    """
    if screw.is_translation:
        return Pose(UNTURNED, screw.s * theta)
    turned = rotate(screw.s, theta)
    return Pose(turned, screw.s0 - turned @ screw.s0 + screw.s * times(screw.pitch, theta))


def carry(pose: Pose, screw: Screw) -> Screw:
    """The screw where the pose takes it."""
    return Screw(pose.R @ screw.s, pose @ screw.s0, screw.pitch)


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
    """The same motion told at another point: [omega; velocity of the body's point there]."""
    return Twist(twist.omega, twist.v + cross(twist.omega, point))


def wrench_at(point: Vector, wrench: Wrench) -> Wrench:
    """The same wrench with its moment taken about another point."""
    return Wrench(wrench.m - cross(point, wrench.f), wrench.f)


def power(wrench: Wrench, twist: Twist) -> Scalar:
    """Power of a wrench on a twist told at the same point [W]."""
    return plus(dot(wrench.m, twist.omega), dot(wrench.f, twist.v))


def reciprocal_product(a: Twist, b: Twist) -> Scalar:
    """Reciprocal product of two screws as twists; zero when a wrench on one does no work on the other."""
    return plus(dot(a.omega, b.v), dot(a.v, b.omega))


def screw_from_twist(twist: Twist) -> tuple[Screw, Scalar]:
    """Axis, pitch and magnitude of a twist that turns (omega not 0): Poinsot's decomposition."""
    squared = dot(twist.omega, twist.omega)
    rate = squared**0.5
    pitch = dot(twist.omega, twist.v) / squared
    s0 = cross(twist.omega, twist.v) * (1 / squared)
    return Screw(twist.omega * (1 / rate), s0, pitch), rate
