"""The robot in MuJoCo: rigid bodies, motors and contacts.

The model is built from the table: bodies are links in the table's frames (see ``sim.bodies``), the geometry
in contact is that of the table's boxes and soles, loops are closed by welds. A motor is dry friction against
a moving reference: MuJoCo's friction constraint of a joint, whose force is bounded, asks for rate zero; here
it asks for the rate that the servo wants. So a rigid servo is a velocity constraint within its effort, as in
PyBullet, solved together with the contacts.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.dynamics.terrain import FLAT, Terrain
from screwkin.errors import InputError, NoSolutionError, needed_for
from screwkin.kinematics.positions import tree_positions
from screwkin.model.inertias import impossible
from screwkin.model.robot import Joint, Robot
from screwkin.model.state import State
from screwkin.sim.backend import Command, Contact, Observation, moment_about_origin
from screwkin.sim.bodies import SimBody, bodies_of, check_feet
from screwkin.sim.couplings import STIFF, couple_in_mujoco
from screwkin.sim.drive import UNLIMITED, RigidServos, Servos, motored
from screwkin.sim.floor import contact_spring, floor_in_mujoco
from screwkin.sim.loops import close_in_mujoco
from screwkin.sim.perturbation import NONE, Perturbation, noted
from screwkin.sim.table_springs import check_spring_steps

CORNER = 1e-4
"""Radius [m] of the spheres that stand for the corners of a sole that no box has."""


@dataclass(frozen=True)
class MuJoCoPhysics:
    """Settings of the simulation.

    dt [s]; iterations and tolerance of the constraint solver per step; friction between soles and floor;
    cone: ``elliptic`` or ``pyramidal``, of friction; impratio: how much harder friction is than contact;
    contact_time [s] and contact_impedance of contacts; gravity [m/s^2].

    Chosen by what finer ones change (``python -m benchmarks.convergence``; two small bipeds, two steps of
    1 s). RMS of the contact ZMP against half the step: usual .26 mm; twice the iterations change nothing, as
    Newton's method has converged; impratio 1 to 100 .22 to .26 mm; pyramidal cone .3 to .4 mm; contact_time
    5 ms .4 to .5 mm; MuJoCo's own softness (20 ms, impedance .9) 4 to 7 mm. contact_time may not be shorter
    than two steps.
    """

    dt: float = 1e-3
    iterations: int = 100
    tolerance: float = 1e-10
    friction: float = 1.0
    cone: str = "elliptic"
    impratio: float = 10.0
    contact_time: float = 2e-3
    contact_impedance: float = 0.99
    gravity: float = 9.81


class MuJoCoBackend:
    """One robot on its terrain."""

    name = "mujoco"

    def __init__(
        self,
        robot: Robot,
        physics: MuJoCoPhysics | None = None,
        gui: bool = False,
        servos: Servos | None = None,
        terrain: Terrain = FLAT,
        perturbation: Perturbation = NONE,
    ) -> None:
        """Build the world.

        Args:
            robot: closures are welded; helical joints are refused.
            physics: see ``MuJoCoPhysics``.
            gui: show a window.
            servos: of the joints; rigid by default.
            terrain: to stand on.
            perturbation: its slope and restitution; ``analysis.engines.opened`` applies the rest.

        Raises:
            MissingDependencyError: mujoco is not installed.
            InputError: helical joints, a leg with nothing to stand on, or no display for ``gui``.
        """
        _check_joints(robot)
        self._robot = robot
        self._physics = physics or MuJoCoPhysics()
        self.dt = self._physics.dt
        check_spring_steps(robot, self.dt)
        self._servos = servos or RigidServos(robot)
        self.servo = self._servos.name
        self._motored = motored(robot)
        self._mj = mj = mujoco_library()
        bodies, remarks = bodies_of(robot)
        self.settings: Mapping[str, Any] = {
            **asdict(self._physics),
            "remarks": [*remarks, *(f"inertia balanced of {name}" for name in _unbalanced(robot))],
            **noted(perturbation),
        }
        self._gravity = perturbation.gravity(self._physics.gravity)
        spec = _world(mj, self._physics, terrain, self._gravity, perturbation.restitution)
        _add_bodies(mj, spec, robot, bodies, self._servos.rotor_inertia * self._motored)
        ends = {body.link.name: (spec.body(_body_name(body.link.name)), body) for body in bodies}
        close_in_mujoco(mj, spec, robot, ends)
        couple_in_mujoco(mj, spec, robot)
        self.model = spec.compile()
        self.data = mj.MjData(self.model)
        kinds = mj.mjtWarning
        self._unstable = [int(k) for k in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)]
        self._warned = self.data.warning.number  # by kind; MuJoCo counts on in it
        self._tree = np.array([self.model.joint(joint.name).qposadr[0] for joint in robot.tree], dtype=int)
        joints = [self.model.joint(name) for name in robot.joint_names]
        self._qpos = np.array([joint.qposadr[0] for joint in joints], dtype=int)
        self._dof = np.array([joint.dofadr[0] for joint in joints], dtype=int)
        self._base = self.model.body(_body_name(robot.base_link)).id
        frames = {body.link.name: body for body in bodies}
        self._links = {self.model.body(_body_name(name)).id: name for name in frames}
        self._feet = [
            (self.model.body(_body_name(limb.link)).id, frames[limb.link].pose(limb.frame))
            for limb in robot.limbs
            if limb.kind == "leg"
        ]
        self._steps = 0
        self._torque = self._motor = np.zeros(len(joints))
        self._contacts: tuple[Contact, ...] = ()
        self._ankles = np.zeros((len(self._feet), 6))
        self._window = _opened_window(self.model, self.data) if gui else None
        self._began = time.monotonic()

    def reset(self, state: State) -> Observation:
        """Place the robot at rest in a state, and time at 0."""
        mj, T, q = self._mj, np.asarray(state.T_world_base, dtype=float), np.asarray(state.q, dtype=float)
        mj.mj_resetData(self.model, self.data)
        quat = np.zeros(4)
        mj.mju_mat2Quat(quat, T[:3, :3].ravel())
        if self._robot.base == "fixed":
            self.model.body_pos[self._base], self.model.body_quat[self._base] = T[:3, 3], quat
        else:
            self.data.qpos[:3], self.data.qpos[3:7] = T[:3, 3], quat
        self.data.qpos[self._tree] = tree_positions(self._robot, q.tolist())
        self._servos.reset(q)
        mj.mj_kinematics(self.model, self.data)
        self._steps, self._began = 0, time.monotonic()
        self._torque = self._motor = np.zeros_like(q)
        self._contacts = ()
        self._ankles = np.zeros((len(self._feet), 6))
        return self.observe()

    def step(self, command: Command) -> None:
        """Let one step pass under a command."""
        mj, model, data = self._mj, self.model, self.data
        q, qd = data.qpos[self._qpos], data.qvel[self._dof]
        action = self._servos.actuate(q, qd, self._motor, command, self.dt).on(self._motored)
        model.dof_frictionloss[self._dof] = np.minimum(action.bound, UNLIMITED)
        if command.force is not None:
            data.xfrc_applied[self._base, :3] = command.force
        mj.mj_step1(model, data)
        data.qfrc_applied[self._dof] = action.torque
        wanted, motor = np.zeros((2, model.nv))
        wanted[self._dof] = (action.rate - qd) / self.dt
        rows = slice(data.ne, data.ne + data.nf)
        driven = data.efc_id[rows]
        data.efc_aref[rows] = wanted[driven]
        mj.mj_step2(model, data)
        data.xfrc_applied[self._base, :3] = 0.0
        self._refuse_unstable()
        motor[driven] = data.efc_force[rows]
        self._motor = motor[self._dof]
        self._torque = action.torque + self._motor
        mj.mj_rnePostConstraint(model, data)
        self._contacts = tuple(self._pressing())
        self._ankles = np.array([self._ankle_wrench(body) for body, _ in self._feet]).reshape(-1, 6)
        mj.mj_kinematics(model, data)
        self._steps += 1
        if self._window is not None and self._steps % 20 == 0:
            self._window.sync()
            time.sleep(max(0.0, self._began + self._steps * self.dt - time.monotonic()))

    def _refuse_unstable(self) -> None:
        """Raise where MuJoCo has met NaN or huge numbers, and begun anew from its first state.

        Raises:
            NoSolutionError: says when.
        """
        if any(self._warned[kind] for kind in self._unstable):
            when = f"{self._steps * self.dt:.3f} s"
            raise NoSolutionError(
                f"{self._robot.name}: the simulation in MuJoCo is unstable after {when}"
                " (NaN or huge accelerations); links of next to no mass that joints couple or close are the"
                " usual reason: give them masses and inertias, or simulate in shorter steps"
            )

    def observe(self) -> Observation:
        """The state after the last step."""
        data = self.data
        return Observation(
            time=self._steps * self.dt,
            T_world_base=self.pose(self._base),
            q=data.qpos[self._qpos],
            qd=data.qvel[self._dof],
            torque=self._torque,
            T_world_foot=np.array([self.pose(body) @ T for body, T in self._feet]).reshape(-1, 4, 4),
            ankle_wrench=self._ankles,
            contacts=self._contacts,
        )

    def pose(self, body: int) -> Array:
        """World pose (4, 4) of a body, which is the table's frame of its link."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.data.xmat[body].reshape(3, 3), self.data.xpos[body]
        return T

    def _pressing(self) -> Iterator[Contact]:
        """Points where the floor presses on the robot; the force includes friction."""
        mj, model, data = self._mj, self.model, self.data
        wrench, touch = np.zeros((data.ncon, 6)), data.contact
        for k, row in enumerate(wrench):
            mj.mj_contactForce(model, data, k, row)
        # A frame's rows are the normal, from the first geometry to the second, and two tangents.
        forces = (touch.frame.reshape(-1, 3, 3).transpose(0, 2, 1) @ wrench[:, :3, None])[:, :, 0]
        bodies = model.geom_bodyid[touch.geom].reshape(-1, 2)
        forces = np.where(bodies[:, :1] == 0, forces, -forces)
        points = touch.pos.reshape(-1, 3)
        for k in np.flatnonzero(wrench[:, 0] > 0.0).tolist():
            (x, y, z), (u, v, w) = points[k].tolist(), forces[k].tolist()
            yield Contact(self._links[int(bodies[k].max())], (x, y, z), (u, v, w))

    def _ankle_wrench(self, body: int) -> Array:
        """Ground wrench [m; f] about the world origin, from the force in the joint above a foot at rest.

        MuJoCo's force of the parent on the body is about the CoM of the whole robot. The floor supplies what
        is needed beside that and the foot's weight.
        """
        data, model = self.data, self.model
        moment, force = data.cfrc_int[body, :3], data.cfrc_int[body, 3:]
        about = data.subtree_com[model.body_rootid[body]]
        weight = model.body_mass[body] * self._gravity
        f = -force - weight
        m = -moment - moment_about_origin(about, force) - moment_about_origin(data.xipos[body], weight)
        return np.concatenate([m, f])

    def close(self) -> None:
        """Close the window; closing twice is harmless."""
        if self._window is not None:
            self._window.close()
            self._window = None


