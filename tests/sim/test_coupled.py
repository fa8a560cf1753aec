"""Coupled joints in both engines: the ratio holds, driven and free, and leaders feel their followers."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.kinematics.positions import tree_positions
from screwkin.sim.backend import Command
from screwkin.sim.drive import Actuation
from screwkin.sim.mujoco import MuJoCoBackend

ARM = """
[robot]
name = "geared"
base_link = "stand"
base = "fixed"

[[link]]
name = "stand"
mass = 0

[[link]]
name = "upper"
mass = 1.0
com = [0.2, 0, 0]
inertia = { xx = 0.01, yy = 0.01, zz = 0.01 }

[[link]]
name = "fore"
mass = 0.5
com = [0.6, 0, 0]
inertia = { xx = 0.01, yy = 0.01, zz = 0.01 }

[[link]]
name = "weight"
mass = 0.5
com = [0.2, 0, 0]
inertia = { xx = 0.01, yy = 0.01, zz = 0.01 }

[[joint]]
name = "shoulder"
parent = "stand"
child = "upper"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, 0]

[[joint]]
name = "elbow"
parent = "upper"
child = "fore"
type = "revolute"
s = [0, 1, 0]
s0 = [0.4, 0, 0]
mimic = { joint = "shoulder", ratio = -0.5, offset = 0.1 }

[[joint]]
name = "lift"
parent = "stand"
child = "weight"
type = "prismatic"
s = [0, 0, 1]
s0 = [0, 0, 0]
mimic = { joint = "elbow", ratio = -0.4, offset = -0.1 }
"""
ROBOT = sk.robot_from_text(ARM)
STEPS = 300


class Loose:
    """Servos that do nothing."""

    name = "loose"
    relative_rotors = False
    rotor_inertia = np.zeros(1)

    def reset(self, q):
        pass

    def actuate(self, q, qd, motor, command, dt):
        return Actuation(np.zeros(1), np.zeros(1), np.zeros(1))


def backend(engine, servos=None):
    if engine == "pybullet":
        pytest.importorskip("pybullet")
        from screwkin.sim.pybullet import PyBulletBackend

        return PyBulletBackend(ROBOT, servos=servos)
    return MuJoCoBackend(ROBOT, servos=servos)


def positions(one) -> np.ndarray:
    """Of all joints in the engine, in the order of the tree."""
    if one.name == "mujoco":
        return one.data.qpos[one._tree]
    states = one._p.getJointStates(one._body, one._tree, physicsClientId=one._client)
    return np.array([state[0] for state in states])


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_driven_coupled_joints_keep_their_ratio_and_their_leader_bears_them(engine):
    one = backend(engine)
    one.reset(sk.State(np.eye(4), np.array([0.3])))
    for k in range(STEPS):
        t = k * one.dt
        one.step(Command(np.array([0.3 + 0.3 * np.sin(3 * t)]), np.array([0.9 * np.cos(3 * t)]), np.eye(4)))
        here = positions(one)
        np.testing.assert_allclose(here, tree_positions(ROBOT, [here[0]]), rtol=0, atol=1e-5)
    seen, end = one.observe(), STEPS * one.dt
    state = sk.State(np.eye(4), seen.q)
    effort = sk.inverse_dynamics(ROBOT, state, seen.qd, np.array([-2.7 * np.sin(3 * end)]))[6]
    assert seen.torque.shape == (1,)
    assert seen.torque[0] == pytest.approx(effort, rel=2e-2)
    one.close()


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_free_swing_with_coupled_joints_keeps_its_energy(engine):
    """Energy by the library's own mass matrix and centre of mass."""

    def energy(q, qd):
        state = sk.State(np.eye(4), q)
        kinetic = 0.5 * qd @ sk.mass_matrix(ROBOT, state)[6:, 6:] @ qd
        return float(kinetic + 9.81 * ROBOT.mass * sk.center_of_mass(ROBOT, state)[2])

    one = backend(engine, Loose())
    first = one.reset(sk.State(np.eye(4), np.array([0.3])))
    for _ in range(STEPS):
        one.step(Command(np.zeros(1), np.zeros(1), np.eye(4)))
    last = one.observe()
    kinetic = energy(last.q, last.qd) - energy(last.q, np.zeros(1))
    assert kinetic > 0.1
    assert energy(last.q, last.qd) == pytest.approx(energy(first.q, first.qd), abs=0.02 * kinetic)
    one.close()


def test_in_mujoco_a_base_link_may_be_called_world_as_in_many_urdf_files():
    robot = sk.robot_from_text(ARM.replace('"stand"', '"world"'))
    one = MuJoCoBackend(robot)
    np.testing.assert_allclose(one.reset(sk.State(np.eye(4), np.array([0.3]))).q, [0.3])
    one.close()
