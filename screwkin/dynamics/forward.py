"""Forward dynamics: what a robot does under efforts of its joints and a wrench on its base."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from screwkin.algebra.linear import definite
from screwkin.algebra.scalar import Scalar, minus
from screwkin.algebra.screws import Wrench
from screwkin.algebra.se3 import NO_TWIST, Pose, Twist, Vector, leaves
from screwkin.dynamics import newton_euler
from screwkin.dynamics.joint_springs import refuse_bending, with_joint_springs
from screwkin.dynamics.loops import Admitted, refuse_held, refuse_loops
from screwkin.dynamics.newton_euler import NO_WRENCH, Bodies
from screwkin.kinematics.formula import formula, refusing
from screwkin.kinematics.kinds import Joints, Number
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.robot import Robot


@refusing(refuse_loops)
@formula
def forward_dynamics(
    robot: Robot,
    T_world_base: Pose,
    q: Joints,
    qd: Joints,
    efforts: Joints,
    base_twist: Twist | None = None,
    base_wrench: Wrench | None = None,
    gravity: Number = GRAVITY,
) -> tuple[Any, ...]:
    """Accelerations of base and joints under efforts: the inverse of ``inverse_dynamics``.

    Args:
        robot: n joints, with masses; what is fixed to the world has a base that rests.
        state: closed, where the robot has loops of its own.
        qd: joint rates [rad/s or m/s]; of a robot with loops those of the joints that drive are read.
        efforts: of all joints [N m or N]; those of motors at joints that follow do work too. Springs and
            dampers of passive joints, which the table gives, act beside them.
        base_twist: [omega; v of the base origin], world axes; default: zero.
        base_wrench: [m; f] on a floating base about its origin, world axes [N m, N]; default: zero.
        gravity: [m/s^2], along -z of the world; a number, or one for every sample.

    Returns:
        (..., 6+n): time derivative of the base twist [alpha; a], 0 of a fixed base; joint accelerations
        [rad/s^2 or m/s^2], those that follow included.

    Raises:
        InputError: a loop is open, closures hold the robot on the floor, or links bend.
        SingularError: the joints that drive do not determine those that follow, at the state.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot, rest = sk.load_robot(sk.robot_names()[0]), np.zeros(18)
        >>> falling = sk.forward_dynamics(robot, sk.home(robot), rest, rest)
        >>> bool(np.allclose(falling[:6], [0, 0, 0, 0, 0, -9.81]))
        True

    Source: Featherstone (2008), section 6.5; loops: virtual power on the motions that Davies' N admits.
    """
    refuse_held(robot, "forward_dynamics")
    refuse_bending(robot, "forward_dynamics")
    twist = base_twist or NO_TWIST
    bodies = Bodies.of(robot, T_world_base.R, q)
    M, still = newton_euler.composite_mass_matrix(bodies), [0] * len(robot.joints)
    loops = Admitted.at(robot, q) if robot.loops else None
    bias = still
    if loops:
        qd, bias = loops.motion(robot, qd, still)
        M = loops.reduced(M)
    needed, own = newton_euler.wrench_and_efforts(bodies, qd, bias, twist, NO_TWIST, gravity)
    joints = [minus(a, b) for a, b in zip(with_joint_springs(robot, efforts, q, qd), own, strict=True)]
    if loops:
        joints = loops.generalised(joints)
    if robot.base == "fixed":
        base, driven = NO_TWIST, definite([row[6:] for row in M[6:]], joints)
    else:
        found = definite(M, [*leaves((base_wrench or NO_WRENCH) - needed), *joints])
        base, driven = Twist(Vector(*found[:3]), Vector(*found[3:6])), found[6:]
    return (base, *(_followed(loops, bias, driven) if loops else driven))


def _followed(loops: Admitted, bias: Sequence[Scalar], driven: Sequence[Scalar]) -> list[Scalar]:
    """Accelerations of all joints from those of the joints that drive, and what rates alone cause."""
    return [a + b for a, b in zip(loops.combined(driven), bias, strict=True)]
