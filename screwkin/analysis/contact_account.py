"""Forces along a trajectory: wrenches of feet and efforts of joints, planned and simulated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.account import Account
from screwkin.analysis.engines import PROVING, Engine, SimulatedCompliance, opened
from screwkin.analysis.readiness import VERDICT
from screwkin.analysis.verdict import verdict_from_json
from screwkin.dynamics.contact_forces import ContactForces, contact_forces
from screwkin.dynamics.support import sole_corners
from screwkin.errors import InputError
from screwkin.files import read_file
from screwkin.gait.ground import ground_of
from screwkin.gait.pitch import recorded_angles
from screwkin.kinematics.limits import limited_joints
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.state import State
from screwkin.sim.compliant import SpringServos
from screwkin.sim.measure import ForceRecord, force_record
from screwkin.sim.run import simulate

PRESSING = 0.05
"""Share of the robot's weight on a foot from which its centre of pressure is shown."""


@dataclass(frozen=True, eq=False)
class ForceAccount:
    """Wrenches of feet and efforts of joints along a trajectory.

    Attributes:
        account: of the trajectory.
        forces: wrenches (T, feet, 6) at the tips, world axes, and efforts (T, n), by the planned motion.
        simulated: the same by a simulator, None where none ran.
        engine: its name.
    """

    account: Account
    forces: ContactForces
    simulated: ForceRecord | None = None
    engine: str = ""

    @property
    def feet(self) -> tuple[str, ...]:
        """Names of the feet."""
        return self.forces.tips

    @cached_property
    def sizes(self) -> Array:
        """Force (T, feet) on every foot [N]."""
        return np.asarray(np.linalg.norm(self.forces.wrenches[..., 3:], axis=-1))

    @cached_property
    def friction(self) -> Array:
        """Least coefficient of friction (T, feet) that holds every foot; NaN where nothing presses on it."""
        f = self.forces.wrenches[..., 3:]
        pressing = np.where(self._pressing, f[..., 2], np.nan)
        return np.asarray(np.hypot(f[..., 0], f[..., 1]) / pressing)

    @cached_property
    def pressure(self) -> Array:
        """Centre of pressure (T, feet, 2) in every foot's frame [m]; NaN where little presses on it."""
        trajectory, points = self.account.trajectory, []
        for k, foot in enumerate(self.feet):
            R = trajectory.T_world_tip[foot][:, :3, :3].swapaxes(-1, -2)
            m, f = ((R @ self.forces.wrenches[:, k, part, None])[..., 0] for part in (slice(3), slice(3, 6)))
            height = float(sole_corners(self.account.robot, foot)[:, 2].mean())
            vertical = np.where(self._pressing[:, k], f[:, 2], np.nan)
            x, y = (-m[:, 1] + height * f[:, 0]) / vertical, (m[:, 0] + height * f[:, 1]) / vertical
            points.append(np.stack([x, y], axis=-1))
        return np.stack(points, axis=1)

    @property
    def _pressing(self) -> Array:
        weight = PRESSING * GRAVITY * float(self.account.robot.mass)
        return np.asarray(self.forces.wrenches[..., 5] > weight)

    @cached_property
    def use(self) -> dict[str, float]:
        """Largest effort of every joint as a share of its limit; 0 where there is none."""
        largest = np.abs(self.forces.efforts).max(axis=0)
        return {
            joint.name: float(size / joint.effort)
            for joint, size in zip(limited_joints(self.account.robot), largest, strict=True)
        }


def forces_of(account: Account, friction: float | None) -> ForceAccount:
    """Forces of a trajectory's motion on the feet that it has on the floor.

    Raises:
        NoSolutionError: at a sample no forces within friction carry it, or no foot is on the floor.
        InputError: its gait turns feet onto edges of their soles.
    """
    trajectory, motion = account.trajectory, account.motion
    if turned := recorded_angles(trajectory):
        raise InputError(
            f"forces are shared among the corners of whole soles, and {turned} of this walk turn soles onto"
            " their edges; validate it, which simulates them, or plan it without"
        )
    forces = contact_forces(
        account.robot,
        State(motion.T_world_base, motion.q),
        motion.qd,
        motion.qdd,
        dict(zip(trajectory.feet, trajectory.contact.T, strict=True)),
        None,
        motion.base_twist,
        motion.base_acceleration,
        friction=friction,
    )
    return ForceAccount(account, forces)


def validated_with(path: Path, account: Account) -> tuple[Engine, str] | None:
    """Engine and servos of the validation beside a trajectory; None where there is none of it with forces."""
    verdict = path.with_name(VERDICT)
    if not verdict.is_file():
        return None
    try:
        found = verdict_from_json(read_file(verdict).decode("utf-8"))
    except (InputError, OSError, UnicodeDecodeError):
        return None
    names = [name for name in PROVING if name in found.engine.split("+")]
    if not names or found.trajectory_sha256 != account.trajectory.sha256 or found.servo == SpringServos.name:
        return None
    return ("mujoco" if names[0] == "mujoco" else "pybullet"), found.servo


def simulated_forces(
    account: Account, engine: Engine, servo: str, progress: Callable[[float], None] = lambda share: None
) -> ForceRecord:
    """Forces of the feet and torques of the servos while a simulator plays a trajectory."""
    compliance = SimulatedCompliance().on(servo).for_trajectory(account.robot, account.trajectory)
    commands = compliance.commands(account.robot, account.trajectory)
    backend = opened(account.robot, engine, compliance, terrain=ground_of(account.trajectory))
    try:
        run = simulate(account.robot, commands, backend, progress=progress, start=account.motion.q[0])
    finally:
        backend.close()
    return force_record(run)
