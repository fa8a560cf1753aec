"""Robots with loops of their own: Pinocchio's constraint dynamics, and MuJoCo's constrained inverse."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.dynamics.loops import driving_joints, loops_of
from screwkin.mechanism.least_values import least_values
from tests.kinematics.machines import array_of, heavy_four_bar, pose, random_loops
from tests.oracles.closed import constrained, pin

CASES = [
    (0, 1, "fixed", False),
    (1, 1, "floating", False),
    (2, 2, "floating", False),
    (5, 3, "fixed", False),
    (3, 4, "floating", False),
    (0, 1, "fixed", True),
    (1, 3, "floating", True),
    (2, 4, "fixed", True),
]
"""Seed, loops, base, and whether all axes are parallel."""


@pytest.mark.parametrize(("seed", "loops_count", "base", "planar"), CASES)
def test_efforts_of_a_motion_cause_it_in_pinocchio_too(seed, loops_count, base, planar):
    """Newton's law along the motions that the loops leave free, loops that stay closed, and the way back."""
    robot = random_loops(seed, loops_count, base, planar)
    rng = np.random.default_rng(seed)
    mechanism, home = loops_of(robot), sk.home(robot)
    assert least_values(mechanism, home.T_world_base, home.q).min() > 1e-3
    n, R = len(robot.joints), array_of(pose(rng))[:3, :3]
    T = np.eye(4)
    T[:3, :3] = R
    state = sk.State(T, home.q)
    qd, qdd = np.zeros((2, n))
    driving = [robot.joint_names.index(name) for name in driving_joints(robot)]
    qd[driving], qdd[driving] = rng.uniform(-1, 1, (2, len(driving)))
    twist, rate = rng.uniform(-1, 1, (2, 6)) * (base == "floating")
    force = sk.inverse_dynamics(robot, state, qd, qdd, twist, rate)
    found = sk.forward_dynamics(robot, state, qd, force[6:], twist, force[:6])
    np.testing.assert_allclose(found[6:][driving], qdd[driving], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found[:6], rate, rtol=1e-9, atol=1e-9)

    model, constraints, places = constrained(robot)
    data = model.createData()
    q = pin.neutral(model)
    q[3:7] = Rotation.from_matrix(R).as_quat()
    for name, value in zip(robot.joint_names, state.q, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = value
    v, a, tau = np.zeros((3, model.nv))
    v[:3], v[3:6] = R.T @ twist[3:], R.T @ twist[:3]
    v[places] = all_rates(robot, state, qd)
    a[:3], a[3:6] = R.T @ (rate[3:] - np.cross(twist[:3], twist[3:])), R.T @ rate[:3]
    a[places] = found[6:]
    tau[:3], tau[3:6] = R.T @ force[3:6], R.T @ force[:3]
    tau[places] = force[6:]

    def loops(x):
        """Jacobian of what the two sides of every closure move differently, at the world origin."""
        pin.computeJointJacobians(model, data, x)
        sides = [(one.joint1_id, one.joint2_id) for one in constraints]
        jacobian = lambda side: pin.getJointJacobian(model, data, side, pin.ReferenceFrame.WORLD)  # noqa: E731
        return np.vstack([jacobian(a) - jacobian(b) for a, b in sides])

    J, h = loops(q), 1e-5
    np.testing.assert_allclose(J @ v, 0, atol=1e-9)
    moved = [loops(pin.integrate(model, q, k * h * v)) for k in (-1, 1)]
    np.testing.assert_allclose(J @ a, -(moved[1] - moved[0]) / (2 * h) @ v, atol=1e-6)
    _, S, V = np.linalg.svd(J)
    free = V[(1e-9 * S[0] < S).sum() :]
    needed = pin.rnea(model, data, q, v, a)
    np.testing.assert_allclose(free @ needed, free @ tau, atol=1e-9)
    kept = pin.StdVec_RigidConstraintData()
    kept.extend(c.createData() for c in constraints)
    pin.initConstraintDynamics(model, data, constraints, kept)
    proximal = pin.ProximalSettings(1e-14, 1e-12, 100)
    theirs = pin.constraintDynamics(model, data, q, v, tau, constraints, kept, proximal)
    np.testing.assert_allclose(theirs, a, atol=1e-9 * (1 + np.abs(a).max()))


def all_rates(robot, state, qd):
    """Rates of all joints from those that drive, by singular values of N."""
    mechanism = loops_of(robot)
    N = sk.network_matrix(mechanism, state)
    driving = [mechanism.position[name] for name in mechanism.primary]
    following = mechanism.secondary_columns
    rates = np.zeros(len(mechanism.couplings))
    rates[driving] = [qd[robot.joint_names.index(name)] for name in mechanism.primary]
    rates[following] = np.linalg.lstsq(N[:, following], -N[:, driving] @ rates[driving], rcond=None)[0]
    return rates[[mechanism.position[name] for name in robot.joint_names]]


def test_torques_of_a_moving_four_bar_are_mujocos_constrained_inverse_dynamics():
    """What MuJoCo's mass matrix and bias need, seen by the only motion that its weld leaves free."""
    mujoco = pytest.importorskip("mujoco")
    from screwkin.sim.mujoco import MuJoCoBackend

    robot = heavy_four_bar().with_inertia_floor()  # as MuJoCo wants it of the massless eye
    backend = MuJoCoBackend(robot)
    model, data = backend.model, backend.data
    model.opt.gravity[:] = [0, -9.81, 0]
    model.dof_armature[:] = 0
    turned = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    angles = np.linspace(0.1, 6.2, 20)
    closed = sk.close_loops(sk.closed_mechanism(robot), sk.home(robot), {"crank": angles}).state
    state = sk.State(np.broadcast_to(turned, (20, 4, 4)), closed.q)
    qd, qdd = np.zeros((2, 20, 4))
    qd[:, 0], qdd[:, 0] = 3.0, 7.0
    torque = sk.inverse_dynamics(robot, state, qd, qdd)
    every = sk.forward_dynamics(robot, state, qd, torque[:, 6:])[:, 6:]
    dofs = [model.joint(name).dofadr[0] for name in robot.joint_names]
    places = [model.joint(name).qposadr[0] for name in robot.joint_names]
    for k in range(20):
        data.qpos[places] = state.q[k]
        mujoco.mj_forward(model, data)
        J = data.efc_J.reshape(-1, model.nv)[: data.ne]
        _, S, V = np.linalg.svd(J)
        free = V[(1e-9 * S[0] < S).sum() :]
        assert len(free) == 1
        rates = free[0] / free[0, dofs[0]]
        data.qvel[:] = 3.0 * rates
        data.qacc[dofs] = every[k]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        needed = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, needed, data.qacc.copy())
        needed += data.qfrc_bias
        assert torque[k, 6] == pytest.approx(rates @ needed, rel=1e-8)