def _world(mj: Any, physics: MuJoCoPhysics, terrain: Terrain, gravity: Array, restitution: float) -> Any:
    """A floor, gravity and the solver's settings."""
    spec = mj.MjSpec()
    spec.compiler.degree = False
    spec.compiler.balanceinertia = True  # of what no body can have; ``remarks`` name it
    spec.option.timestep = physics.dt
    spec.option.gravity = gravity
    spec.option.integrator = mj.mjtIntegrator.mjINT_EULER
    spec.option.solver = mj.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = physics.iterations
    spec.option.tolerance = physics.tolerance
    spec.option.cone = getattr(mj.mjtCone, f"mjCONE_{physics.cone.upper()}")
    spec.option.impratio = physics.impratio
    # The larger coefficient of the two bodies counts: the floor takes the wanted friction, the robot none.
    floor_in_mujoco(
        mj,
        spec,
        terrain,
        contype=1,
        conaffinity=0,
        friction=[physics.friction, 0.0, 0.0],
        solref=contact_spring(physics.contact_time, physics.dt, restitution),
        solimp=[physics.contact_impedance, physics.contact_impedance, 1e-3, 0.5, 2.0],
        priority=1,
    )
    return spec


def _add_bodies(mj: Any, spec: Any, robot: Robot, bodies: tuple[SimBody, ...], rotors: Array) -> None:
    """All links with their joints, inertias and boxes."""
    rotor = dict(zip(robot.joint_names, rotors.tolist(), strict=True))
    made: dict[str | None, tuple[Any, Array]] = {None: (spec.worldbody, np.eye(4))}
    for body in bodies:
        parent, to_parent = made[body.parent]
        pose = to_parent @ body.frame
        element = parent.add_body(name=_body_name(body.link.name), pos=pose[:3, 3], quat=_quat(mj, pose))
        if body.parent is not None or robot.base == "floating":
            i = body.inertia
            element.explicitinertial, element.mass = True, float(body.link.mass)
            element.ipos = body.point(body.link.com)
            element.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
        if body.parent is None and robot.base == "floating":
            element.add_freejoint(name="floating base")
        for joint in body.joints:
            _add_joint(mj, element, body, joint, rotor.get(joint.name, 0.0))
        for size, center in [(as_array(box.size), body.point(box.center)) for box in body.link.boxes]:
            element.add_geom(
                type=mj.mjtGeom.mjGEOM_BOX,
                size=size / 2,
                pos=center,
                quat=_quat(mj, body.to_frame),
                **_ROBOT_GEOM,
            )
        for corner in _bare_corners(robot, body):
            element.add_geom(type=mj.mjtGeom.mjGEOM_SPHERE, size=[CORNER, 0, 0], pos=corner, **_ROBOT_GEOM)
        made[body.link.name] = (element, body.to_frame)


