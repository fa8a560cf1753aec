"""The robot in PyBullet: rigid bodies, motors and contacts. The only file that imports pybullet.

Measured, beside ``Physics``: ``numSubSteps`` would divide the reported contact forces; there is no damping of
any kind, and the default joint motors are released; inertia is as the table gives it; friction is anchored,
or a robot on both feet creeps by 0.1 deg per second of standing. Every call names its client: simulations can
run side by side.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from screwkin.dynamics.terrain import FLAT, Terrain
from screwkin.errors import InputError, MissingDependencyError
from screwkin.kinematics.positions import tree_positions
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.model.urdf import urdf_of_bodies
from screwkin.sim.backend import Command, Contact, Observation
from screwkin.sim.bodies import check_feet, solid
from screwkin.sim.camera import Camera
from screwkin.sim.couplings import couple_in_pybullet
from screwkin.sim.drive import UNLIMITED, RigidServos, Servos, motored
from screwkin.sim.floor import bounce_in_pybullet, floor_in_pybullet
from screwkin.sim.loops import close_in_pybullet, quat_xyzw, with_shared_masses
from screwkin.sim.perturbation import NONE, Perturbation, noted
from screwkin.sim.pybullet_feet import Feet
from screwkin.sim.pybullet_look import Look, pose_of
from screwkin.sim.quiet import quiet
from screwkin.sim.rotors import RelativeRotors, with_rotors
from screwkin.sim.shod import shod
from screwkin.sim.table_springs import TableSprings, check_spring_steps

Solver = Literal["direct", "iterative"]
FrictionModel = Literal["pyramid", "cone"]


@dataclass(frozen=True)
class Physics:
    """Settings of the simulation.

    dt [s]; solver of motors and contacts: ``iterative`` (projected Gauss-Seidel, with so many iterations) or
    ``direct`` (Dantzig's pivoting, for rigid soles and no coupled joints; where pivoting fails, the iterative
    one takes over); regularisation of the direct one, as redundant contacts share a force in many ways;
    friction between soles and floor, as a pyramid or a cone; gravity [m/s^2]; sole_stiffness [N/m] and
    sole_damping [N s/m] of every point in which a leg's last link touches the floor, None for rigid soles.

    The pyramid converges, the cone need not: a walk of a robot of 28 kg (iCub) has a contact ZMP .62 mm RMS
    from its plan with 200 iterations and .54 mm with 1,000, and falls with the cone at both.
    Neither solver is right for every robot (``python -m benchmarks.convergence``): walking robots of 2 and
    33 kg converge with the direct one, in half the time, where the iterative one needs 800 iterations; with
    62 and 90 kg the direct one errs by centimetres once they set a foot down.
    """

    dt: float = 1e-3
    solver: Solver = "iterative"
    regularisation: float = 1e-8
    iterations: int = 200
    friction: float = 1.0
    friction_model: FrictionModel = "pyramid"
    gravity: float = 9.81
    sole_stiffness: float | None = None
    sole_damping: float = 20.0


class PyBulletBackend:
    """One robot on its terrain in a physics client of its own."""

    name = "pybullet"

    def __init__(
        self,
        robot: Robot,
        physics: Physics | None = None,
        gui: bool = False,
        servos: Servos | None = None,
        terrain: Terrain = FLAT,
        perturbation: Perturbation = NONE,
    ) -> None:
        """Connect and build the world.

        Args:
            robot: closures are welded; feet stand on all of their soles (``shod``).
            physics: see ``Physics``.
            gui: show a window.
            servos: of the joints; rigid by default.
            terrain: to stand on.
            perturbation: its slope and restitution; ``analysis.engines.opened`` applies the rest.

        Raises:
            MissingDependencyError: pybullet is not installed.
            InputError: the robot has helical joints, a leg has nothing to stand on, soles cannot be
                so elastic, or there is no display for ``gui``.
        """
        self._robot = robot
        self._servos = servos or RigidServos(robot)
        self.servo = self._servos.name
        self._physics = physics or Physics()
        check_spring_steps(robot, self._physics.dt)
        self._springs = TableSprings.of(robot)
        _check_soles(self._physics)
        if robot.coupled or robot.closures or self._physics.sole_stiffness is not None:
            self._physics = replace(self._physics, solver="iterative")
        self.dt = self._physics.dt
        self._perturbation = perturbation
        self._gravity = perturbation.gravity(self._physics.gravity)
        self.settings: Mapping[str, Any] = asdict(self._physics) | noted(perturbation)
        check_feet(robot)
        self._motored = motored(robot)
        rotors = self._servos.rotor_inertia * self._motored
        steadied = not self._servos.relative_rotors
        opened = replace(solid(with_shared_masses(shod(robot))), closures=())
        urdf = urdf_of_bodies(with_rotors(opened, rotors, steadied))
        self._p = _imported_pybullet()
        self._client = _connected(self._p, gui)
        self._here = {"physicsClientId": self._client}
        self._steps = 0
        self._began = time.monotonic() if gui else None
        self._floor = self._make_floor(terrain)
        self._body = self._load(urdf)
        self._link_names = [robot.base_link, *(info[12].decode() for info in self._joint_infos())]
        names = [info[1].decode() for info in self._joint_infos()]
        self._joints = [names.index(name) for name in robot.joint_names]
        self._tree = [names.index(joint.name) for joint in robot.tree]
        self._applied = np.zeros(len(self._joints))
        self._release()
        couple_in_pybullet(self._p, self._here, self._body, robot, self._tree)
        close_in_pybullet(self._p, self._here, self._body, robot, self._link_names)
        self._rotors: RelativeRotors | None = None
        if not steadied:
            floats = robot.base == "floating"
            every = np.append(rotors, np.zeros(len(robot.coupled)))
            self._rotors = RelativeRotors(self._p, self._here, self._body, self._tree, every, floats)
        info = self._p.getDynamicsInfo(self._body, -1, **self._here)
        self._T_base_inertial = pose_of(info[3], info[4])
        self._feet = Feet(self._p, self._here, self._body, self._tree, robot, self._link_names)
        self._soften_soles()

    def _make_floor(self, terrain: Terrain) -> tuple[int, ...]:
        p, here, physics = self._p, self._here, self._physics
        p.setGravity(*self._gravity.tolist(), **here)
        p.setPhysicsEngineParameter(
            fixedTimeStep=physics.dt,
            numSolverIterations=physics.iterations,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            enableConeFriction=int(physics.friction_model == "cone"),
            **here,
        )
        if physics.solver == "direct":
            with quiet(1):
                p.setPhysicsEngineParameter(
                    constraintSolverType=p.CONSTRAINT_SOLVER_LCP_DANTZIG,
                    globalCFM=physics.regularisation,
                    **here,
                )
        return floor_in_pybullet(p, here, terrain)

    def _load(self, urdf: str) -> int:
        p = self._p
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(urdf, encoding="utf-8")
            body: int = p.loadURDF(
                str(path),
                flags=p.URDF_USE_INERTIA_FROM_FILE,
                useFixedBase=self._robot.base == "fixed",
                **self._here,
            )
        return body

    def _joint_infos(self) -> list[Any]:
        p = self._p
        return [
            p.getJointInfo(self._body, i, **self._here)
            for i in range(p.getNumJoints(self._body, **self._here))
        ]

    def _release(self) -> None:
        """Remove all that PyBullet adds by itself: damping of links and joints, and braking motors."""
        p, here = self._p, self._here
        for link in range(-1, len(self._tree)):
            p.changeDynamics(
                self._body,
                link,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                lateralFriction=self._physics.friction,
                frictionAnchor=1,
                **bounce_in_pybullet(self._perturbation.restitution),
                **here,
            )
        p.setJointMotorControlArray(
            self._body, self._tree, p.VELOCITY_CONTROL, forces=[0.0] * len(self._tree), **here
        )

    def _soften_soles(self) -> None:
        """Make the points in which feet touch the floor springs, if so wanted."""
        physics = self._physics
        if physics.sole_stiffness is None:
            return
        for index in self._feet.indices:
            self._p.changeDynamics(
                self._body,
                index,
                contactStiffness=physics.sole_stiffness,
                contactDamping=physics.sole_damping,
                **self._here,
            )

    def _looked(self) -> Look:
        return Look(self._p, self._here, self._body, self._tree)

    def reset(self, state: State) -> Observation:
        """Place the robot at rest in a state, and time at 0."""
        p, here = self._p, self._here
        T = np.asarray(state.T_world_base, dtype=float) @ self._T_base_inertial
        p.resetBasePositionAndOrientation(self._body, T[:3, 3].tolist(), quat_xyzw(T[:3, :3]), **here)
        p.resetBaseVelocity(self._body, [0.0] * 3, [0.0] * 3, **here)
        positions = tree_positions(self._robot, np.asarray(state.q, dtype=float).tolist())
        for index, q in zip(self._tree, positions, strict=True):
            p.resetJointState(self._body, index, q, 0.0, **here)
        self._servos.reset(np.array(state.q, dtype=float))
        self._applied = np.zeros(len(self._joints))
        if self._rotors is not None:
            self._rotors.reset()
        self._look, self._steps = self._looked(), 0
        if self._began is not None:
            self._began = time.monotonic()
        return self.observe()

    def step(self, command: Command) -> None:
        """Let one step pass under a command."""
        self._drive(command)
        self._p.stepSimulation(**self._here)
        self._look = self._looked()
        self._steps += 1
        if self._began is not None and self._steps % 20 == 0:
            self._show(self._began)

    def _drive(self, command: Command) -> None:
        """Set the motors for one step, each a constraint on its rate within a bound, and apply torques."""
        p, here, look, count = self._p, self._here, self._look, len(self._joints)
        q, qd, motor = look.q[:count], look.qd[:count], look.motor[:count]
        action = self._servos.actuate(q, qd, motor, command, self.dt).on(self._motored)
        p.setJointMotorControlArray(
            self._body,
            self._joints,
            p.VELOCITY_CONTROL,
            targetVelocities=action.rate.tolist(),
            forces=np.minimum(action.bound, UNLIMITED).tolist(),
            **here,
        )
        self._applied = action.torque
        every = action.torque + self._springs.efforts(q, qd)
        torque = np.concatenate([every, np.zeros(len(self._tree) - count)])
        if command.force is not None:
            at, _ = p.getBasePositionAndOrientation(self._body, **here)
            p.applyExternalForce(self._body, -1, list(command.force), at, p.WORLD_FRAME, **here)
        if self._rotors is not None:
            moment, beside = self._rotors.forces(look, torque, self.dt)
            p.applyExternalTorque(self._body, -1, moment.tolist(), p.WORLD_FRAME, **here)
            torque = torque + beside
        if torque.any():
            p.setJointMotorControlArray(
                self._body, self._tree, p.TORQUE_CONTROL, forces=torque.tolist(), **here
            )

    def _show(self, began: float) -> None:
        """Keep a window's camera on the robot, and its time no faster than the world's."""
        camera = Camera()
        base, _ = self._p.getBasePositionAndOrientation(self._body, **self._here)
        away = camera.distance * base[2]
        self._p.resetDebugVisualizerCamera(away, camera.yaw, camera.pitch, base, **self._here)
        time.sleep(max(0.0, began + self._steps * self.dt - time.monotonic()))

    def observe(self) -> Observation:
        """The state after the last step."""
        look, count = self._look, len(self._joints)
        poses = self._feet.poses(look)
        return Observation(
            time=self._steps * self.dt,
            T_world_base=poses[0],
            q=look.q[:count],
            qd=look.qd[:count],
            torque=self._applied + look.motor[:count],
            T_world_foot=poses[1:],
            ankle_wrench=self._feet.wrenches(look, self._gravity),
            contacts=tuple(self._contacts()),
        )

    def _contacts(self) -> Iterator[Contact]:
        """Points where the floor presses on the robot; the force includes friction."""
        for touch in self._look.touches:
            pressing = touch[9]
            if pressing <= 0.0 or touch[2] not in self._floor:
                continue
            (x, y, z), (u, v, w), (r, s, t) = touch[7], touch[11], touch[13]
            a, b = touch[10], touch[12]
            force = x * pressing + a * u + b * r, y * pressing + a * v + b * s, z * pressing + a * w + b * t
            yield Contact(self._link_names[touch[3] + 1], touch[6], force)

    def close(self) -> None:
        """Disconnect; closing twice is harmless."""
        if self._client >= 0:
            self._p.disconnect(**self._here)
            self._client = -1


def _check_soles(physics: Physics) -> None:
    k, d = physics.sole_stiffness, physics.sole_damping
    if k is not None and not (np.isfinite(k) and k > 0):
        raise InputError(f"sole_stiffness is {k!r}; it must be a positive number in N/m, or None")
    if not (np.isfinite(d) and d >= 0):
        raise InputError(f"sole_damping is {d!r}; it must be a finite number of at least 0 in N s/m")


def _imported_pybullet() -> Any:
    try:
        with quiet(2):
            import pybullet
    except ImportError:
        raise MissingDependencyError(
            "PyBullet needs pybullet, which is not installed. With Python 3.11: python -m pip "
            "install pybullet. For newer Pythons there are no wheels; MuJoCo simulates there."
        ) from None
    return pybullet


def _connected(p: Any, gui: bool) -> int:
    # Without a display PyBullet's window ends the whole process, so this is asked first.
    if gui and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise InputError("--gui needs a display, and DISPLAY is not set; leave --gui away")
    client: int = p.connect(p.GUI if gui else p.DIRECT)
    if client < 0:
        raise InputError("PyBullet gave no simulation; close other windows of it, or leave --gui away")
    return client
