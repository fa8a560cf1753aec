"""Forces of the contacts that carry a robot, as a formula: the total that its motion needs, shared out.

Every contact is a patch of points. The sum of the squares of the points' forces is least when they are as if
each point stood on a spring and all of the ground moved as one body. So a contact's share of the total is the
momentum that its points would have, each a small mass, if all of them moved with one and the same twist.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from screwkin.algebra.linear import cramer
from screwkin.algebra.scalar import Scalar, plus, times, where
from screwkin.algebra.screws import Wrench, wrench_at
from screwkin.algebra.se3 import NO_TWIST, ZERO, Pose, Twist, Vector, cross, leaves
from screwkin.dynamics.joint_springs import beside_springs
from screwkin.dynamics.loops import Admitted, actuated_joints, refuse_loops
from screwkin.dynamics.newton_euler import (
    NO_WRENCH,
    Bodies,
    carried,
    link_wrenches,
    rotated,
)
from screwkin.errors import InputError
from screwkin.kinematics.formula import formula, refusing
from screwkin.kinematics.kinds import Joints, Number, TipNumbers, TipWrenches
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.records import Inertia
from screwkin.model.robot import Robot

Point = tuple[float, float, float]


@dataclass(frozen=True)
class ContactPatch:
    """Where a tip touches what carries it.

    Attributes:
        tip: of a limb.
        points: in the frame of the tip [m]: one, which transmits no moment, or at least three that are not in
            line; none: the corners of its sole, else the tip itself.
        friction: coefficient of friction; None: it holds any force, as a firm grip does.
        normal: unit vector in the frame of the tip, from what carries it into the robot.

    Example:
        >>> import screwkin as sk
        >>> sk.ContactPatch("right_foot", friction=0.6).tip
        'right_foot'
    """

    tip: str
    points: tuple[Point, ...] = ()
    friction: float | None = None
    normal: Point = (0.0, 0.0, 1.0)


def contact_points(robot: Robot, patch: ContactPatch) -> list[Vector]:
    """The points of a patch in the frame of its tip."""
    if patch.points:
        return [Vector(*point) for point in patch.points]
    limb = robot.limb(patch.tip)
    for sole in robot.soles:
        if sole.limb == limb.name:
            return [limb.frame.inverse @ corner for corner in sole.corners]
    return [ZERO]


def standing(robot: Robot) -> tuple[ContactPatch, ...]:
    """A patch for every sole."""
    return tuple(ContactPatch(robot.limb(sole.limb).tip) for sole in robot.soles)


@dataclass(frozen=True)
class _Carrier:
    """A patch where it is: world axes, origin at the base origin; of mass 1, scaled by its weight."""

    link: str
    tip: Vector
    center: Vector
    inertia: Inertia
    weight: Scalar

    def wrench(self, twist: Twist, about: Vector) -> Wrench:
        """Its share at the tip, of the twist of all points about a point."""
        force = (twist.v + cross(twist.omega, self.center - about)) * self.weight
        moment = self.inertia.times(twist.omega) * self.weight
        return Wrench(moment + cross(self.center - self.tip, force), force)


def _carrier(bodies: Bodies, patch: ContactPatch, weight: Scalar) -> _Carrier:
    robot = bodies.robot
    limb, points = robot.limb(patch.tip), contact_points(robot, patch)
    pose = bodies.poses[robot.link_names.index(limb.link)] @ limb.frame
    middle = mean(points)
    own = [x * (1 / len(points)) for x in _sums(_about(point - middle) for point in points)]
    return _Carrier(limb.link, pose.p, pose @ middle, rotated(Inertia(*own), pose.R), weight)


def mean(points: Sequence[Vector]) -> Vector:
    """The middle of some points; of one the point itself."""
    return points[0] if len(points) == 1 else sum(points[1:], points[0]) * (1 / len(points))


def _about(r: Vector) -> list[Scalar]:
    """Inertia of a unit mass at r about the origin: xx yy zz xy xz yz."""
    x, y, z = (times(a, a) for a in r)
    mixed = (times(r.x, r.y), times(r.x, r.z), times(r.y, r.z))
    return [plus(y, z), plus(x, z), plus(x, y), *(-m for m in mixed)]


def _sums(rows: Iterable[Sequence[Scalar]]) -> list[Scalar]:
    total: list[Scalar] = [0] * 6
    for row in rows:
        total = [plus(have, x) for have, x in zip(total, row, strict=True)]
    return total


def shared_wrench(carriers: Sequence[_Carrier], needed: Wrench) -> tuple[list[Wrench], Scalar]:
    """The carriers' wrenches at their tips that sum to one about the base origin, and how spread they are.

    The spread is 1 for points all around, 0 where they are in line or none carries.
    """
    first, *others = carriers
    weight = sum((c.weight for c in others), first.weight)
    about = sum((c.center * c.weight for c in others), first.center * first.weight) * (1 / weight)
    rows = ([x * c.weight for x in _sums([leaves(c.inertia), _about(c.center - about)])] for c in carriers)
    xx, yy, zz, xy, xz, yz = _sums(rows)
    here = wrench_at(about, needed)
    omega, volume = cramer([Vector(xx, xy, xz), Vector(xy, yy, yz), Vector(xz, yz, zz)], here.m)
    twist = Twist(Vector(*omega), here.f * (1 / weight))
    size = (xx + yy + zz) * (1 / 3)
    return [carrier.wrench(twist, about) for carrier in carriers], volume / (size * size * size)


@refusing(refuse_loops)
@formula
def contact_distribution(
    robot: Robot,
    T_world_base: Pose,
    q: Joints,
    qd: Joints,
    qdd: Joints,
    weights: TipNumbers,
    internal: TipWrenches | None = None,
    base_twist: Twist | None = None,
    base_acceleration: Twist | None = None,
    gravity: Number = GRAVITY,
    patches: tuple[ContactPatch, ...] = (),
    actuated: tuple[str, ...] | None = None,
) -> dict[str, Any]:
    """Wrenches of contacts and joint efforts of a motion: ``contact_forces`` without its checks.

    Args:
        robot: n joints, with masses and a floating base.
        state: closed, where the robot has loops of its own.
        qd: joint rates [rad/s or m/s].
        qdd: joint accelerations [rad/s^2 or m/s^2].
        weights: how much every tip's contact takes part; 0 where it is not in contact.
        internal: wrenches [m; f] at the tips, world axes [N m, N]: of all distributions the one nearest to
            them is taken; default: zero, the least one.
        base_twist: [omega; v of the base origin], world axes; default: zero.
        base_acceleration: its time derivative [alpha; a]; default: zero.
        gravity: [m/s^2], along -z of the world.
        patches: of the tips that may be in contact; default: all soles.
        actuated: joints that have motors, as for ``inverse_dynamics``.

    Returns:
        ``wrenches`` (..., patches, 6): [m; f] on every tip about its origin, world axes [N m, N]; ``efforts``
        (..., n) [N m or N]; ``spread`` (...): 0 (or NaN) where the points in contact can transmit no wrench.
    """
    if robot.base == "fixed":
        raise InputError(
            f"{robot.name} has a fixed base, which takes what contacts leave: forces of contacts are not "
            "determined; inverse_dynamics gives the wrench on the base"
        )
    motors = actuated_joints(robot, actuated)
    loops = Admitted.at(robot, q) if robot.loops else None
    if loops:
        qd, qdd = loops.motion(robot, qd, qdd)
    bodies = Bodies.of(robot, T_world_base.R, q)
    needed = link_wrenches(bodies, qd, qdd, base_twist or NO_TWIST, base_acceleration or NO_TWIST, gravity)
    chosen = patches or standing(robot)
    if not chosen:
        raise InputError(f"{robot.name} has no soles; name the tips that are in contact, as contacts=[...]")
    places = [robot.tip_names.index(patch.tip) for patch in chosen]
    carriers = [_carrier(bodies, p, weights[k]) for p, k in zip(chosen, places, strict=True)]
    wished = [
        _bearable(robot, p, c, internal[k]) if internal else NO_WRENCH
        for p, c, k in zip(chosen, carriers, places, strict=True)
    ]
    left = sum(needed.values(), NO_WRENCH)
    for carrier, wish in zip(carriers, wished, strict=True):
        left = left - wrench_at(-carrier.tip, wish)
    more, spread = shared_wrench(carriers, left)
    wrenches = [wish + extra for wish, extra in zip(wished, more, strict=True)]
    for carrier, wrench in zip(carriers, wrenches, strict=True):
        needed[carrier.link] = needed[carrier.link] - wrench_at(-carrier.tip, wrench)
    _, efforts = carried(bodies, needed)
    efforts = beside_springs(robot, efforts, q, qd)
    if loops:
        efforts = loops.efforts(loops.generalised(efforts), motors)
    rows = [leaves(wrench) for wrench in wrenches]
    return {
        "wrenches": [list(column) for column in zip(*rows, strict=True)],
        "efforts": efforts,
        "spread": [spread],
    }


def _bearable(robot: Robot, patch: ContactPatch, carrier: _Carrier, wish: Wrench) -> Wrench:
    """What of a wished wrench a patch can transmit: none out of contact, at one point no moment."""
    on = where(carrier.weight > 0, 1.0, 0.0)
    force = wish.f * on
    if len(contact_points(robot, patch)) > 1:
        return Wrench(wish.m * on, force)
    return Wrench(cross(carrier.center - carrier.tip, force), force)
