"""Formulas of the whole body on a tape: poses, Jacobians, dynamics, ZMP.

Every one is the public function of the same name, or a part of it, without its checks.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import at, wrench_at
from screwkin.algebra.se3 import NO_TWIST, ZERO, Pose, Twist, Vector, X, Y, Z
from screwkin.compiler.records import Tape, identifier, matrix, pose_input, twist_input
from screwkin.dynamics import newton_euler
from screwkin.dynamics.newton_euler import GRAVITY, Bodies
from screwkin.dynamics.zmp import cart_table_zmp, zmp_from_wrench
from screwkin.kinematics import mass, positions
from screwkin.kinematics.formula import Formula
from screwkin.model.robot import Robot

BASIS = (*(Twist(e, ZERO) for e in (X, Y, Z)), *(Twist(ZERO, e) for e in (X, Y, Z)))


def _state(tape: Tape, robot: Robot) -> tuple[Pose, list[Scalar]]:
    return pose_input(tape, "T_world_base"), tape.input("q", len(robot.joints))


def _give_poses(tape: Tape, name: str, poses: Sequence[Pose]) -> None:
    tape.output(name, [x for pose in poses for x in matrix(pose)], len(poses), 4, 4)


def _give_columns(tape: Tape, name: str, columns: Sequence[Sequence[Scalar]]) -> None:
    rows = list(zip(*columns, strict=True))
    tape.output(name, [x for row in rows for x in row], len(rows), len(columns))


@Formula
def tip_poses(tape: Tape, robot: Robot) -> None:
    """World poses of all tips."""
    tape.title(identifier(robot.name, "tips"), f"World poses of the tips of {robot.name}.")
    T, q = _state(tape, robot)
    D = positions.link_displacements(robot, q)
    _give_poses(tape, "T_world_tip", [T @ positions.frame_pose(robot, D, x.tip) for x in robot.limbs])


@Formula
def link_poses(tape: Tape, robot: Robot) -> None:
    """World poses of all links."""
    tape.title(identifier(robot.name, "links"), f"World poses of the links of {robot.name}.")
    T, q = _state(tape, robot)
    D = positions.link_displacements(robot, q)
    _give_poses(tape, "T_world_link", [T @ (d @ x.frame) for d, x in zip(D, robot.links, strict=True)])


@Formula
def frame_pose(tape: Tape, robot: Robot, frame: str) -> None:
    """World pose of the base, a link or a tip."""
    tape.title(identifier(robot.name, frame, "pose"), f"World pose of {frame} of {robot.name}.")
    T, q = _state(tape, robot)
    pose = T @ positions.frame_pose(robot, positions.link_displacements(robot, q), frame)
    tape.output("T_world_frame", matrix(pose), 4, 4)


@Formula
def jacobian(tape: Tape, robot: Robot, frame: str, own: bool) -> None:
    """Screw Jacobian of a frame at its own origin, or at a point of the world."""
    tape.title(
        identifier(robot.name, frame, "jacobian", *([] if own else ["at_point"])),
        f"Jacobian of {frame} of {robot.name}: rows [omega; v at {'its origin' if own else 'the point'}],"
        " world axes; columns: twist of the base at the same point, joint rates.",
    )
    T, q = _state(tape, robot)
    D, turned = positions.link_displacements(robot, q), Pose(T.R, ZERO)
    p = (turned @ positions.frame_pose(robot, D, frame)).p if own else Vector(*tape.input("point", 3)) - T.p
    columns = positions.frame_jacobian(robot, positions.joint_twists(robot, D, turned), frame)
    joints = [at(p, columns[i]) if i in columns else NO_TWIST for i in range(len(q))]
    _give_columns(tape, "J", [[*c.omega, *c.v] for c in (*BASIS, *joints)])


@Formula
def limb_jacobian(tape: Tape, robot: Robot, limb: str) -> None:
    """Compact Jacobian of a tip: one column for every joint of its limb."""
    chosen = robot.limb(limb)
    tape.title(
        identifier(robot.name, chosen.name, "jacobian"),
        f"Jacobian of {chosen.tip} of {robot.name}: rows [omega; v of the tip's origin], base axes; a column"
        " for every joint of the limb.",
    )
    q = tape.input("q", len(robot.joints))
    D = positions.link_displacements(robot, q)
    tip = positions.frame_pose(robot, D, chosen.tip).p
    screws = positions.joint_screws(robot, D)
    columns = [at(tip, screws[i].twist) for i in robot.path_to(chosen.link)]
    _give_columns(tape, "J", [[*c.omega, *c.v] for c in columns])


@Formula
def center_of_mass(tape: Tape, robot: Robot) -> None:
    """World position of the centre of mass."""
    tape.title(identifier(robot.name, "com"), f"Centre of mass of {robot.name}, in the world.")
    T, q = _state(tape, robot)
    tape.output("com", T @ mass.center_of_mass(robot, positions.link_displacements(robot, q)))


@Formula
def com_jacobian(tape: Tape, robot: Robot) -> None:
    """Velocity of the centre of mass for the base's twist and every joint rate."""
    tape.title(
        identifier(robot.name, "com_jacobian"),
        f"Jacobian of the centre of mass of {robot.name}, world axes; columns: twist of the base at its"
        " origin, joint rates.",
    )
    T, q = _state(tape, robot)
    turned = Pose(T.R, ZERO)
    local = positions.link_displacements(robot, q)
    D, twists = [turned @ d for d in local], positions.joint_twists(robot, local, turned)
    c = mass.center_of_mass(robot, D)
    spin = [at(c, twist).v for twist in BASIS]
    _give_columns(tape, "J", [list(v) for v in (*spin, *mass.com_jacobian(robot, D, twists))])