_ROOM = 1e-6
_ROBOT_GEOM = {"contype": 0, "conaffinity": 1, "friction": [0.0, 0.0, 0.0], "mass": 0.0}


def _add_joint(mj: Any, element: Any, body: SimBody, joint: Joint, rotor: float) -> None:
    kinds = {"revolute": mj.mjtJoint.mjJNT_HINGE, "prismatic": mj.mjtJoint.mjJNT_SLIDE}
    limits = np.clip([joint.lower, joint.upper], -UNLIMITED, UNLIMITED)
    limits += np.array([-_ROOM, _ROOM]) * (limits[0] == limits[1])  # the engine wants room between them
    element.add_joint(
        name=joint.name,
        type=kinds[joint.type],
        pos=body.point(joint.screw.s0),
        axis=body.direction(joint.screw.s),
        limited=bool(np.isfinite([joint.lower, joint.upper]).any()),
        range=limits,
        armature=rotor,
        stiffness=joint.stiffness,
        springref=joint.rest,
        damping=joint.damping,
        solimp_friction=STIFF["solimp"],
    )


def _bare_corners(robot: Robot, body: SimBody) -> list[Array]:
    """Centres of spheres for the corners of a link's sole that are no corners of one of its boxes."""
    limbs = [limb.name for limb in robot.limbs if limb.link == body.link.name]
    soles = [sole for sole in robot.soles if sole.limb in limbs]
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) / 2
    corners = [as_array(box.center) + signs * as_array(box.size) for box in body.link.boxes]
    known = np.concatenate([np.zeros((0, 3)), *corners])
    bare = []
    for sole in soles:
        points = np.array([as_array(corner) for corner in sole.corners], dtype=float)
        missing = [p for p in points if not (np.abs(known - p).max(axis=1, initial=0.0) < CORNER).any()]
        up = np.cross(points[1] - points[0], points[2] - points[1])
        up = up / np.linalg.norm(up)
        bare += [body.to_frame[:3, :3] @ (p + CORNER * up) + body.to_frame[:3, 3] for p in missing]
    return bare


def _body_name(link: str) -> str:
    """A link's name in MuJoCo, which calls its own floor ``world``."""
    return f"{link} link" if link == "world" else link


def _quat(mj: Any, T: Array) -> Array:
    """Quaternion wxyz (4,) of a pose."""
    quat = np.zeros(4)
    mj.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).ravel())
    return quat


def _unbalanced(robot: Robot) -> list[str]:
    return [link.name for link in robot.links if impossible(link.inertia)]


def _check_joints(robot: Robot) -> None:
    helical = [joint.name for joint in robot.tree if joint.type == "helical"]
    if helical:
        raise InputError(f"robot {robot.name}: MuJoCo has no helical joints, but it has {', '.join(helical)}")
    check_feet(robot, soles=True)


def mujoco_library() -> Any:
    """The module ``mujoco``.

    Raises:
        MissingDependencyError: it is not installed.
    """
    with needed_for("a simulation in MuJoCo"):
        import mujoco
    return mujoco


def _opened_window(model: Any, data: Any) -> Any:
    # Without a display the window's library ends the whole process, so this is asked first.
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError("--gui needs a display, and DISPLAY is not set; leave --gui away")
    from mujoco.viewer import launch_passive

    return launch_passive(model, data)
