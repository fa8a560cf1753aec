"""The robot in PyBullet is the robot of the table, and nothing is added to its physics."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import screwkin as sk
import screwkin.sim.pybullet as module
from screwkin.errors import InputError, MissingDependencyError
from screwkin.model.robot import Robot
from screwkin.sim.backend import Command, Observation
from screwkin.sim.pybullet import Physics, PyBulletBackend

pytest.importorskip("pybullet")

Open = Callable[..., PyBulletBackend]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture
def opened() -> Iterator[Open]:
    """Opens backends, and closes them after the test."""
    backends: list[PyBulletBackend] = []

    def open_one(robot: Robot, physics: Physics | None = None) -> PyBulletBackend:
        backends.append(PyBulletBackend(robot, physics))
        return backends[-1]

    yield open_one
    for backend in backends:
        backend.close()


def stand(backend: PyBulletBackend, state: sk.State, steps: int) -> Observation:
    """Hold the joints of a state for some steps."""
    hold = Command(state.q, np.zeros_like(state.q), state.T_world_base)
    for _ in range(steps):
        backend.step(hold)
    return backend.observe()


def test_the_direct_solver_has_converged_whatever_the_iterations(robot: Robot, opened: Open) -> None:
    """Its contact forces are those of a hundred times the regularisation; ten Gauss-Seidel sweeps are off."""
    seen = {}
    for name, physics in {
        "usual": Physics(solver="direct"),
        "few": Physics(solver="direct", iterations=5),
        "softer": Physics(solver="direct", regularisation=1e-6),
        "sweeps": Physics(iterations=10, solver="iterative"),
    }.items():
        backend = opened(robot, physics)
        backend.reset(sk.home(robot))
        seen[name] = stand(backend, sk.home(robot), 60)
    force = {name: sum(np.array(c.force) for c in one.contacts) for name, one in seen.items()}
    np.testing.assert_array_equal(seen["few"].torque, seen["usual"].torque)
    np.testing.assert_allclose(force["softer"], force["usual"], atol=1e-3)
    assert force["usual"][2] == pytest.approx(float(robot.mass) * 9.81, rel=1e-3)
    assert force["sweeps"][2] != pytest.approx(float(robot.mass) * 9.81, rel=1e-3)


def test_elastic_soles_are_solved_iteratively_and_nothing_is_printed(
    robot: Robot, opened: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    assert opened(robot, Physics(solver="direct")).settings["solver"] == "direct"
    assert opened(robot, Physics(solver="direct", sole_stiffness=2e4)).settings["solver"] == "iterative"
    assert capfd.readouterr() == ("", "")


def test_a_reset_puts_base_joints_and_feet_where_the_kinematics_say(robot: Robot, opened: Open) -> None:
    """The base frame is not PyBullet's, which has its origin in the torso's centre of mass."""
    rng = np.random.default_rng(3)
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=4).as_matrix()
    T[:3, 3] = [0.3, -0.2, 1.0]
    state = sk.State(T, rng.uniform(-1.5, 1.5, len(robot.joints)))
    seen = opened(robot).reset(state)
    assert np.allclose(seen.T_world_base, T, rtol=0, atol=1e-7)
    assert np.allclose(seen.q, state.q, rtol=0, atol=1e-15)
    assert not seen.qd.any()
    for pose, limb in zip(seen.T_world_foot, [x for x in robot.limbs if x.kind == "leg"], strict=True):
        assert np.allclose(pose, sk.frame_pose(robot, state, limb.tip), rtol=0, atol=1e-6)


def test_a_lifted_robot_falls_freely_without_any_damping(robot: Robot, opened: Open) -> None:
    """Semi-implicit Euler drops g dt^2 n (n+1) / 2; PyBullet's default damping would lose a thousandth."""
    home = sk.home(robot)
    T = home.T_world_base.copy()
    T[2, 3] += 2.0
    backend = opened(robot)
    backend.reset(sk.State(T, home.q))
    seen = stand(backend, home, 300)
    drop = 9.81 * 1e-6 * 300 * 301 / 2
    assert T[2, 3] - seen.T_world_base[2, 3] == pytest.approx(drop, rel=1e-6)
    assert seen.contacts == ()


def test_released_joints_swing_without_losing_energy(robot: Robot, opened: Open) -> None:
    """In 0.2 s PyBullet's default damping takes 340 uJ from the swing, the integrator's error is 12 uJ."""
    limp = replace(robot, joints=tuple(replace(joint, effort=1e-12) for joint in robot.joints), base="fixed")
    simulated = robot.with_inertia_floor()
    backend = opened(limp, Physics(dt=1e-4))
    q = np.zeros(len(robot.joints))
    q[robot.joint_names.index("right_elbow")] = -1.0
    high = np.eye(4)
    high[2, 3] = 1.0
    state = sk.State(high, q)
    backend.reset(state)

    def energy(seen: Observation) -> float:
        now = sk.State(seen.T_world_base, seen.q)
        v = np.concatenate([np.zeros(6), seen.qd])
        height = float(sk.center_of_mass(simulated, now)[2])
        return float(0.5 * v @ sk.mass_matrix(simulated, now) @ v + simulated.mass * 9.81 * height)

    before = energy(backend.observe())
    after = stand(backend, state, 2000)
    assert np.abs(after.qd).max() > 1.0
    assert energy(after) == pytest.approx(before, rel=0, abs=30e-6)


