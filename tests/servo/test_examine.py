"""What servos' registers hold is compared with the table, register by register, over the virtual bus."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from screwkin.errors import SafetyError
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus
from screwkin.servo.examine import differences
from screwkin.servo.gate import Bounds
from screwkin.servo.line import RefusedError
from screwkin.servo.player import Player
from screwkin.servo.profiles import profile_models
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.robot import virtual_servos

KNEE = 13
PROTOCOL_1 = [
    ({"angle_limit_low": 0, "angle_limit_high": 0}, "angle_limit_high", "0 (wheel mode)"),
    ({"angle_limit_low": 400, "angle_limit_high": 620}, "angle_limit_low", "400 (joint mode)"),
    ({"max_torque": 500}, "max_torque", "500"),
    ({"shutdown": 4}, "shutdown", "4"),
    ({"alarm_led": 4}, "alarm_led", "4"),
    ({"return_delay": 254}, "return_delay", "254"),
    ({"status_level": 1}, "status_level", "1"),
    ({"status_level": 0}, "status_level", "0"),
]
MX_1 = [
    ({"angle_limit_low": 4095, "angle_limit_high": 4095}, "angle_limit_low", "4095 (multi-turn mode)"),
    ({"multi_turn_offset": -100}, "multi_turn_offset", "-100"),
    ({"resolution_divider": 2}, "resolution_divider", "2"),
    ({"acceleration": 10}, "acceleration", "10"),
]
PROTOCOL_2 = [
    ({"operating_mode": 1}, "operating_mode", "1 (velocity mode)"),
    ({"operating_mode": 4}, "operating_mode", "4 (extended position mode)"),
    ({"operating_mode": 16}, "operating_mode", "16 (pwm mode)"),
    ({"drive_mode": 1}, "drive_mode", "1"),
    ({"homing_offset": -512}, "homing_offset", "-512"),
    ({"angle_limit_low": 1900, "angle_limit_high": 2200}, "angle_limit_low", "1900"),
    ({"max_torque": 400}, "max_torque", "400"),
    ({"velocity_limit": 20}, "velocity_limit", "20"),
    ({"shutdown": 0}, "shutdown", "0"),
    ({"secondary_id": 3}, "secondary_id", "3"),
    ({"return_delay": 254}, "return_delay", "254"),
    ({"status_level": 1}, "status_level", "1"),
    ({"status_level": 0}, "status_level", "0"),
]
STS = [
    ({"operating_mode": 1}, "operating_mode", "1 (velocity mode)"),
    ({"operating_mode": 2}, "operating_mode", "2 (pwm mode)"),
    ({"operating_mode": 3}, "operating_mode", "3 (step mode)"),
    ({"angle_limit_low": 0, "angle_limit_high": 0}, "angle_limit_high", "0 (multi-turn mode)"),
    ({"angle_limit_low": 1900, "angle_limit_high": 2200}, "angle_limit_low", "1900 (joint mode)"),
    ({"drive_mode": 140}, "drive_mode", "140"),
    ({"homing_offset": -512}, "homing_offset", "-512"),
    ({"resolution_divider": 2}, "resolution_divider", "2"),
    ({"acceleration": 10}, "acceleration", "10"),
    ({"max_torque": 400}, "max_torque", "400"),
    ({"current_limit": 100}, "current_limit", "100"),
    ({"shutdown": 0}, "shutdown", "0"),
    ({"alarm_led": 0}, "alarm_led", "0"),
    ({"return_delay": 254}, "return_delay", "254"),
    ({"status_level": 0}, "status_level", "0"),
]
FAULTS = [
    *(("AX-12A", *row) for row in PROTOCOL_1),
    *(("MX-28", *row) for row in (*PROTOCOL_1[2:], *MX_1)),
    *(("MX-28-2", *row) for row in PROTOCOL_2),
    *(("XL430-W250", *row) for row in PROTOCOL_2),
    *(("STS3215", *row) for row in STS),
]


@cache
def robot_of(model: str) -> Robot:
    """The Bioloid with servos of a model."""
    robot = load_robot("bioloid")
    rest = {key: value for key, value in robot.servos.items() if key != "protocol"}
    return replace(robot, servos={**rest, "model": model})


def bus_with(robot: Robot, changed: dict[str, int] | None = None, id: int = KNEE) -> Bus:
    """A bus with the robot's virtual servos, one of them with registers that differ."""
    servos, clock = ServoMap.of(robot), SimulatedClock()
    mounted = virtual_servos(robot, return_delay=500e-6)
    odd = next(servo for servo in mounted if servo.id == id)
    for name, value in (changed or {}).items():
        odd.put(name, value)
    line = VirtualBus(mounted, clock, servos.baud)
    return Bus(line, servos.protocol, servos.baud, clock, port="/dev/ttyUSB0")


