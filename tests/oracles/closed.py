"""A robot with loops as Pinocchio's and MuJoCo's model, and how far its dynamics are from ours there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.algebra.se3 import Pose, as_array
from screwkin.dynamics.loops import driving_joints, loops_of
from screwkin.model.robot import Inertia, Joint, Link, Robot
from tests.kinematics.machines import array_of, pose
from tests.oracles.welded import welded

pin: Any = __import__("pinocchio")


BOUNDS = {
    "back": 1e-9,
    "closed": 1e-9,
    "bent": 1e-6,
    "newton": 1e-9,
    "pinocchio": 1e-9,
    "parting": 1e-9,
    "mujoco": 1e-9,
}
"""Of the deviations below; what bends is a finite difference."""


def assert_within(found: dict[str, float]) -> None:
    """That no deviation exceeds its bound."""
    beyond = {name: value for name, value in found.items() if not value <= BOUNDS[name]}
    assert not beyond, beyond


@dataclass(frozen=True, eq=False)
class Motion:
    """A random motion of a robot with loops, and the force that causes it by our dynamics.

    R (3, 3) of the base, which stands at the world origin; twist and rate (6,) of the base; qd, qdd (n,) of
    the joints that drive; rates (n,) of all joints; force (6+n,) by inverse dynamics; found (6+n,) by forward
    dynamics: accelerations.
    """

    state: sk.State
    qd: Any
    qdd: Any
    twist: Any
    rate: Any
    rates: Any
    force: Any
    found: Any

    @property
    def R(self) -> Any:
        """(3, 3) of the base."""
        return self.state.T_world_base[:3, :3]


def random_motion(robot: Robot, seed: int) -> Motion:
    """A motion of a robot that is closed at home, away from singular postures."""
    rng = np.random.default_rng(seed)
    n, T = len(robot.joints), np.eye(4)
    T[:3, :3] = array_of(pose(rng))[:3, :3]
    state = sk.State(T, sk.home(robot).q)
    qd, qdd = np.zeros((2, n))
    driving = _driving(robot)
    qd[driving], qdd[driving] = rng.uniform(-1, 1, (2, len(driving)))
    twist, rate = rng.uniform(-1, 1, (2, 6)) * (robot.base == "floating")
    force = sk.inverse_dynamics(robot, state, qd, qdd, twist, rate)
    found = sk.forward_dynamics(robot, state, qd, force[6:], twist, force[:6])
    return Motion(state, qd, qdd, twist, rate, all_rates(robot, state, qd), force, found)


def _driving(robot: Robot) -> list[int]:
    return [robot.joint_names.index(name) for name in driving_joints(robot)]


def deviations(robot: Robot, seed: int) -> dict[str, float]:
    """How far a random motion of a robot with loops is from the engines', each relative to its largest value.

    Args:
        robot: closed at home, away from singular postures.
        seed: of the motion.

    Returns:
        ``back``: accelerations that forward dynamics makes of the efforts of inverse dynamics;
        ``closed``: rates at which the loops' ends part; ``bent``: their accelerations, against differences;
        ``newton``: the efforts along all that the loops leave free, against recursive Newton-Euler;
        ``pinocchio``: accelerations by its constraint dynamics; ``parting`` and ``mujoco``: as ``closed`` and
        ``newton``, by MuJoCo's equality constraints, mass matrix, bias and springs.
    """
    motion, driving = random_motion(robot, seed), _driving(robot)
    wanted, found = np.r_[motion.rate, motion.qdd[driving]], motion.found
    back = _apart(np.r_[found[:6], found[6:][driving]], wanted, found)
    return {"back": back, **in_pinocchio(robot, motion), **in_mujoco(robot, motion)}


def in_pinocchio(robot: Robot, motion: Motion) -> dict[str, float]:
    """What ``deviations`` says of Pinocchio."""
    model, constraints, places = constrained(robot)
    data, R = model.createData(), motion.R
    q = pin.neutral(model)
    q[3:7] = Rotation.from_matrix(R).as_quat()
    for name, value in zip(robot.joint_names, motion.state.q, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = value
    v, a, tau = np.zeros((3, model.nv))
    twist, rate, force = motion.twist, motion.found[:6], motion.force
    v[:3], v[3:6] = R.T @ twist[3:], R.T @ twist[:3]
    v[places] = motion.rates
    a[:3], a[3:6] = R.T @ (rate[3:] - np.cross(twist[:3], twist[3:])), R.T @ rate[:3]
    a[places] = motion.found[6:]
    tau[:3], tau[3:6] = R.T @ force[3:6], R.T @ force[:3]
    tau[places] = force[6:]

    def parting(x: Any) -> Any:
        """Jacobian of what the two sides of every closure move differently, at the world origin."""
        pin.computeJointJacobians(model, data, x)
        sides = [(one.joint1_id, one.joint2_id) for one in constraints]
        jacobian = lambda side: pin.getJointJacobian(model, data, side, pin.ReferenceFrame.WORLD)  # noqa: E731
        return np.vstack([jacobian(a) - jacobian(b) for a, b in sides])

    J, h = parting(q), 1e-5
    moved = [parting(pin.integrate(model, q, k * h * v)) for k in (-1, 1)]
    needed = pin.rnea(model, data, q, v, a)
    return {
        "closed": _apart(J @ v, 0.0, v),
        "bent": _apart(J @ a, -(moved[1] - moved[0]) / (2 * h) @ v, a),
        "newton": _apart_freely(J, needed, tau),
        "pinocchio": _apart(_accelerations(model, data, q, v, tau, constraints), a, a),
    }


def in_mujoco(robot: Robot, motion: Motion) -> dict[str, float]:
    """What ``deviations`` says of MuJoCo."""
    mujoco = __import__("mujoco")
    model, dofs, advances = welded(robot, motion.R)
    data = mujoco.MjData(model)
    pitches = np.array([joint.screw.pitch for joint in robot.joints if joint.type == "helical"], float)
    helices = [i for i, joint in enumerate(robot.joints) if joint.type == "helical"]
    shift = 1 if robot.base == "floating" else 0  # a quaternion has one number more than a rate
    if shift:
        quat = np.roll(Rotation.from_matrix(motion.R).as_quat(), 1)
        data.qpos[:7] = np.r_[np.zeros(3), quat]
    data.qpos[dofs + shift] = motion.state.q
    data.qpos[advances + shift] = pitches * motion.state.q[helices]
    v, a, tau = np.zeros((3, model.nv))
    for values, base, joints in ((v, motion.twist, motion.rates), (a, motion.found[:6], motion.found[6:])):
        values[dofs], values[advances] = joints, pitches * joints[helices]
        if shift:
            values[:3], values[3:6] = base[3:], motion.R.T @ base[:3]
    tau[dofs] = motion.force[6:]
    if shift:
        tau[:3], tau[3:6] = motion.force[3:6], motion.R.T @ motion.force[:3]
    data.qvel[:] = v
    mujoco.mj_forward(model, data)
    J = data.efc_J.reshape(-1, model.nv)[: data.ne]
    needed = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, needed, a)
    return {
        "parting": _apart(J @ v, 0.0, v),
        "mujoco": _apart_freely(J, needed + data.qfrc_bias - data.qfrc_passive, tau),
    }


def _apart_freely(J: Any, needed: Any, efforts: Any) -> float:
    """How far efforts are from those that a motion needs, along all that constraints leave free."""
    _, S, V = np.linalg.svd(J)
    free = V[(1e-9 * S[0] < S).sum() :]
    return _apart(free @ needed, free @ efforts, needed)


def _accelerations(model: Any, data: Any, q: Any, v: Any, tau: Any, constraints: Any) -> Any:
    """By Pinocchio's constraint dynamics."""
    kept = pin.StdVec_RigidConstraintData()
    kept.extend(c.createData() for c in constraints)
    pin.initConstraintDynamics(model, data, constraints, kept)
    proximal = pin.ProximalSettings(1e-14, 1e-12, 100)
    return pin.constraintDynamics(model, data, q, v, tau, constraints, kept, proximal)


