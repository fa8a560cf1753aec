"""The torques of a walk, held against its energy, its statics, and the feet's centres of pressure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compliance.stiffness import static_deflection
from screwkin.gait.compensation import compensate_walk
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.loads import load_distribution


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("poppy12")


@pytest.fixture(scope="module")
def walked(robot: sk.Robot) -> sk.Trajectory:
    return sk.walk(robot, sk.load_gait("paper-poppy12"), steps=2)


def test_the_joints_work_is_the_change_of_energy(robot: sk.Robot, walked: sk.Trajectory) -> None:
    """Feet that bear do not move, so the ground does no work, however the feet share the load."""
    state = sk.State(walked.T_world_base, walked.q)
    rates = np.concatenate([walked.base_twist, walked.qd], axis=1)
    kinetic = 0.5 * np.einsum("ti,tij,tj->t", rates, sk.mass_matrix(robot, state), rates)
    energy = kinetic + robot.mass * 9.81 * walked.com[:, 2]
    power = (walking_torques(robot, walked) * walked.qd).sum(axis=1)
    work = 0.02 * np.cumsum(0.5 * (power[1:] + power[:-1]))
    assert np.ptp(energy) > 0.02
    assert np.abs(work - (energy[1:] - energy[0])).max() < 0.03 * np.ptp(energy)


def test_at_rest_on_one_foot_it_is_what_statics_says(robot: sk.Robot, walked: sk.Trajectory) -> None:
    none = {
        name: np.zeros_like(getattr(walked, name))
        for name in ("qd", "qdd", "base_twist", "base_acceleration")
    }
    torque = walking_torques(robot, replace(walked, **none))
    alone = walked.contact.sum(axis=1) == 1
    for i, foot in enumerate(walked.feet):
        rows = alone & walked.contact[:, i]
        state = sk.State(walked.T_world_base[rows], walked.q[rows])
        expected = static_deflection(robot, state, foot, 60.0, "linear").torque
        np.testing.assert_allclose(torque[rows], expected, rtol=0, atol=1e-12)


def test_standing_on_both_feet_neither_ankle_works_against_the_other(
    robot: sk.Robot, walked: sk.Trajectory
) -> None:
    """Both soles are loaded in their middle, so the ankles' roll joints bear next to nothing."""
    torque = walking_torques(robot, walked)
    rolls = [robot.joint_names.index(f"{side}_ankle_roll") for side in ("left", "right")]
    standing = walked.time < 0.5
    assert np.abs(load_distribution(walked)[standing] - 0.5).max() < 0.05
    assert np.abs(torque[standing][:, rolls]).max() < 0.01 * robot.mass * 9.81 * 0.048
    assert np.abs(np.diff(torque, axis=0)).max() < 0.35 * np.abs(torque).max()


def test_commands_lead_by_the_torque_over_the_stiffness(robot: sk.Robot, walked: sk.Trajectory) -> None:
    told = compensate_walk(robot, walked, 80.0, "joint", model="dynamic")
    np.testing.assert_allclose(80.0 * (told.q - walked.q), walking_torques(robot, walked), atol=1e-12)
    assert told.meta["compensation"]["model"] == "dynamic"
