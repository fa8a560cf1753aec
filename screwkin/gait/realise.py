"""What a plan asks of the joints: positions by closing loops, rates and accelerations by Davies' method."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import (
    Twist,
    as_array,
    twist_from_array,
    vector_from_array,
)
from screwkin.gait.plan import Plan
from screwkin.gait.reach import refuse_turns, refuse_unreachable
from screwkin.ik.pose import solve_pose
from screwkin.ik.pose_solution import PoseSolution
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.mechanism.choice import RANK_TOLERANCE
from screwkin.mechanism.joint_motion import JointMotion, joint_motion
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.singularity import refuse_singular
from screwkin.model.state import State


def positions(mechanism: Mechanism, planned: Plan, guess: Array | None = None) -> PoseSolution:
    """Joint positions that follow a plan.

    Args:
        mechanism: of a robot whose joints follow from base and tips.
        planned: T samples.
        guess: (T, n) or (n,) [rad or m]; default: the home posture.

    Returns:
        PoseSolution of all samples; every one converged.

    Raises:
        UnreachableError, SingularError, LimitError: names limb, sample and time.
    """
    robot = mechanism.robot
    start = np.array(robot.posture("home").q) if guess is None else guess
    targets = {"base": planned.T_world_base, **targets_of(mechanism, planned)}
    free = free_rotations(mechanism)
    refuse_turns(robot, planned, free)
    solution = solve_pose(robot, targets, State(planned.T_world_base, start), free=free)
    refuse_unreachable(robot, planned, targets, solution, free)
    return solution


def free_rotations(mechanism: Mechanism) -> dict[str, tuple[str, ...]]:
    """By tip, the rotations of its virtual chain that follow."""
    free = {
        chain.name: tuple(
            c for c in chain.couplings if c[0] == "r" and f"{chain.name}.{c}" in mechanism.secondary
        )
        for chain in mechanism.chains
        if chain.limb is not None
    }
    return {tip: rotations for tip, rotations in free.items() if rotations}


def targets_of(mechanism: Mechanism, planned: Plan) -> dict[str, Array]:
    """Poses of the feet; of the hands the positions, or poses level with the waist where all is imposed.

    Args:
        mechanism: of a robot whose joints follow from base and tips.
        planned: T samples.
    """
    robot = mechanism.robot
    home = link_displacements(robot, list(robot.posture("home").q))
    targets: dict[str, Array] = dict(planned.T_world_tip)
    for hand, position in planned.hand_position.items():
        if hand not in posed_hands(mechanism):
            targets[hand] = position
            continue
        level = as_array(pose_in_base(robot, home, hand).R)
        pose = planned.T_world_base.copy()
        pose[:, :3, :3] = planned.T_world_base[:, :3, :3] @ level
        pose[:, :3, 3] = position
        targets[hand] = pose
    return targets


def posed_hands(mechanism: Mechanism) -> tuple[str, ...]:
    """Tips of arms the rotations of whose chains are imposed, not monitored."""
    tips = [limb.tip for limb in mechanism.robot.limbs if limb.kind == "arm"]
    return tuple(tip for tip in tips if any(name.startswith(f"{tip}.r") for name in mechanism.primary))


def differentiate(mechanism: Mechanism, planned: Plan, state: State) -> JointMotion:
    """Rates and accelerations of the joints from those of the plan, by Davies' method.

    Args:
        mechanism: of a robot whose joints follow from base and tips.
        planned: T samples.
        state: base poses (T, 4, 4) and joint positions (T, n) that follow the plan.

    Raises:
        SingularError: names limb, sample and time.
    """
    T, q = planned.T_world_base, state.q
    motion = joint_motion(mechanism, T, q, _imposed(planned, 0), _imposed(planned, 1))
    refuse_singular(mechanism, T, q, motion.sigma < RANK_TOLERANCE, planned.time)
    return motion


def _imposed(planned: Plan, order: int) -> dict[str, Twist]:
    """Twists (order 0) or their derivatives (1) of waist, feet and hands; hands turn with the waist."""
    base = twist_from_array((planned.base_twist, planned.base_acceleration)[order])
    tips = (planned.tip_twist, planned.tip_acceleration)[order]
    hands = (planned.hand_velocity, planned.hand_acceleration)[order]
    moved = {"waist": base, **{name: twist_from_array(value) for name, value in tips.items()}}
    return moved | {name: Twist(base.omega, vector_from_array(value)) for name, value in hands.items()}
