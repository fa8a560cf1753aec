"""Positions, Jacobians and dynamics of the body."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.api.arrays import Array, checked, compiles, joint_scalars, parts, twist_of
from screwkin.dynamics import newton_euler
from screwkin.errors import InputError
from screwkin.kernel import body
from screwkin.kernel.run import run
from screwkin.kinematics import mass, positions
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.scalar import is_jax
from screwkin.screw import at, wrench_at
from screwkin.se3 import NO_TWIST, ZERO, Pose, Twist, X, Y, Z, as_array, vector_from_array


def home(robot: Robot, posture: str = "home") -> State:
    """A named posture of the table: base upright over the world origin, at the posture's height.

    Raises:
        UnknownNameError: the table has no such posture.
    """
    chosen = robot.posture(posture)
    T = np.eye(4)
    T[2, 3] = chosen.base_height
    return State(T, np.array(chosen.q, dtype=float))


def link_poses(robot: Robot, state: State) -> Array:
    """World pose of every link, by successive screw displacements.

    Args:
        robot: L links, n joints.
        state: T_world_base (..., 4, 4) [m]; q (..., n) [rad or m].

    Returns:
        (..., L, 4, 4), in ``robot.link_names`` order; a link's frame is its ``frame`` in the table.

    Raises:
        ShapeError: wrong shape, NaN or infinity, or a base pose that is not rigid.

    Source: paper A, eq. 2-3.
    """
    T, q, batch = parts(robot, state)
    if compiles(state, batch):
        return run(body.link_poses(robot), vars(state))["T_world_link"]
    D = positions.link_displacements(robot, q)
    return as_array([T @ (d @ link.frame) for d, link in zip(D, robot.links, strict=True)], batch)


def frame_pose(robot: Robot, state: State, frame: str) -> Array:
    """World pose (..., 4, 4) of ``base``, a link or a tip.

    Raises:
        UnknownNameError: no such frame; the message lists all frames.
    """
    T, q, batch = parts(robot, state)
    if frame in robot.tip_names and compiles(state, batch):
        tips = run(body.tip_poses(robot), vars(state))["T_world_tip"]
        return np.ascontiguousarray(tips[..., robot.tip_names.index(frame), :, :])
    return as_array(T @ positions.frame_pose(robot, positions.link_displacements(robot, q), frame), batch)


def jacobian(robot: Robot, state: State, frame: str, point: Any = None) -> Array:
    """Screw Jacobian (..., 6, 6+n) of a frame, world axes, rows [omega; v at the point].

    The first six columns multiply the base's twist **told at the same point** (they are the identity), the
    others the joint rates; columns of joints off the frame's path are zero.

    Args:
        robot: the robot.
        state: its configuration.
        frame: ``base``, a link or a tip.
        point: world point (..., 3) [m] at which twists are told; default: the frame's own origin.
    """
    T, q, batch = parts(robot, state)
    turned = Pose(T.R, ZERO)
    D = positions.link_displacements(robot, q)
    if point is None:
        p = (turned @ positions.frame_pose(robot, D, frame)).p
    else:
        p = vector_from_array(checked("point", point, 3)) - T.p
    columns = positions.frame_jacobian(robot, positions.joint_twists(robot, D, turned), frame)
    basis = [Twist(e, ZERO) for e in (X, Y, Z)] + [Twist(ZERO, e) for e in (X, Y, Z)]
    joints = [at(p, columns[i]) if i in columns else NO_TWIST for i in range(len(q))]
    return _last_axes_swapped(as_array([*basis, *joints], batch))


def _last_axes_swapped(array: Array) -> Array:
    return array.swapaxes(-1, -2)


def center_of_mass(robot: Robot, state: State) -> Array:
    """World position (..., 3) of the centre of mass [m].

    Raises:
        InputError: no link has a mass.
    """
    _check_mass(robot)
    T, q, batch = parts(robot, state)
    if compiles(state, batch):
        return run(body.mass_center(robot), vars(state))["com"]
    return as_array(T @ mass.center_of_mass(robot, positions.link_displacements(robot, q)), batch)


def com_jacobian(robot: Robot, state: State) -> Array:
    """Velocity of the CoM (..., 3, 6+n), world axes, per [base twist at the base origin; qd].

    Raises:
        InputError: no link has a mass.
    """
    _check_mass(robot)
    T, q, batch = parts(robot, state)
    turned = Pose(T.R, ZERO)
    local = positions.link_displacements(robot, q)
    D, twists = [turned @ d for d in local], positions.joint_twists(robot, local, turned)
    c = mass.center_of_mass(robot, D)
    spin = [at(c, Twist(e, ZERO)).v for e in (X, Y, Z)]
    return _last_axes_swapped(as_array([*spin, X, Y, Z, *mass.com_jacobian(robot, D, twists)], batch))


def _check_mass(robot: Robot) -> None:
    if not robot.mass > 0:
        raise InputError(f"{robot.name} has no mass: every link of its table has mass 0, so it has no CoM")


def _bodies(robot: Robot, state: State) -> tuple[newton_euler.Bodies, tuple[int, ...]]:
    T, q, batch = parts(robot, state)
    return newton_euler.Bodies.of(robot, T.R, q), batch


def momentum(robot: Robot, state: State, qd: Any, base_twist: Any = None) -> Array:
    """Centroidal momentum (..., 6): [angular about the CoM; linear], world axes, N m s and N s.

    Args:
        robot: the robot.
        state: its configuration.
        qd: joint rates (..., n).
        base_twist: [omega; v of the base origin] in world axes (..., 6); default at rest.

    Raises:
        InputError: no link has a mass.
    """
    _check_mass(robot)
    T, q, batch = parts(robot, state)
    if compiles(state, batch) and not (is_jax(qd) or is_jax(base_twist)):
        moving = {
            "qd": checked("qd", qd, len(robot.joints)),
            "base_twist": np.zeros(6) if base_twist is None else checked("base_twist", base_twist, 6),
        }
        return run(body.centroidal_momentum(robot), vars(state) | moving)["momentum"]
    bodies = newton_euler.Bodies.of(robot, T.R, q)
    h = newton_euler.momentum(bodies, joint_scalars(robot, "qd", qd), twist_of("base_twist", base_twist))
    c = mass.center_of_mass(robot, bodies.poses)
    h = wrench_at(c, h)
    return as_array(Twist(h.m, h.f), batch)


def mass_matrix(robot: Robot, state: State) -> Array:
    """Mass matrix (..., 6+n, 6+n) for [base twist at the base origin, world axes; qd]."""
    bodies, batch = _bodies(robot, state)
    return as_array(newton_euler.mass_matrix(bodies), batch)


def inverse_dynamics(
    robot: Robot,
    state: State,
    qd: Any,
    qdd: Any,
    base_twist: Any = None,
    base_acceleration: Any = None,
    gravity: float = newton_euler.GRAVITY,
) -> Array:
    """Generalised force (..., 6+n): wrench [m; f] on the base about its origin (world axes), joint torques.

    Args:
        robot: the robot.
        state: its configuration.
        qd: joint rates (..., n).
        qdd: joint accelerations (..., n).
        base_twist: [omega; v of the base origin], world axes (..., 6); default zero.
        base_acceleration: its time derivative [alpha; a]; default zero.
        gravity: [m/s^2], along -z of the world.
    """
    bodies, batch = _bodies(robot, state)
    wrench, torques = newton_euler.inverse_dynamics(
        bodies,
        joint_scalars(robot, "qd", qd),
        joint_scalars(robot, "qdd", qdd),
        twist_of("base_twist", base_twist),
        twist_of("base_acceleration", base_acceleration),
        gravity,
    )
    return as_array([*wrench.m, *wrench.f, *torques], batch)


def ground_wrench(
    robot: Robot,
    state: State,
    qd: Any,
    qdd: Any,
    base_twist: Any,
    base_acceleration: Any,
    gravity: float = newton_euler.GRAVITY,
) -> Array:
    """Wrench (..., 6) that the ground must give, [m; f] about the world origin, world axes."""
    T, q, batch = parts(robot, state)
    wrench = newton_euler.ground_wrench(
        newton_euler.Bodies.of(robot, T.R, q),
        joint_scalars(robot, "qd", qd),
        joint_scalars(robot, "qdd", qdd),
        twist_of("base_twist", base_twist),
        twist_of("base_acceleration", base_acceleration),
        gravity,
    )
    about = wrench_at(-T.p, wrench)
    return as_array(Twist(about.m, about.f), batch)
