"""Momentum, mass matrix, inverse dynamics and ground wrench of the whole body: every quantity once, here."""

from __future__ import annotations

from typing import Any

from screwkin.algebra.screws import Wrench, wrench_at
from screwkin.algebra.se3 import NO_TWIST, Pose, Twist, Vector
from screwkin.dynamics import newton_euler
from screwkin.dynamics.joint_springs import beside_springs
from screwkin.dynamics.loops import Admitted, actuated_joints, refuse_held, refuse_loops
from screwkin.dynamics.newton_euler import Bodies
from screwkin.dynamics.zmp import cart_table_zmp, zmp_from_wrench
from screwkin.kinematics import mass
from screwkin.kinematics.body import check_mass
from screwkin.kinematics.formula import formula, refusing
from screwkin.kinematics.kinds import Columns, Joints, Number
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.robot import Robot


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


@refusing(refuse_loops)
@formula
def mass_matrix(robot: Robot, T_world_base: Pose, q: Joints) -> Columns:
    """Mass matrix of the floating body, by composite bodies; of a robot with loops in minimal coordinates.

    Args:
        robot: n joints, of which d drive: all of them, unless the robot has closures (``driving_joints``).
        state: closed, where the robot has loops of its own.

    Returns:
        M (..., 6+d, 6+d) for [base twist [omega; v of the base origin], world axes; rates of the joints that
        drive, in table order].

    Raises:
        InputError: a loop is open, or closures hold the robot on the floor.
        SingularError: the joints that drive do not determine those that follow, at the state.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> M = sk.mass_matrix(robot, sk.home(robot))
        >>> bool(np.allclose(M, M.T) and np.isclose(M[3, 3], robot.mass))
        True
        >>> four_bar = sk.load_robot("linkages/four-bar")
        >>> sk.mass_matrix(four_bar, sk.home(four_bar)).shape        # one joint drives
        (7, 7)

    Source: Featherstone (2008), section 6.2; loops: projection on the motions that Davies' N admits.
    """
    refuse_held(robot, "mass_matrix")
    M = newton_euler.composite_mass_matrix(Bodies.of(robot, T_world_base.R, q))
    return Admitted.at(robot, q).reduced(M) if robot.loops else M


@refusing(refuse_loops)
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
    actuated: tuple[str, ...] | None = None,
) -> tuple[Any, ...]:
    """Generalised force that a motion needs: wrench on the base and joint efforts (recursive Newton-Euler).

    Where the robot has loops of its own, qd and qdd are read of the joints that drive; the others follow.

    Args:
        robot: n joints.
        state: closed, where the robot has loops of its own.
        qd: joint rates [rad/s or m/s].
        qdd: joint accelerations [rad/s^2 or m/s^2].
        base_twist: [omega; v of the base origin], world axes; default: zero.
        base_acceleration: its time derivative [alpha; a]; default: zero.
        gravity: [m/s^2], along -z of the world; a number, or one for every sample.
        actuated: a tuple of the joints that have motors; default: ``mechanism.linkages.motor_joints``.
            Where they are more than the motions, the sum of the squares of their efforts is least.

    Returns:
        (..., 6+n): wrench [m; f] on the base about its origin, world axes [N m, N]; joint efforts [N m or N],
        0 at joints without motors; at joints with a spring what the motion needs beside spring and damper.

    Raises:
        UnknownNameError: an actuated joint is none.
        InputError: too few are actuated; a loop is open, or closures hold the robot on the floor.
        SingularError: the joints that drive, or those with motors, do not determine the motion.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot, rest = sk.load_robot(sk.robot_names()[0]), np.zeros(18)
        >>> force = sk.inverse_dynamics(robot, sk.home(robot), rest, rest)
        >>> bool(np.isclose(force[5], 9.81 * robot.mass))      # held up by its base
        True

    Source: Featherstone (2008), section 5.3; loops: virtual power on the motions that Davies' N admits.
    """
    refuse_held(robot, "inverse_dynamics")
    motors = actuated_joints(robot, actuated)
    loops = Admitted.at(robot, q) if robot.loops else None
    if loops:
        qd, qdd = loops.motion(robot, qd, qdd)
    wrench, efforts = newton_euler.wrench_and_efforts(
        Bodies.of(robot, T_world_base.R, q),
        qd,
        qdd,
        base_twist or NO_TWIST,
        base_acceleration or NO_TWIST,
        gravity,
    )
    efforts = beside_springs(robot, efforts, q, qd)
    if loops:
        efforts = loops.efforts(loops.generalised(efforts), motors)
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
