"""In what a trajectory is simulated: the engines, and the compliance in them."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

from screwkin.compliance.springs import joint_stiffness
from screwkin.dynamics.terrain import FLAT, Terrain
from screwkin.errors import InputError, UnknownNameError
from screwkin.gait.compensation import WAYS, compensate_walk, stiffness_of, way_of
from screwkin.model.robot import Robot
from screwkin.motors.library import model_of_every_joint, motors_named, motors_of, names_motors
from screwkin.motors.records import Motor
from screwkin.sim.backend import Backend
from screwkin.sim.compliant import STEP, Compliance, SpringServos
from screwkin.sim.drive import RigidServos, Servos
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.motors import MotorServos
from screwkin.sim.mujoco import MuJoCoBackend, MuJoCoPhysics
from screwkin.sim.perturbation import NONE, Perturbation
from screwkin.sim.perturbed import perturbed_ground, perturbed_robot, perturbed_servos
from screwkin.sim.pybullet import Physics, PyBulletBackend
from screwkin.sim.sweeps import sweeps
from screwkin.trajectory import Trajectory

Engine = Literal["auto", "pybullet", "mujoco", "kinematic"]
AUTO = "auto"
"""The servos of the robot's table where commands can allow for them, else rigid ones."""
RIGID = "rigid"
"""Servos that follow their commands exactly."""
TABLE = "table"
"""The servos that a robot's table names."""
ENGINES: tuple[Engine, ...] = ("auto", "pybullet", "mujoco", "kinematic")
PROVING = ("mujoco", "pybullet")
"""Engines whose contact forces confirm a walk; ``+`` joins the names of those that agreed."""


@dataclass(frozen=True)
class SimulatedCompliance:
    """Compliance of servos and soles in a simulation; none by default.

    servos: springs for servos, None for rigid ones; a stiffness of None is the one that the trajectory is
    compensated for, else the table's. motors: real servos instead, ``table`` for the models that the table
    names, else the name or the file of a model for all joints. sole_stiffness: of every point of contact
    [N/m], None for rigid soles.
    repeat: play the trajectory under other frictions and time steps too, as contact is chaotic on springs.
    """

    servos: Compliance | None = None
    sole_stiffness: float | None = None
    repeat: bool = False
    motors: str | None = None

    def __post_init__(self) -> None:
        if self.repeat and self.servos is None:
            raise InputError(
                "only walks on elastic servos are repeated under other conditions; give them springs"
            )
        if self.motors is not None and self.servos is not None:
            raise InputError(f"servos are springs or motors ({self.motors}), not both; choose one")

    def on(self, servo: str | Path) -> SimulatedCompliance:
        """The same on servos of that name: ``rigid`` adds nothing, others are ``motors``."""
        return self if servo == RIGID else replace(self, motors=str(servo))

    def for_trajectory(self, robot: Robot, trajectory: Trajectory) -> SimulatedCompliance:
        """The same with the stiffness of every joint by its name.

        Raises:
            InputError, UnknownNameError: a joint's stiffness is missing, or no positive number; or a motor's
                figures are not known.
        """
        self.motors_of(robot)
        if self.servos is None:
            return self
        chosen = self.servos.stiffness
        k = joint_stiffness(robot, stiffness_of(trajectory) if chosen is None else chosen).tolist()
        by_name = dict(zip(robot.joint_names, k, strict=True))
        return replace(self, servos=replace(self.servos, stiffness=by_name))

    def motors_of(self, robot: Robot) -> tuple[Motor, ...]:
        """The motor of every joint, none if servos are rigid or springs."""
        if self.motors is None:
            return ()
        if self.motors == TABLE:
            return motors_of(robot)
        try:
            return motors_named(robot, self.motors)
        except UnknownNameError as error:
            raise UnknownNameError("servo", error.name, (AUTO, RIGID, TABLE, *error.valid)) from None

    def commands(self, robot: Robot, trajectory: Trajectory) -> Trajectory:
        """What the servos are sent: on motors, a plan with the torque term, so that they follow it.

        A trajectory that is compensated stays as it is, as does one that is no walk on two feet, or of a
        robot whose loops share the torque. The same arguments give the same commands: whoever judges a plan
        need not hand them on to whoever plays it.

        Raises:
            LimitError: a command is beyond a joint's limits. InputError: a motor's figures are not known.
        """
        motors = self.motors_of(robot)
        if not motors or way_of(trajectory) != "none" or not _allows(robot, trajectory):
            return trajectory
        stiffness, damping, armature = (
            {name: float(getattr(m, what)) for name, m in zip(robot.joint_names, motors, strict=True)}
            for what in ("stiffness", "damping", "armature")
        )
        friction = {
            name: float(m.friction.coulomb) for name, m in zip(robot.joint_names, motors, strict=True)
        }
        method, model = WAYS["dynamic"]
        return compensate_walk(
            robot,
            trajectory,
            stiffness,
            method,
            model=model,
            damping=damping,
            armature=armature,
            friction=friction,
        )


def servo_for(
    servo: str | Path,
    robot: Robot,
    trajectory: Trajectory,
    engine: Engine = "auto",
    compliance: SimulatedCompliance | None = None,
) -> str | Path:
    """The servos that a name stands for; ``auto`` is ``table`` or ``rigid``.

    It is ``table`` where the robot's table names the models of all servos, and commands can allow for them in
    the trajectory. It is ``rigid`` besides springs, and where no forces are simulated.

    Raises:
        UnknownNameError, TableError: the file of a model that the table names is missing, or has faults.
    """
    if servo != AUTO:
        return servo
    chosen = compliance or SimulatedCompliance()
    free = chosen.servos is None and chosen.motors is None and engine != "kinematic"
    return TABLE if free and names_motors(robot) and _allows(robot, trajectory) else RIGID


