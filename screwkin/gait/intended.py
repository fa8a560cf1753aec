"""The motion behind commands that allow for elastic servos: where the robot is to go."""

from __future__ import annotations

from dataclasses import replace

from screwkin.gait.compensation import change_rates
from screwkin.gait.driven import POSE, at_rest, driven
from screwkin.gait.realise import free_rotations
from screwkin.ik.pose import solve_pose
from screwkin.mechanism.choice import closed_mechanism
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.trajectory import Trajectory


def intended(robot: Robot, trajectory: Trajectory) -> Trajectory:
    """The trajectory with the joint positions and rates of its motion, itself if it is not compensated.

    A compensated trajectory keeps the poses of base and tips; joints are solved for them again, and those
    that a gait does not drive rest at home.

    Args:
        robot: with a ``home`` posture.
        trajectory: of a walk of that robot.

    Raises:
        UnreachableError, SingularError, LimitError: a pose that the file holds is out of reach.
    """
    if "compensation" not in trajectory.meta:
        return trajectory
    drive = driven(robot, at_rest(trajectory))
    moving, targets = drive.moving, {"base": trajectory.T_world_base}
    for limb in moving.limbs:
        pose = drive.upright(limb.tip, trajectory.T_world_tip[limb.tip])
        whole = limb.tip in trajectory.feet or len(moving.leading(limb.link)) >= POSE
        targets[limb.tip] = pose if whole else pose[:, :3, 3]
    guess = State(trajectory.T_world_base, trajectory.q[:, drive.joints])
    solution = solve_pose(moving, targets, guess, free=free_rotations(closed_mechanism(moving)))
    solution.raise_on_failure(moving, trajectory.time)
    q = drive.positions(solution.state.q)
    return replace(trajectory, q=q, qd=trajectory.qd - change_rates(trajectory.time, trajectory.q - q))
