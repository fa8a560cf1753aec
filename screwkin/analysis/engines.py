"""In what a trajectory is simulated: the engine, and the compliance in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from screwkin.compliance.springs import joint_stiffness
from screwkin.errors import InputError, UnknownNameError
from screwkin.gait.compensation import stiffness_of
from screwkin.model.robot import Robot
from screwkin.sim.backend import Backend
from screwkin.sim.compliant import STEP, Compliance, CompliantBackend
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.pybullet import Physics, PyBulletBackend
from screwkin.trajectory import Trajectory

Engine = Literal["pybullet", "kinematic"]
ENGINES: tuple[Engine, ...] = ("pybullet", "kinematic")
PROVING = ("pybullet", "pybullet-compliant", "mujoco")
"""Names of runs whose contact forces confirm a walk; ``+`` joins the names of two runs."""


@dataclass(frozen=True)
class SimulatedCompliance:
    """Compliance of servos and soles in a simulation; none by default.

    servos: springs for servos, None for rigid ones; a stiffness of None is the one that the trajectory is
    compensated for, else the table's. sole_stiffness: of every point of contact [N/m], None for rigid soles.
    repeat: play the trajectory under other frictions and time steps too, as contact is chaotic on springs.
    """

    servos: Compliance | None = None
    sole_stiffness: float | None = None
    repeat: bool = False

    def __post_init__(self) -> None:
        if self.repeat and self.servos is None:
            raise InputError(
                "only walks on elastic servos are repeated under other conditions; give them springs"
            )

    def for_trajectory(self, robot: Robot, trajectory: Trajectory) -> SimulatedCompliance:
        """The same with the stiffness of every joint by its name.

        Raises:
            InputError, UnknownNameError: a joint's stiffness is missing, or no positive number.
        """
        if self.servos is None:
            return self
        chosen = self.servos.stiffness
        k = joint_stiffness(robot, stiffness_of(trajectory) if chosen is None else chosen).tolist()
        by_name = dict(zip(robot.joint_names, k, strict=True))
        return replace(self, servos=replace(self.servos, stiffness=by_name))


def confirms(engine: str) -> bool:
    """Whether runs of that name simulate contact forces, all of them."""
    return all(name in PROVING for name in engine.split("+"))


def opened(robot: Robot, engine: Engine, compliance: SimulatedCompliance, gui: bool) -> Backend:
    """The simulator of that name, with the robot in it.

    Raises:
        UnknownNameError: no such engine. InputError: it has no contact forces.
        MissingDependencyError: it is not installed.
    """
    if engine not in ENGINES:
        raise UnknownNameError("engine", engine, ENGINES)
    soles = compliance.sole_stiffness
    if engine == "kinematic":
        if compliance.servos is not None or soles is not None:
            raise InputError(
                "engine kinematic has no contact forces and cannot simulate compliance; use pybullet"
            )
        return KinematicBackend(robot)
    if compliance.servos is not None:
        return CompliantBackend(robot, compliance.servos, Physics(dt=STEP, sole_stiffness=soles), gui)
    return PyBulletBackend(robot, Physics(sole_stiffness=soles), gui)
