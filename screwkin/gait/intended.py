"""The motion behind commands that allow for elastic servos: what the robot is to do, not what it is told."""

from __future__ import annotations

from dataclasses import replace

from screwkin.gait.compensation import change_rates
from screwkin.ik.pose import solve_pose
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.trajectory import Trajectory

_ALL = 6
"""A limb of so many joints holds its tip's whole pose; one of fewer, its place."""


def intended(robot: Robot, trajectory: Trajectory) -> Trajectory:
    """The trajectory with the joint positions and rates of its motion, itself if it is not compensated.

    A compensated trajectory keeps the poses of base and tips; joints are solved for them again.

    Raises:
        UnreachableError, SingularError, LimitError: a pose that the file tells is out of reach.
    """
    if "compensation" not in trajectory.meta:
        return trajectory
    targets = {"base": trajectory.T_world_base}
    for limb in robot.limbs:
        pose = trajectory.T_world_tip[limb.tip]
        whole = limb.tip in trajectory.feet or len(robot.path_to(limb.link)) >= _ALL
        targets[limb.tip] = pose if whole else pose[:, :3, 3]
    solution = solve_pose(robot, targets, State(trajectory.T_world_base, trajectory.q))
    solution.raise_on_failure(robot, trajectory.time)
    q = solution.state.q
    return replace(trajectory, q=q, qd=trajectory.qd - change_rates(trajectory.time, trajectory.q - q))
