"""Springs for servos: they yield as statics says, and nothing else changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.sim.backend import Command, Observation
from screwkin.sim.compliant import STEP, Compliance, SpringServos
from screwkin.sim.mujoco import MuJoCoBackend, MuJoCoPhysics
from screwkin.sim.pybullet import Physics, PyBulletBackend

pytest.importorskip("pybullet")

Open = Callable[..., PyBulletBackend]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("poppy12")


@pytest.fixture
def opened() -> Iterator[Open]:
    backends: list[PyBulletBackend] = []

    def open_one(robot: Robot, yields: Compliance, physics: Physics | None = None) -> PyBulletBackend:
        physics = physics or Physics(dt=STEP)
        backends.append(PyBulletBackend(robot, physics, servos=SpringServos(robot, yields, physics.dt)))
        return backends[-1]

    yield open_one
    for backend in backends:
        backend.close()


def stand(backend: PyBulletBackend, state: sk.State, steps: int) -> Observation:
    """Hold the commands of a state for some steps."""
    hold = Command(state.q, np.zeros_like(state.q), state.T_world_base)
    for _ in range(steps):
        backend.step(hold)
    return backend.observe()


def one_legged(robot: Robot) -> sk.State:
    """The robot with its CoM over the right sole and its left foot in the air."""
    home = sk.home(robot)
    T, foot = home.T_world_base.copy(), sk.frame_pose(robot, home, "left_foot")
    T[1, 3] -= 0.052
    foot[:3, 3] += [0.02, 0.0, 0.03]
    found = sk.solve_pose(
        robot, {"base": T, "right_foot": sk.frame_pose(robot, home, "right_foot"), "left_foot": foot}, home
    )
    assert found.ok
    return found.state


def test_standing_on_one_foot_it_yields_as_the_equilibrium_says(robot: Robot, opened: Open) -> None:
    """Rest does not depend on inertia or damping: both are large here, so that it comes soon."""
    state = one_legged(robot)
    expected = static_deflection(robot, state, "right_foot", 60.0)
    backend = opened(robot, Compliance(60.0, damping=3.0, rotor_inertia=5e-3))
    backend.reset(state)
    seen = stand(backend, state, 3000)
    assert np.abs(seen.qd).max() < 2e-3
    np.testing.assert_allclose(seen.q - state.q, expected.theta, rtol=0, atol=3e-4)
    assert np.abs(expected.theta).max() > 5e-3
    np.testing.assert_allclose(seen.torque, expected.torque, rtol=0, atol=0.02)
    sunk = seen.T_world_foot[0, 2, 3] - sk.frame_pose(robot, state, "left_foot")[2, 3]
    feet = [limb.tip for limb in robot.limbs if limb.kind == "leg"]
    assert feet[0] == "left_foot"
    assert sunk == pytest.approx(expected.of("left_foot")[5], abs=3e-4)


def test_in_mujoco_it_yields_as_the_equilibrium_says_too(robot: Robot) -> None:
    """There the rotors turn with their joints alone; rest is the same."""
    pytest.importorskip("mujoco")
    state = one_legged(robot)
    expected = static_deflection(robot, state, "right_foot", 60.0)
    servos = SpringServos(robot, Compliance(60.0, damping=3.0, rotor_inertia=5e-3))
    backend = MuJoCoBackend(robot, MuJoCoPhysics(dt=STEP), servos=servos)
    backend.reset(state)
    hold = Command(state.q, np.zeros_like(state.q), state.T_world_base)
    for _ in range(1500):
        backend.step(hold)
    seen = backend.observe()
    assert np.abs(seen.qd).max() < 1e-4
    np.testing.assert_allclose(seen.q - state.q, expected.theta, rtol=0, atol=2e-5)
    np.testing.assert_allclose(seen.torque, expected.torque, rtol=0, atol=1e-3)


def test_commands_lead_a_moving_joint_by_its_damper(robot: Robot, opened: Open) -> None:
    """The first torque of a step is the spring's and the damper's, within the servo's effort."""
    home = sk.home(robot)
    backend = opened(robot, Compliance(60.0, damping=0.5))
    backend.reset(home)
    rate = np.linspace(-1, 1, 12)
    backend.step(Command(home.q + 0.01, rate, home.T_world_base))
    np.testing.assert_allclose(backend.observe().torque, 0.6 + 0.5 * rate, rtol=0, atol=1e-9)
    backend.step(Command(home.q + 1.0, rate, home.T_world_base))
    np.testing.assert_allclose(backend.observe().torque, [j.effort for j in robot.joints])


def test_elastic_soles_sink_by_the_weight_over_their_stiffness(robot: Robot) -> None:
    """Eight corners bear the weight, each a spring; Bullet lets rigid bodies overlap by 10 um already."""
    home = sk.home(robot)
    hold = Command(home.q, np.zeros_like(home.q), home.T_world_base)
    for stiffness, sunk in ((None, 0.0), (2e4, robot.mass * 9.81 / 8 / 2e4)):
        backend = PyBulletBackend(robot, Physics(sole_stiffness=stiffness, sole_damping=100.0))
        backend.reset(home)
        for _ in range(600):
            backend.step(hold)
        depth = -backend.observe().T_world_foot[:, 2, 3]
        backend.close()
        assert depth == pytest.approx(1e-5 + sunk, abs=5e-7)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sole_stiffness": 0.0}, "sole_stiffness is 0.0; it must be a positive number"),
        ({"sole_stiffness": float("nan")}, "sole_stiffness is nan"),
        ({"sole_stiffness": 2e4, "sole_damping": -1.0}, "sole_damping is -1.0; it must be a finite number"),
    ],
)
def test_impossible_soles_are_refused(robot: Robot, change: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        PyBulletBackend(robot, Physics(**change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stiffness": 0.0}, "stiffness is 0.0; it must be a positive number"),
        ({"stiffness": -5.0}, "stiffness is -5.0"),
        ({"damping": -1.0}, "damping is -1.0; it must be a finite number"),
        ({"rotor_inertia": 0.0}, "rotor_inertia is 0.0"),
        ({"damping": 2.0}, r"a step of 0\.5 ms is too long .* take less than 0\.494 ms"),
    ],
)
def test_impossible_springs_are_refused(robot: Robot, change: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SpringServos(robot, Compliance(**{"stiffness": 100.0, **change}))


def test_the_longest_step_is_where_a_link_on_a_spring_begins_to_swing_up() -> None:
    """Semi-implicit Euler with the refused and the accepted step, on the lightest link itself."""

    def largest(dt: float, k: float = 100.0, d: float = 2.0, inertia: float = 5e-4) -> float:
        x, v = 1e-3, 0.0
        for _ in range(2000):
            v += dt * (-k * x - d * v) / inertia
            x += dt * v
        return abs(x)

    longest = (np.sqrt(2.0**2 + 4 * 100.0 * 5e-4) - 2.0) / 100.0
    assert 1e3 * longest == pytest.approx(0.494, abs=5e-4)
    assert largest(0.99 * longest) < 1e-3 < 1.0 < largest(1.01 * longest)


def test_weak_servos_stay_within_their_effort(robot: Robot, opened: Open) -> None:
    weak = replace(robot, joints=tuple(replace(joint, effort=0.1) for joint in robot.joints))
    home = sk.home(robot)
    backend = opened(weak, Compliance(100.0))
    backend.reset(home)
    largest = max(np.abs(stand(backend, home, 1).torque).max() for _ in range(200))
    assert largest == pytest.approx(0.1)