def _apart(found: Any, wanted: Any, size: Any) -> float:
    """Largest difference, over 1 and the largest of what stands for its size."""
    return float(np.abs(found - wanted).max(initial=0.0) / (1.0 + np.abs(size).max()))


def all_rates(robot: Robot, state: Any, qd: Any) -> Any:
    """Rates of all joints from those that drive, by singular values of N."""
    mechanism = loops_of(robot)
    N = sk.network_matrix(mechanism, state)
    driving = [mechanism.position[name] for name in mechanism.primary]
    following = mechanism.secondary_columns
    rates = np.zeros(len(mechanism.couplings))
    rates[driving] = [qd[robot.joint_names.index(name)] for name in mechanism.primary]
    rates[following] = np.linalg.lstsq(N[:, following], -N[:, driving] @ rates[driving], rcond=None)[0]
    return rates[[mechanism.position[name] for name in robot.joint_names]]


def depth_first(robot: Robot) -> list[Joint]:
    """Every joint right before all that it carries: Pinocchio takes a subtree for a stretch of indices.

    In any other order its mass matrix, and with it its constraint dynamics, is wrong without a word.
    """
    below = [joint for joint in robot.tree if joint.parent == robot.base_link]
    order = []
    while below:
        order.append(joint := below.pop(0))
        below = [other for other in robot.tree if other.parent == joint.child] + below
    return order


def constrained(robot: Robot) -> tuple[Any, Any, list[int]]:
    """Model, constraints and for every joint its index in the velocity; frames are parallel to the base."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    carrier, origin = {robot.base_link: root}, {robot.base_link: np.zeros(3)}
    for joint in depth_first(robot):
        axis, place = np.array([*joint.screw.s], float), np.array([*joint.screw.s0], float)
        kind = {
            "revolute": lambda a=axis: pin.JointModelRevoluteUnaligned(a),
            "prismatic": lambda a=axis: pin.JointModelPrismaticUnaligned(a),
            "helical": lambda a=axis, h=joint.screw.pitch: pin.JointModelHelicalUnaligned(a, h),
        }[joint.type]()
        at = pin.SE3(np.eye(3), place - origin[joint.parent])
        carrier[joint.child] = model.addJoint(carrier[joint.parent], kind, at, joint.name)
        origin[joint.child] = place
    for link in robot.links:
        model.appendBodyToJoint(carrier[link.name], _inertia(link), pin.SE3(np.eye(3), -origin[link.name]))
    constraints = pin.StdVec_RigidConstraintModel()
    constraints.extend(
        pin.RigidConstraintModel(
            pin.ContactType.CONTACT_6D,
            model,
            carrier[c.link_a],
            _placement(c.frame_a, origin[c.link_a]),
            carrier[c.link_b],
            _placement(c.frame_b, origin[c.link_b]),
            pin.ReferenceFrame.LOCAL,
        )
        for c in robot.closures
    )
    places = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]
    return model, constraints, places


def _inertia(link: Link) -> Any:
    i: Inertia = link.inertia
    tensor = np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], float)
    return pin.Inertia(float(link.mass), np.array([*link.com], float), tensor)


def _placement(frame: Pose, origin: Any) -> Any:
    T = np.array(as_array(frame), float)
    return pin.SE3(T[:3, :3], T[:3, 3] - origin)