def servos_in_words(
    servo: str | Path, robot: Robot, trajectory: Trajectory, engine: Engine, compliance: SimulatedCompliance
) -> tuple[str, str]:
    """Which servos a simulation has, and why.

    Args:
        servo: as it was asked for.
        robot: of the trajectory.
        trajectory: what is simulated.
        engine: as it was asked for.
        compliance: as it was asked for.
    """
    chosen, asked = servo_for(servo, robot, trajectory, engine, compliance), f"--servo {servo}"
    if compliance.servos is not None:
        return "springs", "--compliant"
    if chosen == TABLE:
        models = dict.fromkeys(model_of_every_joint(robot))
        return ", ".join(models), "as the table names them" if servo == AUTO else asked
    if servo != AUTO:
        return str(servo), asked
    if engine == "kinematic":
        return RIGID, "kinematic simulates no forces"
    if not names_motors(robot):
        return RIGID, "the table names no servo models whose motors are known"
    return RIGID, "commands cannot allow for the motors of a robot with loops, or on other than two feet"


def simulated_on(servo: str) -> SimulatedCompliance:
    """The servos that a verdict names: motors, or none where they were rigid or springs."""
    return SimulatedCompliance().on(RIGID if servo == SpringServos.name else servo)


def _allows(robot: Robot, trajectory: Trajectory) -> bool:
    """Whether the torques that a walk asks of motors follow from it: two feet, and no loops in the robot."""
    return len(trajectory.feet) == 2 and not robot.closures


def confirms(engine: str) -> bool:
    """Whether runs of that name simulate contact forces, all of them."""
    return all(name in PROVING for name in engine.split("+"))


def engines_for(engine: Engine, robot: Robot, compliance: SimulatedCompliance) -> tuple[Engine, ...]:
    """The engines that a name stands for.

    ``auto`` is every installed engine with contact forces that can simulate the robot and its compliance: two
    that agree are worth more than one. MuJoCo alone where none is installed, so that its error says so.

    Raises:
        UnknownNameError: no such engine.
    """
    if engine not in ENGINES:
        raise UnknownNameError("engine", engine, ENGINES)
    if engine != "auto":
        return (engine,)
    able: list[Engine] = ["pybullet"]
    if compliance.sole_stiffness is None:
        able.append("mujoco")
    installed = tuple(name for name in able if importlib.util.find_spec(name) is not None)
    return installed or tuple(able[-1:]) or ("mujoco",)


@dataclass(frozen=True)
class Refinement:
    """How much finer than its settings an engine works: parts of a step, and factor on its iterations.

    A direct solver has no iterations; its regularisation is divided by the factor instead.
    """

    step: int = 1
    iterations: int = 1


def opened(
    robot: Robot,
    engine: Engine,
    compliance: SimulatedCompliance,
    gui: bool = False,
    finer: Refinement | None = None,
    terrain: Terrain = FLAT,
    perturbation: Perturbation = NONE,
) -> Backend:
    """The simulator of that name, with the robot in it.

    Args:
        robot: to simulate.
        engine: one of ``engines_for``.
        compliance: see ``SimulatedCompliance``.
        gui: show a window.
        finer: than its usual settings.
        terrain: to stand on.
        perturbation: what differs from the plan, but for its push, which ``simulate`` gives.

    Raises:
        InputError: it has no contact forces, or no elastic soles.
        MissingDependencyError: it is not installed.
    """
    soles, springs, motors = compliance.sole_stiffness, compliance.servos, compliance.motors_of(robot)
    if engine == "kinematic":
        if springs is not None or soles is not None or motors:
            raise InputError(
                "engine kinematic has no contact forces and cannot simulate compliance; use pybullet"
            )
        if not perturbation.nothing:
            raise InputError("engine kinematic has no forces to perturb; use mujoco or pybullet")
        return KinematicBackend(robot)
    dt = STEP if springs is not None else None
    physics: Physics | MuJoCoPhysics
    if engine == "pybullet":
        wanted = sweeps(robot, rigid=springs is None and not motors)
        physics = _refined(Physics(sole_stiffness=soles, iterations=wanted), dt, finer, perturbation)
    elif soles is not None:
        raise InputError("engine mujoco has no elastic soles; use pybullet")
    else:
        physics = _refined(MuJoCoPhysics(), dt, finer, perturbation)
    servos: Servos | None = None if springs is None else SpringServos(robot, springs, STEP)
    if motors:
        servos = MotorServos(motors, physics.dt, str(compliance.motors))
    by = perturbation
    if not by.nothing:
        servos = perturbed_servos(servos or RigidServos(robot), robot, by, physics.dt)
        robot, terrain = perturbed_robot(robot, by), perturbed_ground(terrain, by)
    if isinstance(physics, Physics):
        return PyBulletBackend(robot, physics, gui, servos, terrain, by)
    return MuJoCoBackend(robot, physics, gui, servos, terrain, by)


P = TypeVar("P", Physics, MuJoCoPhysics)


def _refined(physics: P, dt: float | None, finer: Refinement | None, perturbation: Perturbation) -> P:
    by, step = finer or Refinement(), dt or physics.dt
    friction = {} if perturbation.friction is None else {"friction": perturbation.friction}
    changes: dict[str, Any] = {
        "dt": step / by.step,
        "iterations": physics.iterations * by.iterations,
        **friction,
    }
    if isinstance(physics, Physics):
        changes["regularisation"] = physics.regularisation / by.iterations
    return replace(physics, **changes)
