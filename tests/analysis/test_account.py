"""What is told of a trajectory is computed from its joints, and notices when they do not fit the rest."""

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.account import account_of, recorded_robot
from screwkin.errors import InputError, TrajectoryError
from screwkin.report.numbers import balance_data, walk_data, walk_numbers


def test_closure_is_the_distance_of_the_tips_from_where_the_joints_carry_them(robot, trajectory):
    told = {tip: pose.copy() for tip, pose in trajectory.T_world_tip.items()}
    told["left_foot"][7, :3, 3] += [0.0, 3e-4, 4e-4]
    turn = 2e-3
    told["right_foot"][9, :3, :3] = (
        np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        @ told["right_foot"][9, :3, :3]
    )
    closure = account_of(robot, replace(trajectory, T_world_tip=told)).closure
    assert closure["left_foot"] == pytest.approx((5e-4, 0.0), abs=1e-12)
    assert closure["right_foot"] == pytest.approx((0.0, turn), abs=1e-12)


def test_the_largest_closure_counts_what_the_solver_recorded(robot, trajectory):
    account = account_of(robot, replace(trajectory, meta={**trajectory.meta, "closure": 0.5}))
    assert account.max_closure == 0.5
    assert account_of(robot, replace(trajectory, meta={})).max_closure <= 1e-10


def test_a_right_angle_is_seen_as_one(robot, trajectory):
    told = {tip: pose.copy() for tip, pose in trajectory.T_world_tip.items()}
    told["left_foot"][0, :3, :3] = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert account_of(robot, replace(trajectory, T_world_tip=told)).closure["left_foot"][1] == pytest.approx(
        np.pi / 2
    )


def test_singular_values_are_those_of_the_network_matrix(robot, account):
    i = 40
    trajectory = account.trajectory
    limb = next(limb for limb in account.limbs if limb.limb == "left_leg")
    worst = int(account.sigma["left_leg"].argmin())
    assert limb.sample == worst
    assert limb.sigma == pytest.approx(account.sigma["left_leg"][worst])
    # Independent of N: the Jacobian at the foot, velocities over the length of the straight leg.
    state = sk.State(trajectory.T_world_base[i], trajectory.q[i])
    J = sk.jacobian(robot, state, "left_foot")[:, [6 + j for j in robot.path_to("left_foot_link")]]
    J[3:] /= sum(robot.parameters[name] for name in ("thigh", "calf", "ankle_height"))
    assert account.sigma["left_leg"][i] == pytest.approx(np.linalg.svd(J, compute_uv=False)[-1])


def test_a_straight_knee_is_counted_as_singular(robot, trajectory):
    q = trajectory.q.copy()
    straight = [robot.joint_names.index(f"left_{name}") for name in ("hip_pitch", "knee", "ankle_pitch")]
    q[5, straight] = 0.0
    account = account_of(robot, replace(trajectory, q=q))
    assert account.singular_samples == 1
    assert any("left_knee is near straight" in warning for warning in account.warnings)


def test_speeds_are_shares_of_the_servos_limits(robot, trajectory):
    qd = trajectory.qd.copy()
    knee = robot.joint_names.index("right_knee")
    qd[3, knee] = -9.0
    account = account_of(robot, replace(trajectory, qd=qd))
    assert account.servos["right_knee"].speed == pytest.approx(9.0 / 6.0)
    assert "planned joint speed above the servo's: right_knee 9.0 of 6.0 rad/s" in account.warnings


def test_a_changed_zmp_is_noticed(robot, trajectory, account):
    assert account.warnings == ()
    zmp = trajectory.zmp.copy()
    zmp[4, 0] += 0.012
    warnings = account_of(robot, replace(trajectory, zmp=zmp)).warnings
    assert warnings == ("the recorded ZMP differs from the one computed anew by up to 12 mm",)


def test_numbers_and_data_tell_the_same(account):
    data, numbers = walk_data(account), {n.name: n.value for n in walk_numbers(account)}
    for name, key in (("fastest joint", "speed"), ("strongest joint", "torque"), ("nearest to both", "line")):
        most = max(share[key] for share in data["servos"].values())
        assert numbers[name] == f"{100 * most:.0f} %"
    assert numbers["smallest margin of the ZMP"] == f"{data['min_margin_mm']:.1f} mm"
    assert numbers["spikes of |GCoM - ZMP|"] == str(len(data["spikes"]))
    assert data["steps"] == 4


def test_a_tipping_walk_tells_how_often_and_how_far(tipping):
    data = balance_data(tipping)
    margin = tipping.balance.margin
    assert data["outside_fraction"] == pytest.approx((margin < 0).sum() / len(margin))
    assert data["min_margin_mm"] == pytest.approx(1e3 * margin.min())
    assert data["min_margin_mm"] < 0


def test_the_recorded_robot_is_the_robot_that_walked(robot, trajectory):
    again = recorded_robot(trajectory)
    assert again.name == robot.name
    assert again.joint_names == robot.joint_names
    assert again.mass == pytest.approx(robot.mass)


def test_a_table_that_was_changed_is_refused(trajectory):
    told = {**trajectory.meta["robot"], "table": trajectory.meta["robot"]["table"] + "\n"}
    with pytest.raises(TrajectoryError, match="SHA-256"):
        recorded_robot(replace(trajectory, meta={**trajectory.meta, "robot": told}), "t.npz")


def test_a_table_with_faults_is_refused_with_all_of_them(trajectory):
    import hashlib

    text = '[robot]\nname = "x"\nspeed = 1\n'
    told = {"table": text, "sha256": hashlib.sha256(text.encode()).hexdigest()}
    with pytest.raises(TrajectoryError, match="speed"):
        recorded_robot(replace(trajectory, meta={"robot": told}))


def test_foreign_tips_and_a_walk_without_feet_are_refused(robot, trajectory):
    tips = {**trajectory.T_world_tip, "tail": trajectory.T_world_tip["left_foot"]}
    with pytest.raises(TrajectoryError, match="tail"):
        account_of(robot, replace(trajectory, T_world_tip=tips))
    with pytest.raises(TrajectoryError, match="no feet"):
        account_of(robot, replace(trajectory, feet=(), contact=np.zeros((trajectory.samples, 0), dtype=bool)))
    with pytest.raises(InputError, match="joints"):
        account_of(sk.load_robot("bioloid24"), trajectory)


def test_rates_beyond_all_forces_are_refused_instead_of_giving_no_number(robot, trajectory):
    with pytest.raises(TrajectoryError, match="no finite ground wrench in sample 0"):
        account_of(robot, replace(trajectory, qd=np.full_like(trajectory.qd, 1e300)))


def test_a_robot_that_falls_faster_than_gravity_has_no_zmp_and_counts_as_outside(robot, trajectory):
    falling = trajectory.base_acceleration.copy()
    falling[5, 5] = -2 * 9.81
    account = account_of(robot, replace(trajectory, base_acceleration=falling))
    assert account.pulled.tolist() == [i == 5 for i in range(trajectory.samples)]
    assert account.outside[5]
    when = f"leave the floor at {trajectory.time[5]:.2f} s"
    assert any(when in warning for warning in account.warnings)


def test_coarse_samples_are_told(robot):
    coarse = sk.walk(robot, sk.load_gait("walk").replace(rate=2.0), steps=1)
    assert any("samples are 0.5 s apart" in warning for warning in account_of(robot, coarse).warnings)
    assert not any(
        "apart" in warning for warning in account_of(robot, sk.walk(robot, sk.load_gait("walk"), 1)).warnings
    )
