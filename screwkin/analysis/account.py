"""All that is reported about a trajectory: its balance, closure, singularity, and use of its servos."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, norm, pose_from_array, rotation_from_array, rotation_log, unstack
from screwkin.analysis.servo_shares import ServoShare, servo_shares
from screwkin.analysis.step_collisions import StepCollision, step_collisions
from screwkin.errors import TableError, TrajectoryError
from screwkin.files import text_sha256
from screwkin.gait.balance import Balance, zmp
from screwkin.gait.intended import intended
from screwkin.kinematics.limits import limited_joints
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.status import SINGULAR
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.least_values import least_values
from screwkin.mechanism.rates import block_names
from screwkin.mechanism.singularity import LimbSingularity, singularity_report
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.model.table import parse_robot
from screwkin.trajectory import Trajectory

_SAME_ZMP = 1e-6  # m: what other versions' rounding may change
_COARSE = 0.1  # s between samples: a step of a second would have ten


@dataclass(frozen=True, eq=False)
class Account:
    """A trajectory and what follows from it, computed anew from its positions, rates and accelerations."""

    robot: Robot
    trajectory: Trajectory
    motion: Trajectory
    """What the robot is to do: the trajectory itself, unless its joints are compensated commands."""
    balance: Balance
    sigma: Mapping[str, Array]
    """Least length-normalised singular value (T,) of every limb."""
    limbs: tuple[LimbSingularity, ...]
    """The least regular sample of every limb, with its cause."""

    @cached_property
    def closure(self) -> Mapping[str, tuple[float, float]]:
        """For every tip: largest distance [m] and angle [rad] from where the joints carry it."""
        return closure_of(self.robot, self.trajectory, self.motion)

    @property
    def max_closure(self) -> float:
        """Largest closure error [m and rad]: of this trajectory, and of its own solution."""
        solved = self.trajectory.meta.get("closure")
        own = [float(solved)] if isinstance(solved, int | float) else []
        return max([value for errors in self.closure.values() for value in errors] + own, default=0.0)

    @property
    def singular_samples(self) -> int:
        """Number of samples with a singular limb."""
        values = list(self.sigma.values())
        return int((np.min(values, axis=0) < SINGULAR).sum()) if values else 0

    @property
    def outside(self) -> Array:
        """Samples (T,) whose ZMP lies outside the support polygon, or where the ground would have to pull."""
        return (self.balance.margin < 0.0) | self.pulled

    @property
    def pulled(self) -> Array:
        """Samples (T,) at which the floor would have to hold the robot down: there is no ZMP there."""
        return np.asarray(self.balance.wrench[:, 5] <= 0.0)

    @property
    def boundaries(self) -> tuple[float, ...]:
        """Times at which steps begin and end [s], as recorded in the trajectory."""
        times = self.trajectory.meta.get("boundaries")
        sound = isinstance(times, list) and all(isinstance(t, int | float) for t in times)
        return tuple(map(float, times)) if isinstance(times, list) and sound else ()

    @property
    def steps(self) -> int | None:
        """Number of steps, if the trajectory records it."""
        steps = self.trajectory.meta.get("steps")
        return steps if isinstance(steps, int) else None

    @cached_property
    def collisions(self) -> tuple[StepCollision, ...] | None:
        """Links that enter each other, step by step; None where MuJoCo is not there to look."""
        return step_collisions(self.robot, self.motion, self.boundaries)

    @cached_property
    def servos(self) -> Mapping[str, ServoShare]:
        """For every joint: how much of its speed and torque the motion asks for."""
        return servo_shares(self.robot, self.motion)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What works on paper, but not on the servos or not for long."""
        fast, weak, beyond = [], [], []
        for joint in limited_joints(self.robot):
            share = self.servos[joint.name]
            if share.speed > 1.0:
                fast.append(f"{joint.name} {share.speed * joint.velocity:.1f} of {joint.velocity:.1f} rad/s")
            if (share.torque or 0.0) > 1.0:
                weak.append(f"{joint.name} {100 * (share.torque or 0.0):.0f} %")
            elif (share.line or 0.0) > 1.0 >= share.speed:
                beyond.append(f"{joint.name} {100 * (share.line or 0.0):.0f} % at {share.at:.2f} s")
        # The first in the words of a simulation's own warning, so that a page says it once.
        texts = (
            (fast, "planned joint speed above the servo's"),
            (weak, "planned joint torque above the servo's"),
            (beyond, "more torque than the servo has at the planned speed"),
        )
        noted = [f"{text}: {', '.join(joints)}" for joints, text in texts if joints]
        noted += map(str, self.collisions or ())
        gap = float(np.diff(self.trajectory.time).max())
        if gap > _COARSE:
            noted.append(f"samples are {gap:.3g} s apart; margins and spikes between them are not seen")
        if self.pulled.any():
            when = self.trajectory.time[int(self.pulled.argmax())]
            noted.append(f"the robot would leave the floor at {when:.2f} s: no ZMP exists there")
        near = [
            f"{limb.limb} comes near a singularity at {self.trajectory.time[limb.sample]:.2f} s: {limb.cause}"
            for limb in self.limbs
            if limb.near
        ]
        wrong = float(np.abs(self.balance.zmp - self.trajectory.zmp).max())
        changed = (
            [f"the recorded ZMP differs from the one computed anew by up to {1e3 * wrong:.3g} mm"]
            if wrong > _SAME_ZMP
            else []
        )
        notes = self.trajectory.meta.get("notes")
        return (*noted, *near, *changed, *(map(str, notes) if isinstance(notes, list) else ()))


