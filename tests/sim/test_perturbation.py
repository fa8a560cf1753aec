"""Worlds other than the planned one: what a perturbation says is what both engines do, by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.analysis.engines import SimulatedCompliance, opened
from screwkin.dynamics.terrain import FLAT
from screwkin.errors import InputError, PerturbationError, UnknownNameError
from screwkin.model.robot import Robot
from screwkin.motors.library import load_motor
from screwkin.sim.backend import Backend, Command, Observation
from screwkin.sim.compliant import Compliance, SpringServos
from screwkin.sim.delay import DelayLine
from screwkin.sim.drawn import NOWHERE, Spread, drawn_world
from screwkin.sim.drive import Actuation, RigidServos
from screwkin.sim.motors import MotorServos
from screwkin.sim.perturbation import DEFAULTS, NONE, Perturbation
from screwkin.sim.perturbation_files import (
    described,
    load_perturbation,
    perturbation_from_data,
    perturbation_from_texts,
)
from screwkin.sim.perturbed import perturbed_ground, perturbed_robot, perturbed_servos

ENGINES = ("pybullet", "mujoco")
BRICK = """
[robot]
name = "brick"
base = "floating"
base_link = "brick"
[[link]]
name = "brick"
mass = 2.0
com = [0.0, 0.0, 0.05]
inertia = { xx = 0.01, yy = 0.01, zz = 0.01 }
boxes = [{ center = [0.0, 0.0, 0.05], size = [0.3, 0.3, 0.1] }]
[[link]]
name = "lid"
mass = 1e-3
com = [0.0, 0.0, 0.1]
inertia = { xx = 1e-5, yy = 1e-5, zz = 1e-5 }
[[joint]]
name = "hinge"
parent = "brick"
child = "lid"
type = "revolute"
s = [0, 0, 1]
s0 = [0.0, 0.0, 0.1]
lower = -1.0
upper = 1.0
velocity = 6.0
effort = 1.0
"""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def brick() -> Robot:
    return sk.robot_from_text(BRICK)


def backend_of(robot: Robot, engine: str, by: Perturbation) -> Backend:
    return opened(robot, engine, SimulatedCompliance(), perturbation=by)  # type: ignore[arg-type]


def fly(backend: Backend, height: float, steps: int, force: np.ndarray | None = None) -> list[Observation]:
    """What is seen as a brick falls from a height, pushed all the while."""
    T = np.eye(4)
    T[2, 3] = height
    backend.reset(sk.State(T, np.zeros(1)))
    seen = []
    for _ in range(steps):
        backend.step(Command(np.zeros(1), np.zeros(1), T, force))
        seen.append(backend.observe())
    backend.close()
    return seen


def heights(seen: list[Observation]) -> np.ndarray:
    return np.array([one.T_world_base[2, 3] for one in seen])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("share", [0.3, 0.6, 0.85])
def test_a_brick_rises_again_as_high_as_its_restitution_says(brick: Robot, engine: str, share: float) -> None:
    """With an inertia that a corner which touches first cannot turn."""
    pytest.importorskip(engine)
    drop = 0.2
    z = heights(fly(backend_of(brick, engine, Perturbation(restitution=share, inertia=1e3)), drop, 500))
    lowest = int(np.argmin(z[:300]))
    assert math.sqrt(z[lowest:].max() / drop) == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_brick_slides_down_a_slope_as_fast_as_friction_lets_it(brick: Robot, engine: str) -> None:
    """Uniformly accelerated by g (sin a - mu cos a): slope and friction are what they are called."""
    pytest.importorskip(engine)
    slope, friction, time = math.radians(20.0), 0.2, 0.6
    by = Perturbation(slope=(slope, 0.0), friction=friction)
    seen = fly(backend_of(brick, engine, by), 0.0, 600)
    way = 0.5 * 9.81 * (math.sin(slope) - friction * math.cos(slope)) * time**2
    assert seen[-1].T_world_base[0, 3] == pytest.approx(-way, rel=0.03)
    assert abs(seen[-1].T_world_base[2, 3]) < 1e-3
    held = fly(backend_of(brick, engine, Perturbation(slope=(0.0, slope), friction=0.5)), 0.0, 300)
    assert abs(held[-1].T_world_base[1, 3]) < 1e-3


@pytest.mark.parametrize("engine", ENGINES)
def test_ground_beyond_a_rise_lies_higher_and_beyond_a_drop_lower(brick: Robot, engine: str) -> None:
    pytest.importorskip(engine)
    for rise, at, expected in ((0.02, -0.3, 0.02), (0.02, 0.3, 0.0), (-0.02, -0.3, -0.02), (-0.02, 0.3, 0.0)):
        z = heights(fly(backend_of(brick, engine, Perturbation(rise=rise, rise_at=at)), 0.021, 400))
        assert z[-1] == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_push_changes_the_momentum_by_its_impulse(brick: Robot, engine: str) -> None:
    """A body in free fall: dv = J / m, whatever the payload makes of the mass; nothing after the push."""
    pytest.importorskip(engine)
    by = Perturbation(push=(0.3, -0.2, 0.1), push_at=0.05, push_duration=0.02, payload=1.0)
    backend = backend_of(brick, engine, Perturbation(payload=1.0, payload_at=(0.0, 0.0, 0.05)))
    T = np.eye(4)
    T[2, 3] = 5.0
    backend.reset(sk.State(T, np.zeros(1)))
    places = []
    for k in range(120):
        backend.step(Command(np.zeros(1), np.zeros(1), T, by.force(1e-3 * k, 1e-3)))
        places.append(backend.observe().T_world_base[:3, 3])
    backend.close()
    speed = (places[-1] - places[-11]) / 0.01
    fallen = 9.81 * 0.1155
    np.testing.assert_allclose(speed + np.array([0.0, 0.0, fallen]), np.array(by.push) / 3.001, atol=1e-4)


def test_a_payload_adds_the_inertia_of_a_point_about_any_place() -> None:
    rng = np.random.default_rng(2)
    brick = sk.robot_from_text(BRICK)
    for _ in range(20):
        m, p, shift = rng.uniform(0.1, 3.0), rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.02, 0.02, 3)
        by = Perturbation(payload=m, payload_at=tuple(p.tolist()), com=tuple(shift.tolist()), mass=1.3)
        link, _ = perturbed_robot(brick, by).links
        bare, _ = perturbed_robot(brick, Perturbation(mass=1.3, com=by.com)).links
        assert float(bare.com.z) == pytest.approx(0.05 + shift[2])
        assert float(link.mass) == pytest.approx(2.6 + m)

        def about_origin(link: object) -> np.ndarray:
            i, c = link.inertia, np.array([link.com.x, link.com.y, link.com.z], dtype=float)  # type: ignore[attr-defined]
            own = np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], dtype=float)
            return np.asarray(own + link.mass * (c @ c * np.eye(3) - np.outer(c, c)))  # type: ignore[attr-defined]

        point = m * (p @ p * np.eye(3) - np.outer(p, p))
        np.testing.assert_allclose(about_origin(link), about_origin(bare) + point, atol=1e-12)


def test_masses_by_link_change_those_links_alone(robot: Robot) -> None:
    by = Perturbation(mass={"torso": 1.2}, inertia=2.0)
    heavier = perturbed_robot(robot, by)
    for before, after in zip(robot.links, heavier.links, strict=True):
        factor = 1.2 if before.name == "torso" else 1.0
        assert after.mass == pytest.approx(before.mass * factor)
        assert after.inertia.xx == pytest.approx(before.inertia.xx * factor * 2.0)
    with pytest.raises(UnknownNameError, match="link"):
        perturbed_robot(robot, Perturbation(mass={"torzo": 1.2}))
    with pytest.raises(UnknownNameError, match="joint"):
        perturbed_servos(RigidServos(robot), robot, Perturbation(lag={"kneee": 0.1}), 1e-3)


def test_nothing_is_the_planned_world_itself(robot: Robot) -> None:
    servos = RigidServos(robot)
    assert NONE.nothing
    assert NONE.to_dict() == {}
    assert Perturbation(mass={}) != NONE
    assert perturbed_robot(robot, NONE) is robot
    assert perturbed_ground(FLAT, NONE) is FLAT
    assert perturbed_servos(servos, robot, NONE, 1e-3) is servos
    np.testing.assert_array_equal(NONE.gravity(9.81), [0.0, 0.0, -9.81])
    assert NONE.force(0.0, 1e-3) is None


@dataclass
class Recording:
    """Servos that write down what reaches them and use a torque of 5 and a motor bound of 3."""

    joints: int
    name: str = "recording"
    relative_rotors: bool = False
    goals: list[np.ndarray] = field(default_factory=list)
    errors: list[np.ndarray] = field(default_factory=list)

    @property
    def rotor_inertia(self) -> np.ndarray:
        return np.zeros(self.joints)

    def reset(self, q: np.ndarray) -> None:
        self.goals.clear()

    def actuate(
        self, q: np.ndarray, qd: np.ndarray, motor: np.ndarray, command: Command, dt: float
    ) -> Actuation:
        self.goals.append(np.array(command.q))
        self.errors.append(np.array(command.q) - q)
        return Actuation(np.full(self.joints, 5.0), np.asarray(command.qd), np.full(self.joints, 3.0))


def drive(robot: Robot, by: Perturbation, steps: int, dt: float = 1e-3) -> tuple[Recording, list[Actuation]]:
    """Servos commanded 0, 1, 2, … in every joint, and rate 1000."""
    recording, n = Recording(len(robot.joints)), len(robot.joints)
    servos = perturbed_servos(recording, robot, by, dt)
    still = np.zeros(n)
    return recording, [
        servos.actuate(still, still, still, Command(np.full(n, float(k)), np.full(n, 1e3), None), dt)
        for k in range(steps)
    ]


@settings(max_examples=10)
@given(lags=st.lists(st.floats(0.0, 0.03), min_size=18, max_size=18))
def test_every_joint_reads_the_command_of_its_own_lag_ago(lags: list[float]) -> None:
    robot = sk.load_robot("bioloid")
    by = Perturbation(lag=dict(zip(robot.joint_names, lags, strict=True)), dropped=1e-12)
    recording, _ = drive(robot, by, 50)
    for k, goal in enumerate(recording.goals):
        np.testing.assert_allclose(goal, np.maximum(0.0, k - np.array(lags) / 1e-3), atol=1e-9)


def test_a_delay_line_carries_rows_of_any_rank() -> None:
    line = DelayLine(np.array([0.0, 1.5, 3.0]), 1.0)
    out = [line.through(np.array([[k, k, k], [10.0 * k] * 3])) for k in range(6)]
    np.testing.assert_allclose(out[-1], [[5, 3.5, 2], [50, 35, 20]])
    line.reset()
    np.testing.assert_allclose(line.through(np.array([7.0, 7.0, 7.0])), 7.0)


def test_dropped_frames_leave_the_servos_at_the_frame_before(robot: Robot) -> None:
    recording, actions = drive(robot, Perturbation(dropped=0.3, seed=4), 5_000)
    goals = np.array(recording.goals)[:, 0]
    frames = goals.reshape(-1, 10)
    lost = frames[1:, 0] == frames[:-1, -1]
    assert (frames[1:][lost] == frames[:-1, -1:][lost]).all()  # the last command stands through the frame
    assert (frames[1:][~lost] == np.arange(10, 5_000).reshape(-1, 10)[~lost]).all()
    assert lost.mean() == pytest.approx(0.3, abs=4 * math.sqrt(0.3 * 0.7 / 500))
    rates = np.array([action.rate[0] for action in actions]).reshape(-1, 10)
    assert (rates[1:][lost] == 0.0).all()
    assert (rates[1:][~lost] == 1e3).all()
    again, _ = drive(robot, Perturbation(dropped=0.3, seed=4), 500)
    assert (np.array(again.goals)[:, 0] == goals[:500]).all()


def test_play_and_weakness_are_of_the_error_beyond_the_play(robot: Robot) -> None:
    recording, _ = drive(robot, Perturbation(backlash=0.4, stiffness={"right_knee": 0.5}), 4)
    knee = robot.joint_names.index("right_knee")
    for k, error in enumerate(recording.errors):
        free = max(0.0, k - 0.2)
        expected = np.full(18, free)
        expected[knee] = 0.5 * free
        np.testing.assert_allclose(error, expected, atol=1e-12)


def test_springs_of_half_the_stiffness_deflect_twice_as_far(robot: Robot) -> None:
    springs = SpringServos(robot, Compliance(50.0, 0.0), 5e-4)
    weak = perturbed_servos(springs, robot, Perturbation(stiffness=0.5), 5e-4)
    still = np.zeros(18)
    torque = weak.actuate(still, still, still, Command(np.full(18, 0.01), still, None), 5e-4).torque
    np.testing.assert_allclose(torque, 0.25)


def test_torque_is_bounded_by_its_factor_and_fades_with_time(robot: Robot) -> None:
    effort = np.array([joint.effort for joint in robot.joints])
    _, actions = drive(robot, Perturbation(torque=0.5, fade=2.0), 1000)
    for k in (0, 100, 400, 499, 600, 999):
        left = 0.5 * effort * max(0.0, 1.0 - 2.0 * 1e-3 * k)
        np.testing.assert_allclose(actions[k].torque, np.minimum(5.0, left), atol=1e-12)
        np.testing.assert_allclose(actions[k].bound, np.minimum(3.0, left), atol=1e-12)


def test_the_lag_of_a_motor_and_that_of_the_world_add_up(robot: Robot) -> None:
    """So that play and weakness are of the error that the motor sees."""
    motor = replace(load_motor("AX-12").motor, lag=0.004)
    servos = MotorServos([motor] * 18, 1e-3, "ax")
    both = perturbed_servos(servos, robot, Perturbation(lag=0.01, stiffness=0.5), 1e-3)
    alone = MotorServos([motor] * 18, 1e-3, "ax").at_once()
    still, late = np.zeros(18), 10 + round(float(motor.lag) / 1e-3)
    torques = []
    for k in range(60):
        command = Command(np.full(18, 0.2 * (k > 0)), still, None)
        torques.append(both.actuate(still, still, still, command, 1e-3).torque[0])
    assert torques[late] == 0.0
    assert torques[late + 1] != 0.0
    half = alone.actuate(still, still, still, Command(np.full(18, 0.1), still, None), 1e-3)
    assert torques[-1] == pytest.approx(half.torque[0])


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), scale=st.floats(0.0, 3.0))
def test_a_world_is_within_its_spread_and_survives_its_files(seed: int, scale: float) -> None:
    robot = sk.load_robot("bioloid")
    full = Spread(
        inertia=0.2, payload=0.1, restitution=0.3, rise=0.003, each_lag=True, backlash=0.01, fade=0.01,
        dropped=0.05, imu_noise=0.01, imu_rate_noise=0.1, imu_bias=0.02, imu_rate_bias=0.02, sense_lag=0.01,
    )  # fmt: skip
    spread = full.scaled(scale)
    world = drawn_world(robot, seed, spread, 4.0, 0.5)
    assert world == drawn_world(robot, seed, spread, 4.0, 0.5)
    assert math.hypot(*world.slope) <= spread.slope + 1e-12
    assert 0.0 <= world.push_at <= 4.0
    low, high = spread.push
    assert low - 1e-12 <= math.hypot(*world.push) <= high + 1e-12
    assert 0.4 <= (world.friction or 0.0) <= 1.0
    assert abs(world.rise) <= spread.rise
    factors = world.mass.values() if isinstance(world.mass, dict) else [world.mass]
    lags = world.lag.values() if isinstance(world.lag, dict) else [world.lag]
    assert all(abs(factor - 1.0) <= spread.mass + 1e-12 for factor in factors)
    assert all(0.0 <= lag <= spread.lag for lag in lags)
    assert perturbation_from_data(world.to_dict()) == world
    assert perturbation_from_texts(list(described(world))) == world


def test_what_may_differ_does_not_change_how_the_rest_is_drawn(robot: Robot) -> None:
    both = drawn_world(robot, 5, Spread(), 4.0)
    for key in ("friction", "mass", "stiffness", "lag"):
        alone = drawn_world(robot, 5, Spread().only(key), 4.0)
        assert getattr(alone, key) == getattr(both, key)
        assert set(alone.to_dict()) == {key, "seed"}
    assert drawn_world(robot, 0, NOWHERE, 4.0) == NONE
    with pytest.raises(InputError, match="valid: mass"):
        Spread().only("masses")


def test_files_and_texts_say_the_same(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "world.toml"
    path.write_text('[perturbation]\nslope = ["3*deg", 0]\nmass = { torso = 1.1 }\nrise = "5*mm"\n')
    loaded = load_perturbation(path)
    assert loaded == perturbation_from_texts(["slope=3*deg,0", "mass.torso=1.1", "rise=5*mm"])
    assert loaded.slope == (math.radians(3.0), 0.0)
    assert loaded.rise == 0.005


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["slope"], "no assignment"),
        (["rise=1", "rise=2"], "given twice"),
        (["rise.left=1"], "rise"),
        (["rises=1"], "Did you mean 'rise'"),
        (["mass=-1"], "from 0.001"),
        (["mass.torso=nan"], "nan"),
        (["push=1,2"], "3 numbers"),
        (["friction=abc"], "abc"),
        (["seed=1.5"], "whole"),
        (["lag=2"], "from 0 to 1"),
        (["mass=1.1", "mass.torso=1.2"], "given twice"),
        (["mass.torso=1.2", "mass=1.1"], "given twice"),
    ],
)
def test_a_wrong_value_is_one_clear_error(texts: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        perturbation_from_texts(texts)


def test_a_wrong_file_names_all_its_faults(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "world.toml"
    path.write_text("[perturbation]\nmass = 0\nrise = true\nslop = 1\n[robot]\n")
    with pytest.raises(PerturbationError, match=r"\[robot\]"):
        load_perturbation(path)
    path.write_text("[perturbation]\nmass = 0\nrise = true\nslop = 1\n")
    with pytest.raises(PerturbationError) as caught:
        load_perturbation(path)
    assert {fault.key for fault in caught.value.faults} == {"mass", "rise", "slop"}
    with pytest.raises(InputError, match="mass"):
        Perturbation(mass=0.0)
    assert set(DEFAULTS) == {f.name for f in fields(Perturbation)}


def test_the_kinematic_engine_refuses_a_perturbed_world(robot: Robot) -> None:
    with pytest.raises(InputError, match="kinematic"):
        opened(robot, "kinematic", SimulatedCompliance(), perturbation=Perturbation(friction=0.5))
