"""Momentum, mass matrix, inverse dynamics and ground wrench of the whole body: every quantity once, here."""

from __future__ import annotations

from typing import Any

from screwkin.algebra.screws import Wrench, wrench_at
from screwkin.algebra.se3 import NO_TWIST, Pose, Twist, Vector
from screwkin.dynamics import newton_euler
from screwkin.dynamics.newton_euler import GRAVITY, Bodies
from screwkin.dynamics.zmp import cart_table_zmp, zmp_from_wrench
from screwkin.kinematics import mass
from screwkin.kinematics.body import check_mass
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Columns, Joints, Number
from screwkin.model.robot import Robot, refuse_closures

LOOPS = "secondary_rates of its closed_mechanism gives the loops' rates; forces in loops are not computed yet"


@formula
def momentum(
    robot: Robot, T_world_base: Pose, q: Joints, qd: Joints, base_twist: Twist | None = None
) -> Wrench:
    """Centroidal momentum of all links, world axes.

    Args:
        robot: n joints, with masses.
        state:
        qd: joint rates [rad/s or m/s].
        base_twist: [omega; v of the base origin], world axes [rad/s, m/s]; default: at rest.

    Returns:
        (..., 6): [angular about the centre of mass; linear], N m s and N s.

    Raises:
        InputError: no link has a mass.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> h = sk.momentum(robot, sk.home(robot), np.zeros(18), [0, 0, 0, 1, 0, 0])
        >>> bool(np.isclose(h[3], robot.mass))       # at 1 m/s along x
        True
    """
    check_mass(robot)
    bodies = Bodies.of(robot, T_world_base.R, q)
    h = newton_euler.total_momentum(bodies, qd, base_twist or NO_TWIST)
    return wrench_at(mass.mass_center(robot, bodies.poses), h)


@formula
def mass_matrix(robot: Robot, T_world_base: Pose, q: Joints) -> Columns:
    """Mass matrix of the floating body, by composite bodies.

    Args:
        robot: n joints, without loops of its own.
        state:

    Returns:
        M (..., 6+n, 6+n) for [base twist [omega; v of the base origin], world axes; joint rates].

    Raises:
        InputError: the robot has closures, which an open tree's mass matrix does not know.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> M = sk.mass_matrix(robot, sk.home(robot))
        >>> bool(np.allclose(M, M.T) and np.isclose(M[3, 3], robot.mass))
        True

    Source: Featherstone (2008), section 6.2.
    """
    refuse_closures(robot, "mass_matrix", LOOPS)
    return newton_euler.composite_mass_matrix(Bodies.of(robot, T_world_base.R, q))


@formula
def inverse_dynamics(
    robot: Robot,
    T_world_base: Pose,
    q: Joints,
    qd: Joints,
    qdd: Joints,
    base_twist: Twist | None = None,
    base_acceleration: Twist | None = None,
    gravity: Number = GRAVITY,
) -> tuple[Any, ...]:
    """Generalised force that a motion needs: wrench on the base and joint efforts (recursive Newton-Euler).

    Args:
        robot: n joints, without loops of its own.
        state:
        qd: joint rates [rad/s or m/s].
        qdd: joint accelerations [rad/s^2 or m/s^2].
        base_twist: [omega; v of the base origin], world axes; default: zero.
        base_acceleration: its time derivative [alpha; a]; default: zero.
        gravity: [m/s^2], along -z of the world; a number, or one for every sample.

    Returns:
        (..., 6+n): wrench [m; f] on the base about its origin, world axes [N m, N]; joint efforts [N m or N].

    Raises:
        InputError: the robot has closures, which the open tree's efforts do not know.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot, rest = sk.load_robot(sk.robot_names()[0]), np.zeros(18)
        >>> force = sk.inverse_dynamics(robot, sk.home(robot), rest, rest)
        >>> bool(np.isclose(force[5], 9.81 * robot.mass))      # held up by its base
        True

    Source: Featherstone (2008), section 5.3.
    """
    refuse_closures(robot, "inverse_dynamics", LOOPS)
    wrench, efforts = newton_euler.wrench_and_efforts(
        Bodies.of(robot, T_world_base.R, q),
        qd,
        qdd,
        base_twist or NO_TWIST,
        base_acceleration or NO_TWIST,
        gravity,
    )
    return (wrench, *efforts)


@formula
def ground_wrench(
    robot: Robot,
    T_world_base: Pose,
    q: Joints,
    qd: Joints,
    qdd: Joints,
    base_twist: Twist | None = None,
    base_acceleration: Twist | None = None,
    gravity: Number = GRAVITY,
) -> Wrench:
    """Wrench that the ground exerts on a robot that moves: rate of its momentum less its weight.

    Args:
        robot: n joints, with masses.
        state:
        qd: joint rates [rad/s or m/s].
        qdd: joint accelerations [rad/s^2 or m/s^2].
        base_twist: [omega; v of the base origin], world axes; default: zero.
        base_acceleration: its time derivative [alpha; a]; default: zero.
        gravity: [m/s^2], along -z of the world; a number, or one for every sample.

    Returns:
        (..., 6): [m; f] about the world origin, world axes [N m, N].

    Raises:
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot, rest = sk.load_robot(sk.robot_names()[0]), np.zeros(18)
        >>> wrench = sk.ground_wrench(robot, sk.home(robot), rest, rest)
        >>> bool(np.isclose(wrench[5], 9.81 * robot.mass))
        True
    """
    bodies = Bodies.of(robot, T_world_base.R, q)
    wrench = newton_euler.required_wrench(
        bodies, qd, qdd, base_twist or NO_TWIST, base_acceleration or NO_TWIST, gravity
    )
    return wrench_at(-T_world_base.p, wrench)


@formula
def balance(
    robot: Robot,
    T_world_base: Pose,
    q: Joints,
    qd: Joints,
    qdd: Joints,
    base_twist: Twist,
    base_acceleration: Twist,
) -> dict[str, Any]:
    """Centre of mass, centroidal momentum, ground wrench, ZMP and cart-table ZMP of a motion, world axes.

    Args:
        robot: n joints, with masses.
        state:
        qd: joint rates [rad/s or m/s].
        qdd: joint accelerations [rad/s^2 or m/s^2].
        base_twist: [omega; v of the base origin], world axes.
        base_acceleration: its time derivative.

    Returns:
        ``com`` (..., 3) [m], ``momentum`` (..., 6) as ``momentum`` does, ``wrench`` (..., 6) as
        ``ground_wrench`` does, ``zmp`` and ``cart_table`` (..., 2) [m].
    """
    check_mass(robot)
    bodies = Bodies.of(robot, T_world_base.R, q)
    wrench = newton_euler.required_wrench(bodies, qd, qdd, base_twist, base_acceleration, GRAVITY)
    local = mass.mass_center(robot, bodies.poses)
    com = T_world_base.p + local
    rise = wrench.f * (1.0 / robot.mass)
    cart = cart_table_zmp(com, Vector(rise.x, rise.y, rise.z - GRAVITY), GRAVITY)
    zmp = zmp_from_wrench(wrench, T_world_base.p)
    return {
        "com": com,
        "momentum": wrench_at(local, newton_euler.total_momentum(bodies, qd, base_twist)),
        "wrench": wrench_at(-T_world_base.p, wrench),
        "zmp": [zmp.x, zmp.y],
        "cart_table": [cart.x, cart.y],
    }
