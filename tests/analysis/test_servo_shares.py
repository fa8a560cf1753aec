"""How near a plan takes servos to their speed, torque, and the line between these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.account import account_of
from screwkin.analysis.servo_shares import servo_shares
from screwkin.gait.feed_forward import walking_torques
from screwkin.motors.law import motor_torque
from screwkin.motors.library import load_motor

ROBOT = sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk() -> sk.Trajectory:
    return sk.walk(ROBOT, sk.load_gait("walk"), steps=2)


def test_a_share_of_the_line_is_the_share_of_the_supply_that_the_motor_needs(walk: sk.Trajectory) -> None:
    """By the law of the AX-12, which the table's 6 rad/s and 1.5 N m are of: U = tau R / k + k qd."""
    motor = load_motor("AX-12A").motor
    torque = walking_torques(ROBOT, walk)
    share = (torque * motor.resistance / motor.constant + motor.constant * walk.qd) / motor.voltage
    np.testing.assert_allclose(motor_torque(motor, share, walk.qd), torque, atol=1e-12)
    shares = servo_shares(ROBOT, walk)
    for j, name in enumerate(ROBOT.joint_names):
        k = int(np.abs(share[:, j]).argmax())
        assert shares[name].line == pytest.approx(abs(share[k, j]), rel=1e-9)
        assert shares[name].at == walk.time[k]
        assert shares[name].speed == pytest.approx(np.abs(walk.qd[:, j]).max() / 6.0)
        assert shares[name].torque == pytest.approx(np.abs(torque[:, j]).max() / 1.5)


def test_a_servo_that_holds_at_rest_and_one_that_is_turned_by_its_load_need_less(
    walk: sk.Trajectory,
) -> None:
    still = replace(walk, qd=0 * walk.qd, qdd=0 * walk.qdd, base_twist=0 * walk.base_twist)
    knee = servo_shares(ROBOT, replace(still, base_acceleration=0 * walk.base_acceleration))["right_knee"]
    assert knee.speed == 0.0
    assert knee.line == pytest.approx(knee.torque)


def test_a_weaker_servo_is_warned_of_by_torque_and_by_its_line(walk: sk.Trajectory) -> None:
    torque = np.abs(walking_torques(ROBOT, walk)).max(axis=0)
    both = np.abs(walking_torques(ROBOT, walk) / (1.02 * torque) + walk.qd / 6.0).max(axis=0)
    j = int(both.argmax())

    def warnings(effort: float) -> list[str]:
        joints = list(ROBOT.joints)
        joints[j] = replace(joints[j], effort=effort)
        weaker = account_of(replace(ROBOT, joints=tuple(joints)), walk).warnings
        return [warning for warning in weaker if ROBOT.joint_names[j] in warning]

    assert both[j] > 1.0
    assert warnings(1.5) == []
    (line,) = warnings(1.02 * torque[j])
    assert line.startswith("more torque than the servo has at the planned speed: ")
    assert f"{100 * both[j]:.0f} % at" in line
    name = ROBOT.joint_names[j]
    assert warnings(0.9 * torque[j]) == [f"planned joint torque above the servo's: {name} 111 %"]


def test_torques_that_do_not_follow_from_the_motion_are_unknown_not_zero(walk: sk.Trajectory) -> None:
    flying = walk.contact.copy()
    flying[3] = False
    share = servo_shares(ROBOT, replace(walk, contact=flying))["right_knee"]
    assert share.speed > 0
    assert (share.torque, share.line, share.at) == (None, None, None)
