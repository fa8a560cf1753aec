"""Positions, Jacobians and dynamics of the body."""

from __future__ import annotations

from typing import Any

from screwkin.algebra.arrays import Array
from screwkin.dynamics import body
from screwkin.dynamics.newton_euler import GRAVITY
from screwkin.errors import InputError
from screwkin.kinematics.arrays import checked, or_rest, told
from screwkin.model.robot import Robot
from screwkin.model.state import State


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
    return body.link_poses(robot, told=told(robot, state))["T_world_link"]


def frame_pose(robot: Robot, state: State, frame: str) -> Array:
    """World pose (..., 4, 4) of ``base``, a link or a tip.

    Raises:
        UnknownNameError: no such frame; the message lists all frames.
    """
    robot.frame(frame)
    return body.frame_pose(robot, frame, told=told(robot, state))["T_world_frame"]


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
    robot.frame(frame)
    at = {} if point is None else {"point": ("point", point, 3)}
    return body.jacobian(robot, frame, point is None, told=told(robot, state, at))["J"]


def center_of_mass(robot: Robot, state: State) -> Array:
    """World position (..., 3) of the centre of mass [m].

    Raises:
        InputError: no link has a mass.
    """
    _check_mass(robot)
    return body.center_of_mass(robot, told=told(robot, state))["com"]


def com_jacobian(robot: Robot, state: State) -> Array:
    """Velocity of the CoM (..., 3, 6+n), world axes, per [base twist at the base origin; qd].

    Raises:
        InputError: no link has a mass.
    """
    _check_mass(robot)
    return body.com_jacobian(robot, told=told(robot, state))["J"]


def _check_mass(robot: Robot) -> None:
    if not robot.mass > 0:
        raise InputError(f"{robot.name} has no mass: every link of its table has mass 0, so it has no CoM")


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
    moving = {
        "qd": ("qd", qd, len(robot.joints)),
        "base_twist": ("base_twist", or_rest(base_twist), 6),
    }
    return body.momentum(robot, told=told(robot, state, moving))["momentum"]


def mass_matrix(robot: Robot, state: State) -> Array:
    """Mass matrix (..., 6+n, 6+n) for [base twist at the base origin, world axes; qd]."""
    return body.mass_matrix(robot, told=told(robot, state))["M"]


def _moving(
    robot: Robot, state: State, qd: Any, qdd: Any, base_twist: Any, base_acceleration: Any, gravity: Any
) -> dict[str, Array]:
    n = len(robot.joints)
    moving = {
        "qd": ("qd", qd, n),
        "qdd": ("qdd", qdd, n),
        "base_twist": ("base_twist", or_rest(base_twist), 6),
        "base_acceleration": ("base_acceleration", or_rest(base_acceleration), 6),
        "gravity": ("gravity", checked("gravity", gravity)[..., None], 1),
    }
    return told(robot, state, moving)


def inverse_dynamics(
    robot: Robot,
    state: State,
    qd: Any,
    qdd: Any,
    base_twist: Any = None,
    base_acceleration: Any = None,
    gravity: Any = GRAVITY,
) -> Array:
    """Generalised force (..., 6+n): wrench [m; f] on the base about its origin (world axes), joint torques.

    Args:
        robot: the robot.
        state: its configuration.
        qd: joint rates (..., n).
        qdd: joint accelerations (..., n).
        base_twist: [omega; v of the base origin], world axes (..., 6); default zero.
        base_acceleration: its time derivative [alpha; a]; default zero.
        gravity: [m/s^2], along -z of the world; a number, or one for every sample (...,).
    """
    moving = _moving(robot, state, qd, qdd, base_twist, base_acceleration, gravity)
    return body.inverse_dynamics(robot, told=moving)["force"]


def ground_wrench(
    robot: Robot,
    state: State,
    qd: Any,
    qdd: Any,
    base_twist: Any,
    base_acceleration: Any,
    gravity: Any = GRAVITY,
) -> Array:
    """Wrench (..., 6) that the ground must give, [m; f] about the world origin, world axes."""
    moving = _moving(robot, state, qd, qdd, base_twist, base_acceleration, gravity)
    return body.ground_wrench(robot, told=moving)["wrench"]
