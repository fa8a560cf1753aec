"""A robot that follows its commands exactly: no masses, no contacts. It serves tests and previews."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.kinematics.body import tip_poses
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.sim.backend import Command, Observation


class KinematicBackend:
    """Perfect tracking of joints and base, without forces."""

    name = "kinematic"
    servo = "rigid"

    def __init__(self, robot: Robot, dt: float = 0.01) -> None:
        self.dt = dt
        self.settings: Mapping[str, Any] = {"dt": dt}
        self._robot = robot
        self._legs = [k for k, limb in enumerate(robot.limbs) if limb.kind == "leg"]
        self._steps = 0
        self._pose: Array | None = None
        self._q = self._qd = np.zeros(len(robot.joints))

    def reset(self, state: State) -> Observation:
        """Place the robot at rest in a state, and time at 0."""
        self._steps = 0
        self._pose = np.array(state.T_world_base, dtype=float)
        self._q = np.array(state.q, dtype=float)
        self._qd = np.zeros_like(self._q)
        return self.observe()

    def step(self, command: Command) -> None:
        """Follow the command at once: joints at the end of the step, base where the plan sees it."""
        self._steps += 1
        self._pose = np.array(command.T_world_base, dtype=float)
        self._qd = np.array(command.qd, dtype=float)
        self._q = np.array(command.q, dtype=float) + self.dt * self._qd

    def observe(self) -> Observation:
        """The present state."""
        if self._pose is None:
            raise InputError("the simulation has no state yet; call reset first")
        feet = np.zeros((0, 4, 4))
        if self._legs:
            feet = tip_poses(self._robot, State(self._pose, self._q))[self._legs]
        return Observation(
            time=self._steps * self.dt,
            T_world_base=self._pose.copy(),
            q=self._q.copy(),
            qd=self._qd.copy(),
            torque=np.zeros_like(self._q),
            T_world_foot=feet,
            ankle_wrench=np.full((len(feet), 6), np.nan),
            contacts=(),
        )

    def close(self) -> None:
        """Nothing to release."""