def test_a_standing_robot_weighs_what_it_weighs_over_its_centre_of_mass(robot: Robot, opened: Open) -> None:
    """Statics: the floor bears the weight, with its centre of pressure below the CoM."""
    home = sk.home(robot)
    backend = opened(robot)
    backend.reset(home)
    forces, moments, ankles = [], [], []
    stand(backend, home, 300)
    for _ in range(100):
        seen = stand(backend, home, 1)
        forces.append(sum((np.array(c.force) for c in seen.contacts), np.zeros(3)))
        moments.append(sum((np.cross(c.point, c.force) for c in seen.contacts), np.zeros(3)))
        ankles.append(seen.ankle_wrench.sum(axis=0))
    force, moment = np.mean(forces, axis=0), np.mean(moments, axis=0)
    com = sk.center_of_mass(robot, sk.State(seen.T_world_base, seen.q))
    assert force[2] == pytest.approx(robot.mass * 9.81, rel=2e-3)
    assert np.abs(force[:2]).max() < 0.05
    zmp = np.array([-moment[1], moment[0]]) / force[2]
    assert np.abs(zmp - com[:2]).max() < 3e-4
    ankle = np.mean(ankles, axis=0)
    assert ankle[5] == pytest.approx(force[2], rel=2e-3)
    assert np.abs(np.array([-ankle[1], ankle[0]]) / ankle[5] - zmp).max() < 2e-4
    assert {c.link for c in seen.contacts} == {"right_foot_link", "left_foot_link"}


def test_on_both_feet_it_does_not_creep(robot: Robot, opened: Open) -> None:
    home = sk.home(robot)
    backend = opened(robot)
    backend.reset(home)
    seen = stand(backend, home, 1000)
    turned = np.rad2deg(np.arctan2(seen.T_world_base[1, 0], seen.T_world_base[0, 0]))
    assert abs(turned) < 0.01
    assert np.abs(seen.T_world_base[:2, 3] - home.T_world_base[:2, 3]).max() < 1e-4


def test_motors_stay_within_their_effort(robot: Robot, opened: Open) -> None:
    weak = replace(robot, joints=tuple(replace(joint, effort=0.2) for joint in robot.joints))
    backend = opened(weak)
    home = sk.home(robot)
    backend.reset(home)
    largest = max(np.abs(stand(backend, home, 1).torque).max() for _ in range(300))
    assert 0.19 < largest <= 0.2 + 1e-9


def test_simulations_side_by_side_do_not_touch_each_other(robot: Robot, opened: Open) -> None:
    home = sk.home(robot)
    tall = sk.State(home.T_world_base + np.diag([0, 0, 0, 0.0]), home.q)
    tall.T_world_base[2, 3] += 0.02

    def path(seen: list[Observation]) -> np.ndarray:
        return np.array([np.append(o.T_world_base[:3, 3], o.q) for o in seen])

    alone = opened(robot)
    alone.reset(tall)
    single = [stand(alone, home, 1) for _ in range(120)]
    a, b = opened(robot), opened(robot, Physics(friction=0.2, gravity=3.0))
    a.reset(tall)
    b.reset(home)
    both = [(stand(a, home, 1), stand(b, home, 2)) for _ in range(120)]
    assert np.array_equal(path([first for first, _ in both]), path(single))


def test_every_call_of_pybullet_names_its_client() -> None:
    """All calls on the module go through ``self._p`` or ``p``; each needs ``**here`` or ``**self._here``."""
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    pure = {"connect", "getMatrixFromQuaternion"}
    checked = 0
    for call in [node for node in ast.walk(tree) if isinstance(node, ast.Call)]:
        if isinstance(call.func, ast.Attribute) and ast.unparse(call.func.value) in ("p", "self._p"):
            starred = [ast.unparse(k.value) for k in call.keywords if k.arg is None]
            if call.func.attr not in pure:
                assert {"here", "self._here"} & set(starred), ast.unparse(call)
                checked += 1
    assert checked > 15


def test_closing_twice_is_harmless(robot: Robot) -> None:
    backend = PyBulletBackend(robot)
    backend.close()
    backend.close()


def test_without_pybullet_the_message_says_what_to_install(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(MissingDependencyError, match="python -m pip install pybullet") as caught:
        PyBulletBackend(robot)
    assert caught.value.exit_code == 2


def test_a_window_without_a_display_is_refused(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(InputError, match="DISPLAY is not set"):
        PyBulletBackend(robot, gui=True)


def test_a_leg_with_nothing_to_stand_on_is_refused(robot: Robot) -> None:
    links = tuple(replace(link, boxes=()) if link.name == "left_foot_link" else link for link in robot.links)
    with pytest.raises(InputError, match="link left_foot_link of limb left_leg has no box"):
        PyBulletBackend(replace(robot, links=links))
