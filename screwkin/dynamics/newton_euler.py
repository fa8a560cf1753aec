"""Newton-Euler dynamics of a floating tree, as formulas over records.

Everything is in world axes about the base origin (a point fixed in the world where the base origin is at
that instant), so numbers stay small wherever the robot stands. Base motion is given classically: twist
[omega; v of the base origin] and its time derivative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from screwkin.algebra.scalar import Scalar, plus, times
from screwkin.algebra.screws import Wrench, at, power
from screwkin.algebra.se3 import ZERO, Pose, Rotation, Twist, Vector, X, Y, Z, bracket, cross, dot
from screwkin.kinematics.positions import joint_twists, link_displacements, per_coordinate, tree_rates
from screwkin.model.robot import Inertia, Robot

NO_WRENCH = Wrench(ZERO, ZERO)


@dataclass(frozen=True)
class Bodies:
    """Where every link stands and how every joint moves it: world axes, origin at the base origin."""

    robot: Robot
    poses: list[Pose]
    twists: list[Twist]

    @classmethod
    def of(cls, robot: Robot, R_world_base: Rotation, q: Sequence[Scalar]) -> Bodies:
        """Bodies at joint positions q with the base turned by ``R_world_base``."""
        turned = Pose(R_world_base, ZERO)
        D = link_displacements(robot, q)
        return cls(robot, [turned @ d for d in D], joint_twists(robot, D, turned))


def rotated(inertia: Inertia, R: Rotation) -> Inertia:
    """The inertia of the body after it is rotated by R, in the same axes."""
    back = R.T
    x, y, z = (R @ inertia.times(back @ axis) for axis in (X, Y, Z))
    return Inertia(x.x, y.y, z.z, x.y, x.z, y.z)


def link_twists(bodies: Bodies, qd: Sequence[Scalar], base: Twist) -> dict[str, Twist]:
    """Twist of every link, at the base origin."""
    robot = bodies.robot
    V, rates = {robot.base_link: base}, tree_rates(robot, qd)
    for i in robot.traversal:
        joint = robot.tree[i]
        V[joint.child] = V[joint.parent] + bodies.twists[i] * rates[i]
    return V


def link_accelerations(
    bodies: Bodies, V: dict[str, Twist], qd: Sequence[Scalar], qdd: Sequence[Scalar], base: Twist
) -> dict[str, Twist]:
    """Time derivative of every link's twist at the fixed point (screw acceleration)."""
    robot = bodies.robot
    v0 = V[robot.base_link]
    A = {robot.base_link: Twist(base.omega, base.v - cross(v0.omega, v0.v))}
    rates, changes = tree_rates(robot, qd), tree_rates(robot, qdd)
    for i in robot.traversal:
        joint, S = robot.tree[i], bodies.twists[i]
        A[joint.child] = A[joint.parent] + S * changes[i] + bracket(V[joint.parent], S) * rates[i]
    return A


def total_momentum(bodies: Bodies, qd: Sequence[Scalar], base: Twist) -> Wrench:
    """Momentum of the whole robot about the base origin: [angular; linear]."""
    V = link_twists(bodies, qd, base)
    total = NO_WRENCH
    for link, B in zip(bodies.robot.links, bodies.poses, strict=True):
        c, twist = B @ link.com, V[link.name]
        linear = at(c, twist).v * link.mass
        total = total + Wrench(rotated(link.inertia, B.R).times(twist.omega) + cross(c, linear), linear)
    return total


def link_wrenches(
    bodies: Bodies,
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base: Twist,
    base_rate: Twist,
    gravity: Scalar,
) -> dict[str, Wrench]:
    """Wrench that every link needs to move as it does against gravity, about the base origin."""
    V = link_twists(bodies, qd, base)
    A = link_accelerations(bodies, V, qd, qdd, base_rate)
    wrenches = {}
    for link, B in zip(bodies.robot.links, bodies.poses, strict=True):
        c, twist, rate = B @ link.com, V[link.name], A[link.name]
        inertia = rotated(link.inertia, B.R)
        acceleration = at(c, rate).v + cross(twist.omega, at(c, twist).v)
        force = (acceleration + Z * gravity) * link.mass
        spin = inertia.times(rate.omega) + cross(twist.omega, inertia.times(twist.omega))
        wrenches[link.name] = Wrench(spin + cross(c, force), force)
    return wrenches


