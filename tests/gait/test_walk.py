"""Walks: trajectories that fit their plan, and robots and gaits that do not fit each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.dynamics.on_floor import ground_margin
from screwkin.errors import InputError, LimitError, NoSolutionError


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walked(robot: sk.Robot) -> sk.Trajectory:
    return sk.walk(robot, sk.load_gait("walk").replace(rate=2000), steps=2)


def test_feet_are_where_they_were_planned_and_standing_soles_do_not_move(
    robot: sk.Robot, walked: sk.Trajectory
) -> None:
    state = sk.State(walked.T_world_base, walked.q)
    for i, foot in enumerate(walked.feet):
        pose = sk.frame_pose(robot, state, foot)
        assert np.abs(pose - walked.T_world_tip[foot]).max() < 1e-10
        stands = walked.contact[1:, i] & walked.contact[:-1, i]
        assert np.abs(np.diff(pose[:, :3, 3], axis=0)[stands]).max() < 1e-9


def test_rates_and_accelerations_are_the_slopes_of_positions_away_from_knots(walked: sk.Trajectory) -> None:
    h = walked.time[1] - walked.time[0]
    slope = (walked.q[2:] - walked.q[:-2]) / (2 * h)
    bend = (walked.q[2:] - 2 * walked.q[1:-1] + walked.q[:-2]) / h**2
    assert np.quantile(np.abs(slope - walked.qd[1:-1]), 0.95) < 1e-4
    assert np.quantile(np.abs(bend - walked.qdd[1:-1]), 0.95) < 5e-3


def test_joints_rest_at_the_start_and_at_the_end(walked: sk.Trajectory) -> None:
    for end in (0, -1):
        assert np.abs(walked.qd[end]).max() < 1e-9
        assert np.abs(walked.qdd[end]).max() < 1e-6


def test_the_recorded_zmp_is_computed_anew_from_positions_rates_and_accelerations(
    robot: sk.Robot, walked: sk.Trajectory
) -> None:
    balance = sk.zmp(robot, walked)
    np.testing.assert_allclose(balance.zmp, walked.zmp, atol=1e-12)
    np.testing.assert_allclose(balance.margin, walked.margin, atol=1e-12)


def test_the_arms_of_a_robot_with_wrists_stay_level_with_the_waist() -> None:
    robot = sk.load_robot("bioloid24")
    walked = sk.walk(robot, sk.load_gait("walk"), steps=2)
    turned = walked.T_world_tip["right_hand"][:, :3, :3]
    level = sk.frame_pose(robot, sk.home(robot), "right_hand")[:3, :3]
    np.testing.assert_allclose(turned, np.broadcast_to(level, turned.shape), atol=1e-10)


def test_where_the_ground_would_have_to_pull_the_margin_is_negative() -> None:
    square = np.array([[[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]]]).repeat(2, axis=0)
    wrench = np.array([[0, 0, 0, 0, 0, 5.0], [0, 0, 0, 0, 0, -5.0]])
    com = np.array([[0, 0, 0.3], [0, 0, 0.3]])
    margin = ground_margin(np.zeros((2, 2)), com, wrench, square, np.ones((2, 1), dtype=bool))
    assert margin.tolist() == [1.0, -0.3]


def test_a_step_out_of_reach_names_limb_and_time(robot: sk.Robot) -> None:
    with pytest.raises(NoSolutionError, match=r"(right|left)_leg, sample \d+ \(t = .* s\): out of reach by"):
        sk.walk(robot, sk.load_gait("walk").replace(waist_height=0.2), steps=2)


def test_limits_are_those_of_the_table(robot: sk.Robot) -> None:
    knee = float(sk.home(robot).q[robot.joint_names.index("left_knee")])
    tight = tuple(
        replace(j, lower=0.0, upper=knee + 1e-3) if j.name == "left_knee" else j for j in robot.joints
    )
    with pytest.raises(LimitError, match="left_knee at"):
        sk.walk(replace(robot, joints=tight), sk.load_gait("walk"), steps=2)


def test_names_instead_of_values_and_robots_that_cannot_walk_are_refused(robot: sk.Robot) -> None:
    gait = sk.load_gait("walk")
    with pytest.raises(InputError, match="load_robot"):
        sk.walk("bioloid", gait)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="fixed base"):
        sk.walk(replace(robot, base="fixed"), gait)
    with pytest.raises(InputError, match="fixed base"):
        sk.walk(sk.load_robot("linkages/four-bar"), gait)
    with pytest.raises(InputError, match="no posture 'home'"):
        sk.walk(replace(robot, postures=()), gait)


def test_a_trajectory_of_another_robot_tells_lacking_and_foreign_joints(
    robot: sk.Robot, walked: sk.Trajectory
) -> None:
    with pytest.raises(InputError, match=r"is without left_hip_roll.* foreign x0"):
        sk.zmp(sk.load_robot("poppy12"), replace(walked, joint_names=tuple(f"x{i}" for i in range(18))))


def test_a_limb_on_another_branch_within_its_limits_is_refused_without_naming_a_joint(monkeypatch) -> None:
    import screwkin.gait.reach

    def all_others(robot, targets, solution, limb, free):
        return np.ones(len(solution.state.q), dtype=bool)

    monkeypatch.setattr(screwkin.gait.reach, "on_other_branch", all_others)
    robot = sk.load_robot("bioloid")
    with pytest.raises(LimitError, match=r"sample 0 \(t = 0.000 s\): it is bent the other way") as refused:
        sk.walk(robot, sk.load_gait("walk"), 1)
    assert not any(name in str(refused.value) for name in robot.joint_names)
