"""Which arms cannot follow their hands, before a walk is planned: hands move relative to the waist."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.se3 import as_array
from screwkin.errors import LimitError, SingularError, UnreachableError
from screwkin.gait.hands import hands_motion
from screwkin.gait.motion import Motion
from screwkin.gait.record import Gait
from screwkin.gait.stance import Stance
from screwkin.ik.closed import recognised
from screwkin.ik.numeric import ONE_START
from screwkin.ik.pose import solve_pose
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot
from screwkin.model.state import State

SAMPLES = 33
"""Of two steps, after which the hands' motion repeats."""


def unable_arms(robot: Robot, gait: Gait, stance: Stance, pose: tuple[str, ...]) -> dict[str, str]:
    """Arms without closed form that do not follow their hands from home, and why.

    Args:
        robot: of moving joints.
        gait: its hands.
        stance: of that robot.
        pose: names of the hands that keep their orientation of the home posture.

    Returns:
        By limb, what fails.
    """
    still = np.zeros((SAMPLES, 4))
    phase = Motion(np.linspace(0.0, 2.0, SAMPLES), np.ones(SAMPLES), np.zeros(SAMPLES))
    hands = hands_motion(gait, stance, Motion(still, still, still), phase)
    base = as_array(stance.T_waist_base).astype(float)
    home = np.array(robot.posture("home").q, dtype=float)
    D = link_displacements(robot, home.tolist())
    failed = {}
    for hand, motion in hands.items():
        name, whole = robot.limb(hand).name, hand in pose
        if recognised(SerialChain.of(robot, name), not whole):
            continue
        target = motion.value
        if whole:
            target = np.tile(base @ as_array(pose_in_base(robot, D, hand)).astype(float), (SAMPLES, 1, 1))
            target[:, :3, 3] = motion.value
        solution = solve_pose(robot, {hand: target}, State(base, home), settings=ONE_START)
        try:
            solution.raise_on_failure(robot)
        except (UnreachableError, SingularError, LimitError) as error:
            failed[name] = str(error)
    return failed
