"""Robots with loops of their own: constraint dynamics of Pinocchio and of MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.dynamics.loops import loops_of
from screwkin.mechanism.least_values import least_values
from tests.kinematics.machines import heavy_four_bar, random_loops
from tests.oracles.closed import assert_within, deviations

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


@pytest.mark.parametrize("case", CASES)
def test_efforts_of_a_motion_cause_it_in_pinocchio_and_mujoco_too(case):
    """Newton's law along the motions that the loops leave free, loops that stay closed, and the way back."""
    robot = random_loops(*case)
    home = sk.home(robot)
    assert least_values(loops_of(robot), home.T_world_base, home.q).min() > 1e-3
    assert_within(deviations(robot, case[0]))


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