def account_of(robot: Robot, trajectory: Trajectory) -> Account:
    """The account of a trajectory of that robot.

    Raises:
        InputError: joints or tips are not the robot's, or a foot has no sole. TrajectoryError: rates or
            accelerations so large that no forces can be computed.
    """
    check_tips(robot, trajectory)
    with np.errstate(over="ignore", invalid="ignore"):
        motion = intended(robot, trajectory)
        balance = zmp(robot, motion)
    finite = np.isfinite(np.hstack([balance.wrench, balance.zmp])).all(axis=1)
    if not finite.all():
        raise TrajectoryError(
            f"no finite ground wrench in sample {int(finite.argmin())}: "
            "positions, rates or accelerations are beyond reason"
        )
    mechanism = closed_mechanism(robot)
    state = State(trajectory.T_world_base, motion.q)
    sigma = least_values(mechanism, trajectory.T_world_base, motion.q)
    by_limb = dict(zip(block_names(mechanism), sigma.T, strict=True))
    return Account(robot, trajectory, motion, balance, by_limb, singularity_report(mechanism, state))


def recorded_robot(trajectory: Trajectory, path: str = "the trajectory") -> Robot:
    """The robot that a trajectory was planned for, from the table in its own ``meta``.

    Raises:
        TrajectoryError: the table is not there, damaged, or its SHA-256 is another one.
    """
    recorded = trajectory.meta.get("robot")
    text = recorded.get("table") if isinstance(recorded, dict) else None
    if not isinstance(recorded, dict) or not isinstance(text, str):
        raise TrajectoryError(f"{path}: meta holds no robot table; make it again with: screwkin walk")
    if text_sha256(text) != recorded.get("sha256"):
        raise TrajectoryError(
            f"{path}: the robot table in meta is not the one whose SHA-256 stands beside it; it was changed "
            "after the trajectory was made. Make it again with: screwkin walk"
        )
    try:
        return parse_robot(text, f"{path}, robot table")
    except TableError as error:
        raise TrajectoryError(f"{path}: its robot table is not readable by this version: {error}") from None


def closure_of(robot: Robot, trajectory: Trajectory, motion: Trajectory) -> dict[str, tuple[float, float]]:
    """For every tip: largest distance [m] and angle [rad] from where the joints of a motion carry it."""
    T = pose_from_array(trajectory.T_world_base)
    D = link_displacements(robot, unstack(motion.q))
    errors = {}
    for tip, recorded in trajectory.T_world_tip.items():
        reached = as_array(T @ pose_in_base(robot, D, tip), (trajectory.samples,))
        gap = np.linalg.norm(reached[:, :3, 3] - recorded[:, :3, 3], axis=1)
        turn = norm(rotation_log(rotation_from_array(reached[:, :3, :3] @ recorded[:, :3, :3].mT)))
        errors[tip] = (float(gap.max()), float(turn.max()))
    return errors


def check_tips(robot: Robot, trajectory: Trajectory) -> None:
    """Refuse a trajectory that names no feet, or tips that the robot has not.

    Raises:
        TrajectoryError: names them.
    """
    if not trajectory.feet:
        raise TrajectoryError("the trajectory names no feet; a ZMP needs soles on the floor")
    strange = [tip for tip in trajectory.T_world_tip if tip not in robot.tip_names]
    if strange:
        raise TrajectoryError(
            f"the trajectory has the tips {', '.join(strange)}; {robot.name} has {', '.join(robot.tip_names)}"
        )
