"""A plan and the joints that follow it: all of a walk but its balance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from screwkin.errors import LimitError, SingularError, UnreachableError
from screwkin.gait.arms import unable_arms
from screwkin.gait.driven import Driven, arms_of, driven
from screwkin.gait.lengths import lengths_of
from screwkin.gait.linkages import dead_points
from screwkin.gait.plan import Plan, plan
from screwkin.gait.preview_plan import preview_plan
from screwkin.gait.realise import differentiate, posed_hands, positions
from screwkin.gait.record import Gait
from screwkin.gait.resting import held_arms
from screwkin.gait.slope import tilted
from screwkin.gait.stance import Stance, stance_of
from screwkin.ik.pose_solution import PoseSolution
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.joint_motion import JointMotion
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.rates import block_names
from screwkin.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Followed:
    """A plan and the joint motion that follows it.

    Attributes:
        drive: what moves.
        mechanism: of what moves.
        planned: T samples, in the world.
        solution: joint positions.
        motion: joint rates and accelerations.
        notes: why limbs rest, and which linkages come near a dead point.
    """

    drive: Driven
    mechanism: Mechanism
    planned: Plan
    solution: PoseSolution
    motion: JointMotion
    notes: tuple[str, ...]

    @property
    def sigma(self) -> dict[str, float]:
        """Least singular value of every block."""
        names = block_names(self.mechanism)
        return dict(zip(names, self.motion.sigma.min(axis=0).tolist(), strict=True))


Planner = Callable[[Mechanism, Gait, Stance, int], Plan]
"""What makes the plan of so many steps of a gait, for what moves."""


def follow(
    robot: Robot, gait: Gait, steps: int, at_rest: tuple[str, ...] = (), planner: Planner | None = None
) -> Followed:
    """Plan a gait and solve for the joints; an arm that cannot follow its hand rests at home.

    Args:
        robot: with two legs, soles and a ``home`` posture.
        gait: fitted to the robot.
        steps: number of steps, at least 1.
        at_rest: names of arms that rest in any case.
        planner: of the plan; default: that of the gait's kind.

    Raises:
        UnreachableError, SingularError, LimitError: a leg cannot follow; names limb, sample and time.
        GaitError, InputError, NoSolutionError: as ``plan`` and ``preview_plan``.
    """
    held = held_arms(robot)
    whole, notes = stance_of(robot), tuple(f"{arm} rests: {why}" for arm, why in held.items())
    at_rest = (*dict.fromkeys((*at_rest, *held)),)
    if gait.arms == "rest":
        at_rest = arms_of(robot)
    while True:
        drive = driven(robot, at_rest)
        mechanism, stance = closed_mechanism(drive.moving), drive.stance(whole)
        if unable := unable_arms(drive.moving, gait, stance, posed_hands(mechanism)):
            at_rest = (*at_rest, *unable)
            notes += tuple(_rests(robot, gait, arm, why) for arm, why in unable.items())
            continue
        try:
            if planner is not None:
                planned = planner(mechanism, gait, stance, steps)
            elif gait.kind == "geometric":
                planned = plan(gait, stance, steps)
            else:
                planned = preview_plan(mechanism, gait, stance, steps)
            solution = positions(mechanism, planned)
            near = dead_points(drive.moving, planned.time, solution.state.q)
            motion = differentiate(mechanism, planned, solution.state)
        except (UnreachableError, SingularError, LimitError) as error:
            if error.limb not in arms_of(robot):
                raise
            at_rest, notes = (*at_rest, error.limb), (*notes, _rests(robot, gait, error.limb, str(error)))
        else:
            return Followed(drive, mechanism, tilted(planned), solution, motion, (*notes, *near))


def _rests(robot: Robot, gait: Gait, arm: str, why: str) -> str:
    at_home = lengths_of(robot)["arm"]
    return f"{arm} rests: {why}; hand_drop is {gait.hand_drop:g}, at home {at_home:.3g}"
