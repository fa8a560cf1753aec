"""Elastic servos: every joint is a spring and a damper between its command and its link.

A rigid servo is a constraint on rates, which no static load deflects; it cannot stand for an elastic one.
Here the joint's torque is k (q_cmd - q) + d (qd_cmd - qd), held for one step, within the servo's effort. The
explicit step needs a short dt and links that are not too light: the inertia of the servos' rotors, as seen at
the joint, stands for that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compliance.springs import StiffnessChoice, joint_stiffness
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.sim.backend import Command
from screwkin.sim.drive import Actuation

STEP = 5e-4
"""Duration of a step by default [s]."""


@dataclass(frozen=True)
class Compliance:
    """Springs and dampers of the joints in a simulation.

    stiffness: see ``joint_stiffness``; damping: [N m s/rad]; rotor_inertia: of every rotor about its joint's
    axis [kg m^2].
    """

    stiffness: StiffnessChoice = None
    damping: float = 1.0
    rotor_inertia: float = 5e-4

    def __post_init__(self) -> None:
        if not (np.isfinite(self.damping) and self.damping >= 0):
            raise InputError(f"damping is {self.damping!r}; it must be a finite number of at least 0")
        if not (np.isfinite(self.rotor_inertia) and self.rotor_inertia > 0):
            raise InputError(f"rotor_inertia is {self.rotor_inertia!r}; it must be a finite number above 0")


class SpringServos:
    """Springs and dampers for servos, in any engine."""

    name = "springs"
    relative_rotors = False

    def __init__(self, robot: Robot, compliance: Compliance, dt: float = STEP) -> None:
        """Springs that steps of dt [s] can simulate.

        Raises:
            InputError: see ``joint_stiffness``; or the step is too long for springs so stiff on rotors so
                light.
        """
        self._k, self._d = joint_stiffness(robot, compliance.stiffness), compliance.damping
        _check_step(float(self._k.max()), compliance, dt)
        self.rotor_inertia = np.full(len(robot.joints), compliance.rotor_inertia)
        self._effort = np.array([joint.effort for joint in robot.joints], dtype=float)
        self._free = np.zeros(len(robot.joints))

    def reset(self, q: Array) -> None:
        """Springs are relaxed by the command that comes next."""

    def actuate(self, q: Array, qd: Array, motor: Array, command: Command, dt: float) -> Actuation:
        """The springs' torque; no motor."""
        torque = self._k * (command.q - q) + self._d * (command.qd - qd)
        return Actuation(np.clip(torque, -self._effort, self._effort), self._free, self._free)


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
