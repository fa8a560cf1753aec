"""Compensated commands, held against the equilibrium of springs and weight computed beside them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.consistency import motion_faults
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import InputError, LimitError, NoSolutionError, UnknownNameError
from screwkin.gait.compensation import compensate_walk, convergence
from screwkin.gait.loads import load_distribution
from screwkin.trajectory import load_trajectory

K = 60.0


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("poppy12")


@pytest.fixture(scope="module")
def walked(robot: sk.Robot) -> sk.Trajectory:
    return sk.walk(robot, sk.load_gait("paper-poppy12"), steps=2)


def stances(walked: sk.Trajectory) -> list[tuple[str, str, np.ndarray]]:
    """Bearing foot, other foot and samples of the single supports."""
    alone = walked.contact.sum(axis=1) == 1
    a, b = walked.feet
    return [(foot, b if foot == a else a, alone & walked.contact[:, i]) for i, foot in enumerate(walked.feet)]


def at_rest(robot: sk.Robot, q: np.ndarray, foot: str, T_world_foot: np.ndarray) -> sk.State:
    """Where the robot comes to rest with its springs told q and one foot standing in its place."""
    level = sk.State(np.broadcast_to(np.eye(4), (len(q), 4, 4)), q)
    base = T_world_foot @ np.linalg.inv(sk.frame_pose(robot, level, foot))
    found = static_deflection(robot, sk.State(base, q), foot, K)
    found.raise_on_failure()
    return found.state


def missed_mm(robot: sk.Robot, intended: sk.Trajectory, commanded: sk.Trajectory) -> float:
    """Largest distance of the foot in the air from its place."""
    worst = 0.0
    for foot, other, rows in stances(intended):
        rest = at_rest(robot, commanded.q[rows], foot, intended.T_world_tip[foot][rows])
        away = sk.frame_pose(robot, rest, other)[:, :3, 3] - intended.T_world_tip[other][rows, :3, 3]
        worst = max(worst, 1e3 * np.linalg.norm(away, axis=1).max())
    return worst


@pytest.mark.parametrize("method", ["swing", "joint"])
def test_one_pass_removes_nine_tenths_and_five_all_but_a_hundredth_of_a_millimetre(
    robot: sk.Robot, walked: sk.Trajectory, method: Any
) -> None:
    rows = convergence(robot, walked, K, passes=5, method=method)
    assert [row.passes for row in rows] == [0, 1, 2, 3, 4, 5]
    assert rows[0].norm_mm > 3.0
    assert rows[1].removed > 0.9
    assert rows[3].removed > 0.997
    assert rows[5].norm_mm < 0.01
    assert all(b.norm_mm < 0.2 * a.norm_mm for a, b in pairwise(rows))
    for row in (rows[0], rows[1]):
        commanded = compensate_walk(robot, walked, K, method, passes=row.passes) if row.passes else walked
        assert row.norm_mm == pytest.approx(missed_mm(robot, walked, commanded), rel=1e-6)


def test_the_linear_model_too_removes_nine_tenths_but_then_stays_at_its_own_error(
    robot: sk.Robot, walked: sk.Trajectory
) -> None:
    rows = convergence(robot, walked, K, passes=3, model="linear")
    assert rows[1].removed > 0.9
    assert 0.05 < rows[3].norm_mm < 1.0


def test_joints_told_to_lead_by_the_torques_of_the_intended_posture_come_to_rest_in_it(
    robot: sk.Robot, walked: sk.Trajectory
) -> None:
    """The torque of a posture does not depend on how it is reached, so one linear pass is exact."""
    commanded = compensate_walk(robot, walked, K, "joint", model="linear")
    for foot, _, rows in stances(walked):
        rest = at_rest(robot, commanded.q[rows], foot, walked.T_world_tip[foot][rows])
        np.testing.assert_allclose(rest.q, walked.q[rows], rtol=0, atol=1e-10)
        np.testing.assert_allclose(rest.T_world_base, walked.T_world_base[rows], rtol=0, atol=1e-9)
    alone = walked.contact.sum(axis=1) == 1
    settled = compensate_walk(robot, walked, K, "joint", passes=6)
    np.testing.assert_allclose(settled.q[alone], commanded.q[alone], rtol=0, atol=1e-8)


def test_swing_moves_only_the_leg_in_the_air_and_keeps_its_sole_level(
    robot: sk.Robot, walked: sk.Trajectory
) -> None:
    commanded = compensate_walk(robot, walked, K, "swing")
    both = walked.contact.all(axis=1)
    assert np.array_equal(commanded.q[both], walked.q[both])
    state = sk.State(walked.T_world_base, commanded.q)
    for foot, other, rows in stances(walked):
        bearing = list(robot.path_to(robot.limb(foot).link))
        np.testing.assert_allclose(commanded.q[rows][:, bearing], walked.q[rows][:, bearing], atol=1e-10)
        told = sk.frame_pose(robot, state, other)[rows]
        wanted = walked.T_world_tip[other][rows]
        np.testing.assert_allclose(told[:, :3, :3], wanted[:, :3, :3], atol=1e-9)
        assert (told[:, 2, 3] > wanted[:, 2, 3]).mean() > 0.5
        assert np.abs(told[:, :3, 3] - wanted[:, :3, 3]).max() > 2e-3


def test_joint_commands_do_not_jump_where_feet_take_over(robot: sk.Robot, walked: sk.Trajectory) -> None:
    joint, swing = (compensate_walk(robot, walked, K, method).q - walked.q for method in ("joint", "swing"))
    jump = [np.abs(np.diff(change, axis=0)).max() / np.abs(change).max() for change in (joint, swing)]
    assert jump[0] < 0.25
    assert jump[1] > 0.5


def test_only_commands_change_and_the_file_tells_how(
    robot: sk.Robot, walked: sk.Trajectory, tmp_path: Path
) -> None:
    path = compensate_walk(robot, walked, {"default": K, "left_knee": 80}, "swing", passes=2).save(
        tmp_path / "c.npz"
    )
    commanded = load_trajectory(path)
    told = commanded.meta["compensation"]
    assert (told["method"], told["model"], told["passes"]) == ("swing", "nonlinear", 2)
    assert told["stiffness"]["left_knee"] == 80
    assert told["stiffness"]["right_knee"] == 60
    assert commanded.meta["gait"] == walked.meta["gait"]
    for name in ("time", "T_world_base", "base_twist", "com", "zmp", "margin", "contact", "qdd"):
        assert np.array_equal(getattr(commanded, name), getattr(walked, name)), name
    assert commanded.sha256 != walked.sha256


def test_rates_belong_to_the_commands(robot: sk.Robot, walked: sk.Trajectory) -> None:
    """Away from jumps the commanded rates are the differences of the commanded positions."""
    commanded = compensate_walk(robot, walked, K, "joint")
    change, rate = commanded.q - walked.q, commanded.qd - walked.qd
    slope = (change[2:] - change[:-2]) / (walked.time[2:] - walked.time[:-2])[:, None]
    assert np.abs(slope - rate[1:-1]).mean() < 0.05 * np.abs(rate).max()


def test_commands_of_motors_add_what_back_emf_and_rotors_take(robot: sk.Robot, walked: sk.Trajectory) -> None:
    spring = compensate_walk(robot, walked, K, model="dynamic")
    motor = compensate_walk(robot, walked, K, model="dynamic", damping={"default": 0.3}, armature=0.005)
    rubbed = compensate_walk(robot, walked, K, model="dynamic", friction=0.03)
    dry = K * (rubbed.q - spring.q)
    quick = np.abs(walked.qd) > 0.2
    np.testing.assert_allclose(dry[quick], 0.03 * np.sign(walked.qd)[quick], rtol=1e-3)
    assert np.abs(dry).max() <= 0.03 + 1e-12
    assert not dry[walked.qd == 0].any()
    assert motion_faults(robot, rubbed) == ()
    taken = 0.3 * walked.qd + 0.005 * walked.qdd
    np.testing.assert_allclose(K * (motor.q - spring.q), taken, rtol=0, atol=1e-12)
    assert set(motor.meta["compensation"]["damping"].values()) == {0.3}
    assert set(spring.meta["compensation"]["armature"].values()) == {0.0}
    assert motion_faults(robot, motor) == motion_faults(robot, spring) == ()
    with pytest.raises(InputError, match=r"damping of left_knee is -1\.0; it must be a number of at least 0"):
        compensate_walk(robot, walked, K, model="dynamic", damping={"default": 0.3, "left_knee": -1.0})
    with pytest.raises(InputError, match="friction are of model 'dynamic', not of 'linear'"):
        compensate_walk(robot, walked, K, model="linear", damping=0.3)


def test_a_servo_model_of_the_table_gives_its_motors_figures_unless_a_stiffness_is_given() -> None:
    """AX-12A: 2 N m/A through 16 ohm brake with 4 / 16 N m s/rad."""
    robot = sk.load_robot("bioloid")
    walked = sk.walk(robot, sk.load_gait("smooth"), steps=1)
    of_table, spring = (
        compensate_walk(robot, walked, k, model="dynamic").meta["compensation"] for k in (None, K)
    )
    assert set(of_table["damping"].values()) == {0.25}
    assert set(of_table["armature"].values()) == {0.005}
    assert set(of_table["friction"].values()) == {0.03}
    assert set(spring["damping"].values()) == {0.0}


def test_a_hundred_times_stiffer_needs_a_hundredth(robot: sk.Robot, walked: sk.Trajectory) -> None:
    soft, stiff = (
        compensate_walk(robot, walked, k, "joint", model="linear").q - walked.q for k in (K, 100 * K)
    )
    np.testing.assert_allclose(soft, 100 * stiff, rtol=0, atol=1e-12)


def test_the_load_goes_from_foot_to_foot_without_a_jump(walked: sk.Trajectory) -> None:
    shares = load_distribution(walked)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    for foot, _, rows in stances(walked):
        assert (shares[rows, walked.feet.index(foot)] == 1.0).all()
    assert shares[0] == pytest.approx([0.5, 0.5], abs=0.1)
    assert shares[-1] == pytest.approx([0.5, 0.5], abs=0.1)
    assert np.abs(np.diff(shares, axis=0)).max() < 0.2


def test_another_robot_with_arms_is_compensated_too() -> None:
    robot = sk.load_robot("bioloid")
    walked = sk.walk(robot, sk.load_gait("walk").replace(rate=25), steps=2)
    for method in ("swing", "joint"):
        rows = convergence(robot, walked, 30.0, passes=2, method=method)
        assert rows[0].norm_mm > 0.5
        assert rows[2].removed > 0.98


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"method": "foot"}, "unknown method of compensation 'foot'; valid: swing, joint"),
        ({"model": "cubic"}, "unknown model of compensation 'cubic'; valid: linear, nonlinear, dynamic"),
        ({"model": "dynamic", "method": "swing"}, "model 'dynamic' is for method 'joint'"),
        ({"passes": 0}, "passes is 0; it must be a whole number of at least 1"),
        ({"passes": 1.5}, "passes is 1.5"),
        ({"stiffness": 0}, "stiffness is 0; it must be a positive number"),
        ({"stiffness": -60.0}, "stiffness is -60.0; it must be a positive number"),
    ],
)
def test_wrong_choices_are_refused(
    robot: sk.Robot, walked: sk.Trajectory, choice: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        compensate_walk(robot, walked, **choice)


def test_the_walks_own_torques_seek_no_static_equilibrium(robot: sk.Robot, walked: sk.Trajectory) -> None:
    with pytest.raises(InputError, match="model 'dynamic' knows no static equilibrium"):
        convergence(robot, walked, K, model="dynamic")  # type: ignore[arg-type]


def test_what_cannot_be_compensated_is_told_with_its_time(robot: sk.Robot, walked: sk.Trajectory) -> None:
    with pytest.raises(NoSolutionError, match=r"t = 0\.000 s: standing on .*too soft"):
        compensate_walk(robot, walked, 0.5)
    knee = robot.joint_names.index("left_knee")
    tight = [
        replace(j, upper=float(walked.q[:, knee].max()) + 1e-4) for j in robot.joints if j.name == "left_knee"
    ]
    narrow = replace(robot, joints=tuple(tight[0] if j.name == "left_knee" else j for j in robot.joints))
    for method in ("swing", "joint"):
        with pytest.raises(LimitError, match="left_knee"):
            compensate_walk(narrow, walked, K, method)


def test_trajectories_that_do_not_fit_are_refused(robot: sk.Robot, walked: sk.Trajectory) -> None:
    with pytest.raises(InputError, match="joints are not those of bioloid"):
        compensate_walk(sk.load_robot("bioloid"), walked, K)
    flying = walked.contact.copy()
    flying[60] = False
    with pytest.raises(InputError, match=r"t = 1\.200 s: no foot is in contact"):
        compensate_walk(robot, replace(walked, contact=flying), K)
    with pytest.raises(UnknownNameError, match="elbow"):
        compensate_walk(robot, walked, {"elbow": 3.0, "default": K})
