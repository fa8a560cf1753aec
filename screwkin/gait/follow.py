"""A plan and the joints that follow it: all of a walk but its balance."""

from __future__ import annotations

from dataclasses import dataclass

from screwkin.gait.driven import Driven, driven
from screwkin.gait.plan import Plan, plan
from screwkin.gait.preview_plan import preview_plan
from screwkin.gait.realise import differentiate, positions
from screwkin.gait.record import Gait
from screwkin.gait.stance import stance_of
from screwkin.ik.numeric import IkSettings
from screwkin.ik.pose_solution import PoseSolution
from screwkin.ik.whole_body import PRECISE
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.joint_motion import JointMotion
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Followed:
    """A plan, its mechanism of the driven joints, and their positions, rates and accelerations."""

    drive: Driven
    mechanism: Mechanism
    planned: Plan
    solution: PoseSolution
    motion: JointMotion


def follow(robot: Robot, gait: Gait, steps: int, settings: IkSettings = PRECISE) -> Followed:
    """Plan a gait and solve for the joints.

    Args:
        robot: with two legs, soles and a ``home`` posture.
        gait: fitted to the robot.
        steps: number of steps, at least 1.
        settings: of the inverse kinematics.

    Raises:
        UnreachableError, SingularError, LimitError: names limb, sample and time.
        GaitError, InputError, NoSolutionError: as ``plan`` and ``preview_plan``.
    """
    whole = stance_of(robot)
    drive = driven(robot)
    mechanism, stance = closed_mechanism(drive.moving), drive.stance(whole)
    if gait.kind == "preview":
        planned = preview_plan(mechanism, gait, stance, steps, settings)
    else:
        planned = plan(gait, stance, steps)
    solution = positions(mechanism, planned, settings=settings)
    return Followed(drive, mechanism, planned, solution, differentiate(mechanism, planned, solution.state))
