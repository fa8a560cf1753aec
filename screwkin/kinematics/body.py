"""Poses, Jacobians and the centre of mass of the whole body: every quantity is defined once, here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Displacement, at
from screwkin.algebra.se3 import NO_TWIST, ZERO, Pose, Twist, Vector, X, Y, Z
from screwkin.errors import InputError
from screwkin.kinematics import mass, positions
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Columns, Joints
from screwkin.model.robot import Robot

BASIS = (*(Twist(e, ZERO) for e in (X, Y, Z)), *(Twist(ZERO, e) for e in (X, Y, Z)))
"""The six unit twists [omega; v] of the base."""


@formula
def link_poses(robot: Robot, T_world_base: Pose, q: Joints) -> list[Pose]:
    """World pose of every link, by successive screw displacements.

    Args:
        robot: L links, n joints.
        state:

    Returns:
        Ts_world_link (..., L, 4, 4), translation in [m], in ``robot.link_names`` order; a link's frame is its
        ``frame`` in the table.

    Raises:
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> sk.link_poses(robot, sk.home(robot)).shape
        (19, 4, 4)

    Source: paper A, eq. 2-3.
    """
    D = _turned(robot, T_world_base, q)
    return [_world(T_world_base, d @ link.frame) for d, link in zip(D, robot.links, strict=True)]


@formula
def frame_pose(robot: Robot, T_world_base: Pose, q: Joints, frame: str) -> Pose:
    """World pose of ``base``, a link, a tip or a named frame.

    Args:
        robot: n joints.
        state:
        frame: its name.

    Returns:
        T_world_frame (..., 4, 4), translation in [m].

    Raises:
        UnknownNameError: no such frame; the message lists all frames.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> T = sk.frame_pose(robot, sk.home(robot), "right_foot")
        >>> bool(abs(T[2, 3]) < 1e-9)           # at home the foot stands on the floor
        True

    Source: paper A, eq. 2-3.
    """
    return _world(T_world_base, positions.pose_in_base(robot, _turned(robot, T_world_base, q), frame))


@formula
def tip_poses(robot: Robot, T_world_base: Pose, q: Joints) -> list[Pose]:
    """World poses of the tips of all limbs.

    Args:
        robot: its limbs' tips are feet and hands.
        state:

    Returns:
        Ts_world_tip (..., tips, 4, 4), translation in [m], in ``robot.tip_names`` order.

    Raises:
        InputError: the robot has no limbs.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> sk.tip_poses(robot, sk.home(robot)).shape
        (4, 4, 4)
    """
    if not robot.limbs:
        raise InputError(f"{robot.name} has no limbs, so that it has no tips; write [[limb]] into its table")
    D = _turned(robot, T_world_base, q)
    return [_world(T_world_base, positions.pose_in_base(robot, D, limb.tip)) for limb in robot.limbs]


@formula
def jacobian(
    robot: Robot,
    T_world_base: Pose,
    q: Joints,
    frame: str,
    point: Vector | None = None,
    base_twist_at: Literal["base", "point"] = "base",
) -> Columns:
    """Screw Jacobian of a frame: its twist, world axes, per base twist and joint rates.

    Args:
        robot: n joints.
        state:
        frame: ``base``, a link or a tip.
        point: world point [m] at which the frame's velocity is taken; default: the frame's own origin.
        base_twist_at: where the velocity of the base is taken: at the ``"base"``'s origin, as everywhere
            else, or at the same ``"point"``: then its six columns are the identity.

    Returns:
        J (..., 6, 6+n), rows [omega; v at the point]. The first six columns multiply the base's twist [omega;
        v of the base origin] in world axes, as those of ``com_jacobian`` and ``mass_matrix`` do; the others
        the joint rates. Columns of joints that do not move the frame are zero.

    Raises:
        UnknownNameError: no such frame; the message lists all frames.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> J = sk.jacobian(robot, sk.home(robot), "right_foot")
        >>> twist = J @ np.r_[0, 0, 0, 1, 0, 0, np.zeros(18)]     # base and foot slide along x
        >>> twist.round(12).tolist()
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
    """
    D, turned = positions.link_displacements(robot, q), Pose(T_world_base.R, ZERO)
    p = (turned @ positions.pose_in_base(robot, D, frame)).p if point is None else point - T_world_base.p
    columns = positions.frame_jacobian(robot, positions.joint_twists(robot, D, turned), frame)
    if base_twist_at not in ("base", "point"):
        raise InputError(f"base_twist_at is {base_twist_at!r}; valid: base, point")
    base = [at(p, twist) for twist in BASIS] if base_twist_at == "base" else BASIS
    return [*base, *(at(p, columns[i]) if i in columns else NO_TWIST for i in range(len(q)))]


@formula
def limb_jacobian(robot: Robot, q: Joints, limb: str) -> Columns:
    """Compact Jacobian of a limb's tip, base axes: a column for every coordinate of the limb.

    Args:
        robot: n joints.
        state:
        limb: its name.

    Returns:
        J (..., 6, joints of the limb), rows [omega; v of the tip's origin].
    """
    chosen = robot.limb(limb)
    D = positions.link_displacements(robot, q)
    tip = positions.pose_in_base(robot, D, chosen.tip).p
    columns = positions.frame_jacobian(robot, positions.joint_twists(robot, D), chosen.tip)
    return [at(tip, column) for column in columns.values()]


@formula
def center_of_mass(robot: Robot, T_world_base: Pose, q: Joints) -> Vector:
    """World position of the centre of mass of all links.

    Args:
        robot: with masses.
        state:

    Returns:
        p_world_com (..., 3) [m].

    Raises:
        InputError: no link has a mass.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> sk.center_of_mass(robot, sk.home(robot)).shape
        (3,)
    """
    check_mass(robot)
    return T_world_base @ mass.mass_center(robot, positions.link_displacements(robot, q))


@formula
def com_jacobian(robot: Robot, T_world_base: Pose, q: Joints) -> Columns:
    """Jacobian of the centre of mass: its velocity, world axes, per base twist and joint rates.

    Args:
        robot: n joints, with masses.
        state:

    Returns:
        J (..., 3, 6+n). The first six columns multiply the base's twist [omega; v of the base origin], world
        axes, the others the joint rates.

    Raises:
        InputError: no link has a mass.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> sk.com_jacobian(robot, sk.home(robot)).shape
        (3, 24)
    """
    check_mass(robot)
    turned, local = Pose(T_world_base.R, ZERO), positions.link_displacements(robot, q)
    D, twists = [turned @ d for d in local], positions.joint_twists(robot, local, turned)
    c = mass.mass_center(robot, D)
    return [*(at(c, twist).v for twist in BASIS), *mass.mass_center_velocities(robot, D, twists)]


def _turned(robot: Robot, T: Pose, q: Sequence[Scalar]) -> list[Displacement]:
    """Displacements of all links, world axes, from the base origin."""
    return positions.link_displacements(robot, q, Displacement(T.R, ZERO, ZERO))


def _world(T: Pose, pose: Pose) -> Pose:
    """A pose in world axes from the base origin, from the world's origin."""
    return Pose(pose.R, T.p + pose.p)


def check_mass(robot: Robot) -> None:
    """Refuse a robot without mass.

    Raises:
        InputError: no link has a mass.
    """
    if not robot.is_symbolic and not robot.mass > 0:
        raise InputError(f"{robot.name} has no mass: every link of its table has mass 0, so it has no CoM")