@Formula
def momentum(tape: Tape, robot: Robot) -> None:
    """Momentum [angular about the CoM; linear], world axes."""
    tape.title(
        identifier(robot.name, "momentum"),
        f"Momentum of {robot.name} [angular about the centre of mass; linear], world axes.",
    )
    T, q = _state(tape, robot)
    qd, twist = tape.input("qd", len(q)), twist_input(tape, "base_twist")
    bodies = Bodies.of(robot, T.R, q)
    h = newton_euler.momentum(bodies, qd, twist)
    h = wrench_at(mass.center_of_mass(robot, bodies.poses), h)
    tape.output("momentum", [*h.m, *h.f])


@Formula
def mass_matrix(tape: Tape, robot: Robot) -> None:
    """Mass matrix for [base twist at the base origin, world axes; joint rates]."""
    tape.title(
        identifier(robot.name, "mass_matrix"),
        f"Mass matrix of {robot.name} for [twist of the base at its origin, world axes; joint rates].",
    )
    T, q = _state(tape, robot)
    _give_columns(tape, "M", newton_euler.mass_matrix(Bodies.of(robot, T.R, q)))


def _motion(tape: Tape, robot: Robot) -> tuple[list[Scalar], list[Scalar], Twist, Twist]:
    """Rates and accelerations of joints and base."""
    n = len(robot.joints)
    qd, qdd = tape.input("qd", n), tape.input("qdd", n)
    return qd, qdd, twist_input(tape, "base_twist"), twist_input(tape, "base_acceleration")


def _dynamics(tape: Tape, robot: Robot) -> tuple[Pose, tuple[Any, ...]]:
    """Base pose, and what the functions of ``newton_euler`` are told of bodies that move under gravity."""
    T, q = _state(tape, robot)
    moving = _motion(tape, robot)
    return T, (Bodies.of(robot, T.R, q), *moving, *tape.input("gravity", 1))


@Formula
def inverse_dynamics(tape: Tape, robot: Robot) -> None:
    """Wrench on the base about its origin, and torques of the joints."""
    tape.title(
        identifier(robot.name, "inverse_dynamics"),
        f"Wrench [m; f] on the base of {robot.name} about its origin, world axes, and efforts of the joints.",
    )
    _, dynamics = _dynamics(tape, robot)
    wrench, torques = newton_euler.inverse_dynamics(*dynamics)
    tape.output("force", [*wrench.m, *wrench.f, *torques])


@Formula
def ground_wrench(tape: Tape, robot: Robot) -> None:
    """Wrench that the ground must give, about the world origin."""
    tape.title(
        identifier(robot.name, "ground_wrench"),
        f"Wrench [m; f] that the ground gives {robot.name}, about the world origin, world axes.",
    )
    T, dynamics = _dynamics(tape, robot)
    wrench = wrench_at(-T.p, newton_euler.ground_wrench(*dynamics))
    tape.output("wrench", [*wrench.m, *wrench.f])


@Formula
def balance(tape: Tape, robot: Robot) -> None:
    """CoM, centroidal momentum, ground wrench, ZMP and the cart-table's ZMP."""
    tape.title(
        identifier(robot.name, "zmp"),
        "Centre of mass, momentum [angular about it; linear], ground wrench [m; f] about the world origin,"
        f" ZMP and cart-table ZMP of {robot.name}; world axes.",
    )
    T, q = _state(tape, robot)
    qd, qdd, twist, rate = _motion(tape, robot)
    bodies = Bodies.of(robot, T.R, q)
    wrench = newton_euler.ground_wrench(bodies, qd, qdd, twist, rate, GRAVITY)
    local = mass.center_of_mass(robot, bodies.poses)
    com = T.p + local
    h = wrench_at(local, newton_euler.momentum(bodies, qd, twist))
    rise = wrench.f * (1.0 / robot.mass)
    cart = cart_table_zmp(com, Vector(rise.x, rise.y, rise.z - GRAVITY), GRAVITY)
    about, zmp = wrench_at(-T.p, wrench), zmp_from_wrench(wrench, T.p)
    tape.output("com", com)
    tape.output("momentum", [*h.m, *h.f])
    tape.output("wrench", [*about.m, *about.f])
    tape.output("zmp", [zmp.x, zmp.y])
    tape.output("cart_table", [cart.x, cart.y])
