"""Feedback in a simulation: what a robot feels of it, and a controller that answers cycle by cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Z, as_array, rotate, rotation_exp, vector_from_array
from screwkin.dynamics.terrain import Terrain
from screwkin.kinematics.limits import limited_joints, limits_of
from screwkin.model.robot import Robot
from screwkin.sim.backend import Observation
from screwkin.sim.perturbation import Perturbation
from screwkin.stabiliser.rhythm import CYCLE
from screwkin.stabiliser.walk import Felt, StabilisedWalk
from screwkin.trajectory import Trajectory

NOTHING = 1e-6
"""Force on a foot below which nothing presses on it [N]."""


class Controller(Protocol):
    """What commands a robot by what it feels; it remembers where it is."""

    period: float
    """Of a cycle [s]."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """Of the controller, as JSON data, and how it went."""
        ...

    def reset(self) -> Array:
        """Begin anew; joint positions (n,) at first."""
        ...

    def answer(self, felt: Felt) -> Array:
        """Joint positions (n,) to be reached a cycle later."""
        ...

    @property
    def contact(self) -> NDArray[np.bool_]:
        """Feet (feet,) that stand as the last answer is reached, in the order of the robot's legs."""
        ...


class WalkController:
    """A stabilised walk as a controller; without feedback it walks the same, open loop.

    What commands of the plan allow for its servos is allowed for here too, at the phase in which the walk is.
    No command is beyond a joint's limits, nor faster than its servo from the one before. deviation (n,): how
    far joint positions have come from the plan's at that phase, at most.
    """

    period = CYCLE

    def __init__(
        self, walk: StabilisedWalk, feedback: bool = True, commands: Trajectory | None = None
    ) -> None:
        self._allowed = np.zeros_like(walk.q) if commands is None else walk.allowance(commands)
        self.walk, self.feedback = walk, feedback
        self._low, self._high = limits_of(walk.body.robot)
        rate = [joint.velocity for joint in limited_joints(walk.body.robot)]
        self._farthest = np.array(rate) * self.period
        self.reset()

    @property
    def settings(self) -> Mapping[str, Any]:
        """Gains, and how far every joint has come from its plan [rad]."""
        names = self.walk.body.robot.joint_names
        far = dict(zip(names, self.deviation.tolist(), strict=True))
        return asdict(self.walk.gains) | ({"deviation": far} if self.feedback else {"open_loop": True})

    def reset(self) -> Array:
        """From the start of the walk."""
        self.course = self.walk.start
        self.deviation = np.zeros_like(self.course.q)
        self._last = np.clip(self.course.q + self._allowed[0], self._low, self._high)
        return self._last

    @property
    def contact(self) -> NDArray[np.bool_]:
        """Feet (feet,) that stand as the last answer is reached, in the order of the robot's legs."""
        legs = [limb.tip for limb in self.walk.body.robot.limbs if limb.kind == "leg"]
        swings = self.walk.swings(self.course)
        return np.array([tip != swings for tip in legs])

    def answer(self, felt: Felt) -> Array:
        """The next cycle's command."""
        self.course = self.walk.advanced(self.course, felt, self.feedback)
        now = self.walk.phase(self.course)
        self.deviation = np.maximum(self.deviation, np.abs(self.course.q - self.walk.q[now]))
        goal = np.clip(self.course.q + self._allowed[now], self._low, self._high)
        self._last = self._last + np.clip(goal - self._last, -self._farthest, self._farthest)
        return self._last


class Senses:
    """An IMU on the base, joint positions, and force cells in the feet, with their errors."""

    def __init__(self, robot: Robot, by: Perturbation, feet: tuple[str, str]) -> None:
        """Senses of a robot in a world; feet: tips of the right and the left one."""
        legs = [limb for limb in robot.limbs if limb.kind == "leg"]
        self._feet = [[leg.tip for leg in legs].index(tip) for tip in feet]
        self._links = {legs[i].link: k for k, i in enumerate(self._feet)}
        self._upright = Terrain(*by.slope).R if any(by.slope) else np.eye(3)
        self._by, self._drift = by, 0.0
        self._late: list[Felt] = []
        self._draw, self._wander = (np.random.default_rng([by.seed, k]) for k in (2, 3))

    def feel(self, seen: Observation, period: float) -> Felt:
        """What is felt of an observation; called once in every period [s]."""
        by = self._by
        turn = np.array(by.imu_bias) + by.imu_noise * self._draw.standard_normal(3)
        wrong = as_array(rotation_exp(vector_from_array(turn))) if turn.any() else np.eye(3)
        drift = as_array(rotate(Z, self._drift))
        rate = by.imu_rate_bias[2] + by.imu_rate_noise * self._wander.standard_normal()
        self._drift += rate * period
        attitude = drift @ self._upright @ seen.T_world_base[:3, :3] @ wrong
        force, pressure = self._pressed(seen) if by.cells else (np.ones(2), np.zeros((2, 2)))
        self._late.append(Felt(attitude, np.array(seen.q), force, pressure))
        ago = round(by.sense_lag / period)
        self._late = self._late[-(ago + 1) :]
        return self._late[0]

    def _pressed(self, seen: Observation) -> tuple[Array, Array]:
        """Forces (2,) along the floor's normal, and where they press in the tips' axes (2, 2)."""
        force, moment = np.zeros(2), np.zeros((2, 3))
        for touch in seen.contacts:
            foot = self._links.get(touch.link)
            if foot is not None:
                force[foot] += touch.force[2]
                moment[foot] += touch.force[2] * np.array(touch.point)
        pressure = np.zeros((2, 2))
        for k, i in enumerate(self._feet):
            if force[k] > NOTHING:
                T = seen.T_world_foot[i]
                pressure[k] = (T[:3, :3].T @ (moment[k] / force[k] - T[:3, 3]))[:2]
        return force, pressure


class Loop:
    """A controller in a simulation: senses once a cycle, and a command that goes evenly to its answer."""

    def __init__(self, controller: Controller, senses: Senses) -> None:
        self.controller, self._senses = controller, senses
        self._goal = controller.reset()
        self._rate = np.zeros_like(self._goal)
        self._left = 0
        self._newest = controller.contact
        self.contact = self._newest
        """Feet (feet,) bool that stand from the goal before to the newest."""

    def noted(self) -> dict[str, Any]:
        """The controller's settings, for a run's."""
        return dict(self.controller.settings)

    def command(self, seen: Observation, dt: float) -> tuple[Array, Array]:
        """Joint positions at the start of a step of dt [s], an even part of a cycle, and rates through it."""
        period = self.controller.period
        if self._left == 0:
            goal = self.controller.answer(self._senses.feel(seen, period))
            self._rate, self._goal, self._left = (goal - self._goal) / period, goal, round(period / dt)
            before, self._newest = self._newest, self.controller.contact
            self.contact = before & self._newest
        q = self._goal - self._left * dt * self._rate
        self._left -= 1
        return q, self._rate
