"""Elastic servos in PyBullet: every joint is a spring and a damper between its command and its link.

Position control in PyBullet is a constraint on velocities, which no static load deflects; it cannot stand for
an elastic servo. Here the joint's torque is k (q_cmd - q) + d (qd_cmd - qd), held for one step, within the
servo's effort. The explicit step needs a short dt and links that are not too light: the reflected inertia of
the servos' rotors stands for that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwkin.compliance.springs import StiffnessChoice, joint_stiffness
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.sim.backend import Command, Observation
from screwkin.sim.pybullet import Physics, PyBulletBackend

STEP = 5e-4
"""Duration of a step by default [s]."""


@dataclass(frozen=True)
class Compliance:
    """Springs and dampers of the joints in a simulation.

    stiffness: see ``joint_stiffness``; damping: [N m s/rad]; rotor_inertia: least inertia of a link about
    each axis [kg m^2].
    """

    stiffness: StiffnessChoice = None
    damping: float = 1.0
    rotor_inertia: float = 5e-4

    def __post_init__(self) -> None:
        if not (np.isfinite(self.damping) and self.damping >= 0):
            raise InputError(f"damping is {self.damping!r}; it must be a finite number of at least 0")
        if not (np.isfinite(self.rotor_inertia) and self.rotor_inertia > 0):
            raise InputError(f"rotor_inertia is {self.rotor_inertia!r}; it must be a finite number above 0")


class CompliantBackend(PyBulletBackend):
    """The robot in PyBullet with springs for servos."""

    name = "pybullet-compliant"

    def __init__(
        self,
        robot: Robot,
        compliance: Compliance | None = None,
        physics: Physics | None = None,
        gui: bool = False,
    ) -> None:
        """Connect and build the world.

        Raises:
            MissingDependencyError: pybullet is not installed.
            InputError: see ``PyBulletBackend`` and ``joint_stiffness``; or the step is too long for springs
                so stiff on links so light.
        """
        springs = compliance or Compliance()
        physics = physics or Physics(dt=STEP)
        self._k, self._d = joint_stiffness(robot, springs.stiffness), springs.damping
        _check_step(float(self._k.max()), springs, physics.dt)
        super().__init__(robot.with_inertia_floor(inertia=springs.rotor_inertia), physics, gui)
        self._limit = np.array(self._efforts)
        self._torque = np.zeros_like(self._k)

    def reset(self, state: State) -> Observation:
        """Place the robot at rest in a state, its springs relaxed, and time at 0."""
        self._torque = np.zeros_like(self._k)
        return super().reset(state)

    def _drive(self, command: Command) -> None:
        joints = self._p.getJointStates(self._body, self._joints, **self._here)
        q, qd = np.array([joint[:2] for joint in joints]).T
        torque = self._k * (command.q - q) + self._d * (command.qd - qd)
        self._torque = np.clip(torque, -self._limit, self._limit)
        self._p.setJointMotorControlArray(
            self._body, self._joints, self._p.TORQUE_CONTROL, forces=self._torque.tolist(), **self._here
        )

    def observe(self) -> Observation:
        """The state after the last step, with the springs' torques, which PyBullet does not report."""
        return replace(super().observe(), torque=self._torque)


def _check_step(k: float, springs: Compliance, dt: float) -> None:
    """Refuse a step beyond which the lightest link on the stiffest spring would swing up by itself.

    A torque held for a step is stable on an inertia I while k dt^2 + 2 d dt < 4 I (semi-implicit Euler).
    """
    inertia = springs.rotor_inertia
    if k * dt**2 + 2 * springs.damping * dt >= 4 * inertia:
        longest = (np.sqrt(springs.damping**2 + 4 * k * inertia) - springs.damping) / k
        raise InputError(
            f"a step of {1e3 * dt:g} ms is too long for joints of {k:g} N m/rad and {springs.damping:g} "
            f"N m s/rad on links of {inertia:g} kg m^2; take less than {1e3 * longest:.3g} ms"
        )
