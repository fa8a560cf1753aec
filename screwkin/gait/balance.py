"""The balance of a motion: CoM, ground wrench, ZMP and its margin, from the dynamics of all links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pytrees import pytree
from screwkin.dynamics.on_floor import ground_margin, ground_reaction, soles_on_floor
from screwkin.dynamics.support import Spike, spikes
from screwkin.gait.ground import ground_of
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory, check_joints


@dataclass(frozen=True, eq=False)
@pytree("spikes")
class Balance:
    """ZMP, its margin and the ground wrench, over T samples.

    Attributes:
        zmp: (T, 2) from the multibody ground wrench [m].
        com: (T, 3) [m].
        wrench: (T, 6), the ground's [m; f] about the world origin [N m, N].
        margin: (T,) distance of the ZMP inside the support polygon [m], negative outside and in flight.
        spikes: local maxima of |GCoM - ZMP| above twice its median.
        cart_table: (T, 2) ZMP of a point mass at the CoM, for comparison [m].
    """

    zmp: Array
    com: Array
    wrench: Array
    margin: Array
    spikes: tuple[Spike, ...]
    cart_table: Array

    @property
    def distance(self) -> Array:
        """|GCoM - ZMP| (T,) [m]."""
        return np.asarray(np.linalg.norm(self.com[:, :2] - self.zmp, axis=1))


def zmp(robot: Robot, trajectory: Trajectory) -> Balance:
    """CoM, ZMP, margin and spikes of a trajectory, recomputed from its positions, rates and accelerations.

    Args:
        robot: n joints; every foot of the trajectory has a sole.
        trajectory: T samples.

    Returns:
        Balance, lengths in [m], world axes.

    Raises:
        InputError: the joints are not those of the robot, or a foot has no sole.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> balance = sk.zmp(robot, sk.walk(robot, sk.load_gait("walk"), steps=1))
        >>> bool(balance.margin.min() > 0)
        True
    """
    check_joints(robot, trajectory.joint_names)
    point, com, wrench, cart = ground_reaction(
        robot,
        trajectory.T_world_base,
        trajectory.q,
        trajectory.qd,
        trajectory.qdd,
        trajectory.base_twist,
        trajectory.base_acceleration,
    )
    soles = soles_on_floor(robot, trajectory.feet, trajectory.T_world_tip, ground_of(trajectory), wrench)
    margin = ground_margin(point, com, wrench, soles, trajectory.contact)
    return Balance(point, com, wrench, margin, spikes(trajectory.time, com[:, :2], point), cart)