def required_wrench(
    bodies: Bodies,
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base: Twist,
    base_rate: Twist,
    gravity: Scalar,
) -> Wrench:
    """Wrench that the ground must give: rate of momentum less gravity, about the base origin."""
    total = NO_WRENCH
    for wrench in link_wrenches(bodies, qd, qdd, base, base_rate, gravity).values():
        total = total + wrench
    return total


def wrench_and_efforts(
    bodies: Bodies,
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base: Twist,
    base_rate: Twist,
    gravity: Scalar,
) -> tuple[Wrench, list[Scalar]]:
    """Wrench on the base (about its origin) and joint torques (recursive Newton-Euler)."""
    return carried(bodies, link_wrenches(bodies, qd, qdd, base, base_rate, gravity))


def carried(bodies: Bodies, wrenches: Mapping[str, Wrench]) -> tuple[Wrench, list[Scalar]]:
    """Wrench on the base and joint efforts that supply every link's wrench, all about the base origin."""
    robot, W = bodies.robot, dict(wrenches)
    for i in reversed(robot.traversal):
        joint = robot.tree[i]
        W[joint.parent] = W[joint.parent] + W[joint.child]
    efforts = [power(W[joint.child], S) for joint, S in zip(robot.tree, bodies.twists, strict=True)]
    return W[robot.base_link], per_coordinate(robot, efforts)


@dataclass(frozen=True)
class Composite:
    """Mass, first moment and rotational inertia of several links about the base origin."""

    mass: Scalar
    moment: Vector
    inertia: Inertia

    def __add__(self, other: Composite) -> Composite:
        a, b = self.inertia, other.inertia
        total = Inertia(a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz)
        return Composite(self.mass + other.mass, self.moment + other.moment, total)

    def times(self, twist: Twist) -> Wrench:
        """Momentum of the composite body moving with a twist."""
        spin = self.inertia.times(twist.omega) + cross(self.moment, twist.v)
        return Wrench(spin, twist.v * self.mass + cross(twist.omega, self.moment))


def composite_mass_matrix(bodies: Bodies) -> list[list[Scalar]]:
    """Mass matrix for [base twist at the base origin; qd], by composite bodies.

    A coordinate that moves several joints has the sum of their rows and columns, each times its ratio.
    """
    robot = bodies.robot
    composite: dict[str, Composite] = {}
    for link, B in zip(robot.links, bodies.poses, strict=True):
        c, i = B @ link.com, rotated(link.inertia, B.R)
        m, cc = link.mass, dot(c, c)
        about = Inertia(
            i.xx + (cc - c.x * c.x) * m,
            i.yy + (cc - c.y * c.y) * m,
            i.zz + (cc - c.z * c.z) * m,
            i.xy - c.x * c.y * m,
            i.xz - c.x * c.z * m,
            i.yz - c.y * c.z * m,
        )
        composite[link.name] = Composite(m, c * m, about)
    for k in reversed(robot.traversal):
        joint = robot.tree[k]
        composite[joint.parent] = composite[joint.parent] + composite[joint.child]
    basis = [Twist(e, ZERO) for e in (X, Y, Z)] + [Twist(ZERO, e) for e in (X, Y, Z)]
    columns = [*basis, *bodies.twists]
    momenta = [composite[robot.base_link].times(e) for e in basis]
    momenta += [composite[j.child].times(S) for j, S in zip(robot.tree, bodies.twists, strict=True)]
    M: list[list[Scalar]] = [[0] * len(columns) for _ in columns]
    for row, h in enumerate(momenta):
        path = robot.path_to(robot.tree[row - 6].child) if row >= 6 else ()
        for column in (*range(6), *(6 + k for k in path)):
            M[row][column] = M[column][row] = power(h, columns[column])
    return _coupled_rows(robot, M) if robot.coupled else M


def _coupled_rows(robot: Robot, M: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    """The mass matrix for [base twist; qd] from that for the base and every joint of ``robot.tree``."""
    moved: list[list[tuple[int, Scalar]]] = [[(i, 1)] for i in range(6 + len(robot.joints))]
    for k, (i, ratio) in list(enumerate(robot.gears))[len(robot.joints) :]:
        moved[6 + i].append((6 + k, ratio))
    reduced: list[list[Scalar]] = [[0] * len(moved) for _ in moved]
    for i, rows in enumerate(moved):
        for j, columns in enumerate(moved[: i + 1]):
            for a, r in rows:
                for b, s in columns:
                    reduced[i][j] = plus(reduced[i][j], times(times(M[a][b], r), s))
            reduced[j][i] = reduced[i][j]
    return reduced
