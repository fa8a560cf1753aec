"""A run settles, plays, holds, and stops soon after a fall."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import Vector
from screwkin.model.robot import Robot
from screwkin.sim.backend import Command, Contact, Observation
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.perturbation import Perturbation
from screwkin.sim.run import Schedule, simulate
from screwkin.trajectory import Trajectory


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk(robot: Robot) -> Trajectory:
    return sk.walk(robot, sk.load_gait("walk"), steps=1)


@dataclass
class Scripted:
    """Tells a prepared pose of the base at every step, and the same two contacts."""

    poses: list[np.ndarray]
    joints: int
    name: str = "scripted"
    servo: str = "rigid"
    settings: dict[str, object] = field(default_factory=dict)
    dt: float = 0.01
    commands: list[Command] = field(default_factory=list)
    start: sk.State | None = None

    def reset(self, state: sk.State) -> Observation:
        self.commands.clear()
        self.start = state
        return self.observe()

    def step(self, command: Command) -> None:
        self.commands.append(command)

    def observe(self) -> Observation:
        k = min(len(self.commands), len(self.poses) - 1)
        zeros = np.zeros(self.joints)
        contacts = (
            Contact("right_foot_link", (0.1, 0.0, 0.0), (0.0, 0.0, 4.0)),
            Contact("torso", (0.0, 0.2, 0.0), (1.0, 0.0, 6.0)),
        )
        feet, wrench = np.tile(np.eye(4), (2, 1, 1)), np.zeros((2, 6))
        return Observation(k * self.dt, self.poses[k], zeros, zeros, zeros, feet, wrench, contacts)

    def close(self) -> None:
        pass


def tilted(angle: float, height: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    T[2, 3] = height
    return T


def test_a_perfect_robot_is_exact_at_the_end_of_every_step(robot: Robot, walk: Trajectory) -> None:
    run = simulate(robot, walk, KinematicBackend(robot, dt=0.01))
    assert run.time[0] == pytest.approx(-0.49)
    assert run.time[-1] == pytest.approx(walk.duration + 0.5)
    at = np.rint(walk.time / 0.01).astype(int) + 49
    assert np.allclose(run.q[at], walk.q, rtol=0, atol=1e-12)
    assert np.allclose(run.T_world_base[at], walk.T_world_base, rtol=0, atol=1e-12)
    for i, foot in enumerate(("right_foot", "left_foot")):
        assert np.allclose(run.T_world_foot[at, i], walk.T_world_tip[foot], rtol=0, atol=1e-9)
    assert np.allclose(run.q[-30:], walk.q[-1], rtol=0, atol=1e-15)
    assert run.fallen_at is None


def test_commands_are_told_before_the_step_that_they_lead(robot: Robot, walk: Trajectory) -> None:
    """Position at the step's start plus mean rate times its length is the position at its end."""
    backend = Scripted([tilted(0, 0.15)], len(robot.joints))
    run = simulate(robot, walk, backend, Schedule(settle=0.1, hold=0.0))
    ends = np.array([command.q + backend.dt * command.qd for command in backend.commands])
    assert np.allclose(ends, run.q_planned, rtol=0, atol=1e-14)
    assert np.array_equal(backend.commands[0].q, walk.q[0])


@pytest.mark.parametrize(("angle", "height"), [(np.deg2rad(31.0), 0.15), (0.0, 0.6 * 0.15 - 1e-6)])
def test_a_fall_by_tilt_or_height_is_seen_and_watched_to_its_end(
    robot: Robot, walk: Trajectory, angle: float, height: float
) -> None:
    poses = [tilted(np.deg2rad(29.0), 0.6 * 0.15 + 1e-6)] * 70 + [tilted(angle, height)]
    run = simulate(robot, walk, Scripted(poses, len(robot.joints)), Schedule(settle=0.5, aftermath=0.2))
    assert run.fallen_at == pytest.approx(0.2)
    assert run.time[-1] == pytest.approx(0.4)
    assert len(run.time) == len(run.q) == len(run.ground_wrench) == 90


def test_a_run_starts_in_the_first_commands_or_in_the_posture_it_is_given(
    robot: Robot, walk: Trajectory
) -> None:
    scripted, posture = Scripted([tilted(0, 0.15)], len(robot.joints)), walk.q[0] + 0.01
    for given, expected in ((None, walk.q[0]), (posture, posture)):
        simulate(robot, walk, scripted, start=given)
        assert scripted.start is not None
        assert np.allclose(scripted.start.q, expected, rtol=0, atol=1e-12)
        assert np.allclose(scripted.commands[0].q, walk.q[0], rtol=0, atol=1e-12)


def test_contacts_are_summed_by_foot_and_others_are_named(robot: Robot, walk: Trajectory) -> None:
    run = simulate(robot, walk, Scripted([tilted(0, 0.15)], len(robot.joints)))
    assert np.array_equal(run.foot_force[5], [[0, 0, 4], [0, 0, 0]])
    moment = np.cross([0.1, 0, 0], [0, 0, 4]) + np.cross([0, 0.2, 0], [1, 0, 6])
    assert np.allclose(run.ground_wrench[5], [*moment, 1, 0, 10], rtol=0, atol=1e-15)
    assert run.touched == ("torso",)
    assert run.tilt.max() == 0.0


def test_progress_grows_to_the_end(robot: Robot, walk: Trajectory) -> None:
    told: list[float] = []
    simulate(robot, walk, KinematicBackend(robot, dt=0.01), progress=told.append)
    assert told == sorted(told)
    assert 0.6 < told[-1] <= 1.0


def test_a_push_reaches_the_backend_in_the_steps_of_its_time(robot: Robot, walk: Trajectory) -> None:
    """The impulse is that of the perturbation, where it ends within a step too."""
    backend = Scripted([tilted(0, 0.15)], len(robot.joints))
    by = Perturbation(push=(0.2, 0.0, -0.1), push_at=0.3, push_duration=0.045)
    run = simulate(robot, walk, backend, perturbation=by)
    pushed = [k for k, command in enumerate(backend.commands) if command.force is not None]
    assert pushed == np.flatnonzero((run.time > 0.3001) & (run.time < 0.3501)).tolist()
    impulse = sum((backend.commands[k].force for k in pushed), np.zeros(3)) * backend.dt
    np.testing.assert_allclose(impulse, by.push)


def test_a_base_whose_origin_lies_below_the_soles_has_not_fallen(robot: Robot, walk: Trajectory) -> None:
    """It may lie anywhere: a hundred millimetres below the floor it is no sign of a fall."""
    up = Vector(0.0, 0.0, 0.4)
    links = (replace(link, com=link.com + up) for link in robot.links)
    robot, low = replace(robot, links=tuple(links)), walk.T_world_base[0].copy()
    low[2, 3] = -0.1
    lying = replace(walk, T_world_base=walk.T_world_base + (low - walk.T_world_base[0]))
    sunk = low.copy()
    sunk[2, 3] -= 0.2
    for pose, falls in ((low, False), (sunk, True)):
        backend = Scripted([pose], len(robot.joints))
        assert (simulate(robot, lying, backend).fallen_at is not None) == falls
