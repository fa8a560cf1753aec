"""Limbs that swing freely keep their energy, by the library's own mass matrix, in both engines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.arrays import Array
from screwkin.model.robot import Inertia, Robot
from screwkin.sim.backend import Command
from screwkin.sim.drive import Actuation

DT = 2e-4


class Limp:
    """Servos that do nothing."""

    name = "limp"
    relative_rotors = False

    def __init__(self, robot: Robot, rotor: float = 0.0) -> None:
        self.rotor_inertia = np.full(len(robot.joints), rotor)

    def reset(self, q: Array) -> None:
        pass

    def actuate(self, q: Array, qd: Array, motor: Array, command: Command, dt: float) -> Actuation:
        return Actuation(0 * q, 0 * q, 0 * q)


def backend_of(engine: str, robot: Robot, rotor: float = 0.0) -> Any:
    pytest.importorskip(engine)
    if engine == "pybullet":
        from screwkin.sim.pybullet import Physics, PyBulletBackend

        return PyBulletBackend(robot, Physics(dt=DT), servos=Limp(robot, rotor))
    from screwkin.sim.mujoco import MuJoCoBackend, MuJoCoPhysics

    return MuJoCoBackend(robot, MuJoCoPhysics(dt=DT), servos=Limp(robot, rotor))


def swung(backend: Any, state: sk.State, steps: int) -> tuple[Array, Array]:
    """Positions and rates (steps, n); both engines take semi-implicit steps, so the rate at a position is the
    mean of those of the steps before and after it, to second order."""
    backend.reset(state)
    command = Command(state.q, np.zeros_like(state.q), state.T_world_base)
    seen = []
    for _ in range(steps + 1):
        backend.step(command)
        seen.append(backend.observe())
    backend.close()
    q, qd = (np.array([getattr(o, name) for o in seen]) for name in ("q", "qd"))
    return q[:-1], (qd[:-1] + qd[1:]) / 2


def energies(robot: Robot, T: Array, q: Array, qd: Array) -> tuple[Array, Array]:
    """Kinetic and potential energy (K,) of the robot on its fixed base [J]."""
    tree = replace(robot, closures=())
    state = sk.State(np.broadcast_to(T, (len(q), 4, 4)), q)
    M = sk.mass_matrix(tree, state)[:, 6:, 6:]
    kinetic = 0.5 * np.einsum("ki,kij,kj->k", qd, M, qd)
    return kinetic, robot.mass * 9.81 * sk.center_of_mass(tree, state)[:, 2]


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_robot_hung_up_swings_without_losing_energy(engine: str) -> None:
    """All 18 joints limp and without limits: a second of a chaotic swing."""
    robot = sk.load_robot("bioloid")
    free = tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in robot.joints)
    robot = replace(robot, base="fixed", joints=free)
    simulated = robot if engine == "mujoco" else robot.with_inertia_floor()
    T, q = np.eye(4), np.zeros(len(robot.joints))
    T[2, 3] = 1.0
    for name, angle in (("right_hip_pitch", -0.8), ("left_knee", 0.7), ("right_elbow", -0.6)):
        q[robot.joint_names.index(name)] = angle
    q, qd = swung(backend_of(engine, robot), sk.State(T, q), round(1 / DT))
    kinetic, potential = energies(simulated, T, q[::20], qd[::20])
    total = kinetic + potential
    assert kinetic.max() > 0.05
    assert np.abs(total - total[0]).max() < 1e-3 * kinetic.max()


def test_a_linkage_swings_without_losing_energy() -> None:
    """Its loop is a constraint, which does no work; its mass matrix is that of the open tree."""
    bar = Inertia(1e-5, 1e-4, 1e-4)
    four_bar = sk.load_robot("linkages/four-bar")
    # The mechanism lies in the plane of x and y: gravity needs it upright.
    robot = replace(four_bar, links=tuple(replace(x, mass=0.1, inertia=bar) for x in four_bar.links))
    T = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    home = sk.State(T, np.array(robot.posture("home").q))
    q, qd = swung(backend_of("mujoco", robot), home, round(1 / DT))
    kinetic, potential = energies(robot, T, q[::20], qd[::20])
    total = kinetic + potential
    assert kinetic.max() > 0.01
    assert np.abs(total - total[0]).max() < 1e-3 * kinetic.max()


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_rotor_slows_the_swing_as_its_inertia_says(engine: str) -> None:
    """A forearm hanging from a locked arm: period 2 pi sqrt((I + rotor) / (m g l)) for small angles."""
    robot = sk.load_robot("bioloid")
    forearm, elbow = robot.link("right_forearm"), robot.joint("right_elbow")
    base = replace(robot.link("right_upper_arm"), name="post", boxes=())
    pendulum = replace(
        robot,
        base="fixed",
        base_link="post",
        links=(base, replace(forearm, boxes=())),
        joints=(replace(elbow, parent="post", lower=-np.inf, upper=np.inf),),
        limbs=(),
        soles=(),
        postures=(),
        servos={},
        waist=None,
    )
    rotor, length = 2e-4, float(elbow.screw.s0.z - forearm.com.z)
    s = elbow.screw.s
    about = forearm.inertia.yy if abs(float(s.y)) == 1 else forearm.inertia.xx
    inertia = float(about + forearm.mass * length**2) + rotor
    omega = np.sqrt(forearm.mass * 9.81 * length / inertia)
    T = np.eye(4)
    T[2, 3] = 1.0
    q, _ = swung(backend_of(engine, pendulum, rotor), sk.State(T, np.array([0.02])), round(0.5 / DT))
    time = DT * (1 + np.arange(len(q)))
    np.testing.assert_allclose(q[:, 0], 0.02 * np.cos(omega * time), rtol=0, atol=1e-4)
