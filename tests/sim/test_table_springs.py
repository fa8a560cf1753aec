"""Springs of a table in both engines: they swing and settle as the dynamics and statics say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import screwkin as sk
from screwkin.errors import InputError
from screwkin.sim.backend import Command
from screwkin.sim.mujoco import MuJoCoBackend, MuJoCoPhysics
from screwkin.sim.pybullet import Physics, PyBulletBackend
from screwkin.sim.table_springs import check_spring_steps
from tests.dynamics.test_joint_springs import sprung_arm
from tests.linked import GAIT_OF_LEAVES, gaps, leaf_legs

FREE = "passive = true\nstiffness = 40\nrest = 0.2\ndamping = 0.1"
START = sk.State(np.eye(4), np.array([0.5, 0.0]))


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_sprung_arm_swings_as_its_dynamics_say(engine: str) -> None:
    """A quarter of a second at .25 ms; the elbow's motor is held by both engines, and by a stiff arm here."""
    robot = sprung_arm(FREE)
    other = {"mujoco": MuJoCoPhysics(dt=2.5e-4), "pybullet": Physics(dt=2.5e-4)}[engine]
    backend = {"mujoco": MuJoCoBackend, "pybullet": PyBulletBackend}[engine](robot, other)
    backend.reset(START)
    for _ in range(1000):
        backend.step(Command(START.q, np.zeros(2), np.eye(4)))
    seen = backend.observe()
    backend.close()

    def motion(_: float, x: np.ndarray) -> list[float]:
        at, rate = sk.State(np.eye(4), np.array([x[0], 0.0])), np.array([x[1], 0.0])
        free = np.array([sk.forward_dynamics(robot, at, rate, [0.0, e])[6:] for e in (0.0, 1.0)])
        held = free[0, 1] / (free[0, 1] - free[1, 1])
        return [x[1], float(free[0, 0] + held * (free[1, 0] - free[0, 0]))]

    wanted = solve_ivp(motion, (0, 0.25), [0.5, 0.0], rtol=1e-8, atol=1e-10).y[:, -1]
    assert abs(wanted[0] - 0.5) > 0.05
    assert seen.q[0] == pytest.approx(wanted[0], abs=2e-3)
    assert seen.torque[0] == 0


@pytest.mark.parametrize("engine", ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow)])
def test_leaf_legs_stand_on_their_leaves(engine: str) -> None:
    """Both engines let the leaves yield alike under the weight, and loops stay closed."""
    robot = leaf_legs()
    home = sk.home(robot)
    backend = {"mujoco": MuJoCoBackend, "pybullet": PyBulletBackend}[engine](robot)
    backend.reset(home)
    sinks, leaves = [], []
    names = [robot.joint_names.index(f"{side}_shin_leaf") for side in ("right", "left")]
    for _ in range(200):
        backend.step(Command(home.q, np.zeros_like(home.q), home.T_world_base))
        seen = backend.observe()
        sinks.append(seen.T_world_base[2, 3] - home.T_world_base[2, 3])
        leaves.append(seen.q[names])
    backend.close()
    assert gaps(robot, seen.q).max() < 1e-3
    assert -1e-3 < np.mean(sinks[80:]) < -2e-4
    np.testing.assert_allclose(np.mean(leaves[80:], axis=0), 0.008, atol=0.002)
    assert np.abs(np.asarray(seen.torque)[names]).max() == 0


def test_a_step_that_is_too_long_for_a_spring_is_refused_and_a_shorter_one_stays_bounded() -> None:
    """The bound is that of semi-implicit Euler: just below it nothing grows, above it MuJoCo is not asked."""
    hard = sprung_arm("passive = true\nstiffness = 1e6")
    with pytest.raises(
        InputError, match=r"a step of 1 ms is too long for the spring of shoulder, .* less than 0\."
    ):
        MuJoCoBackend(hard)
    with pytest.raises(InputError, match="too long for the spring of shoulder"):
        PyBulletBackend(hard)
    check_spring_steps(hard, 1e-4)
    check_spring_steps(sk.load_robot("bioloid"), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_steps_on_leaf_springs_pass(engine: str) -> None:
    robot = leaf_legs()
    walk = sk.walk(robot, sk.load_gait("walk").replace(**GAIT_OF_LEAVES), 2)
    verdict = sk.validate(robot, walk, engine=engine)
    assert verdict.passed
    assert verdict.engine == engine