@pytest.mark.parametrize("model", profile_models())
def test_servos_as_they_come_from_the_maker_differ_in_nothing(model):
    assert differences(bus_with(robot_of(model)), robot_of(model)) == ()


@pytest.mark.parametrize(("model", "changed", "register", "value"), FAULTS)
def test_a_register_that_makes_a_goal_mean_something_else_is_named(model, changed, register, value):
    robot = robot_of(model)
    found = differences(bus_with(robot, changed), robot)
    assert {one.register for one in found} <= set(changed), found
    [one] = [one for one in found if one.register == register]
    assert (one.joint, one.id, one.found.split(" ")[0]) == ("right_knee", KNEE, value.split(" ")[0])
    assert one.found == value or "(" not in value
    assert one.mend == "screwkin bus configure bioloid --port /dev/ttyUSB0 --go"
    for told in ("right_knee (servo 13)", register, value, one.expected, one.mend):
        assert told in str(one)


@pytest.mark.parametrize("id", [7, 13, 18])
def test_a_servo_without_answer_or_of_another_model_is_named(id):
    robot = robot_of("AX-12A")
    bus = bus_with(robot)
    bus.line.servo(id).put("model_number", 29)
    [one] = differences(bus, robot)
    assert (one.id, one.register, one.found) == (id, "model_number", "29")
    bus = bus_with(robot)
    bus.line.servo(id).silent_until = 1e9
    [one] = differences(bus, robot)
    assert (one.id, one.register, one.found) == (id, "id", "without answer")


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_whatever_a_servo_would_refuse_of_the_joints_range_is_named(data):
    """The servo is the judge: its limits are a difference if, and only if, it refuses a goal of the gate."""
    robot = robot_of("AX-12A")
    bounds, k = Bounds.of(robot), robot.joint_names.index("right_knee")
    low = data.draw(st.integers(0, 1023))
    high = data.draw(st.integers(0, 1023))
    changed = {"angle_limit_low": low, "angle_limit_high": high}
    bus = bus_with(robot, changed)
    agrees = differences(bus, robot) == ()
    goals = [int(bounds.low[k]), int(bounds.high[k])]
    assert agrees == (not any(refuses(bus, goal) for goal in goals) and (low, high) != (0, 0))


def refuses(bus: Bus, goal: int) -> bool:
    """Whether the knee does not take a goal."""
    try:
        bus.write(KNEE, 30, goal, 2)
    except RefusedError:
        return True
    return False


@pytest.mark.parametrize(("model", "changed", "register", "value"), FAULTS)
def test_a_play_is_refused_before_torque_and_names_the_register(model, changed, register, value):
    robot = robot_of(model)
    bus = bus_with(robot, changed)
    home = np.array(robot.posture("home").q)
    with pytest.raises(SafetyError, match=rf"right_knee \(servo 13\): {register} is ") as refusal:
        Player(bus, robot).ready_pose(home)
    assert refusal.value.exit_code == 4
    assert "screwkin bus configure bioloid --port /dev/ttyUSB0 --go" in str(refusal.value)
    assert all(servo.get("torque_enable") == 0 for servo in bus.line.servos)
