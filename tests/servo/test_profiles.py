"""Servo models: the makers' numbers, pairs of functions that undo each other, and a robot's servos."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.errors import InputError, TableError, UnknownNameError
from screwkin.model.table import load_robot
from screwkin.motors.library import load_motor, motor_text
from screwkin.servo.profiles import (
    baud_from_register,
    decode,
    encode,
    load_profile,
    physical,
    profile_models,
    radians_from_ticks,
    rate_from_speed,
    register_from_baud,
    speed_from_rate,
    ticks_from_radians,
)
from screwkin.servo.servo_map import ServoMap

MODELS = profile_models()
RPM = 2 * math.pi / 60


@pytest.mark.parametrize(
    ("model", "number", "protocol", "ticks", "degrees", "centre", "goal", "present"),
    [
        ("AX-12A", 12, 1.0, 1024, 300, 512, (30, 2), (36, 2)),
        ("MX-28", 29, 1.0, 4096, 360, 2048, (30, 2), (36, 2)),
        ("MX-28-2", 30, 2.0, 4096, 360, 2048, (116, 4), (132, 4)),
        ("SR-518", 0, 1.0, 1024, 300, 512, (30, 2), (36, 2)),
        ("AX-18A", 18, 1.0, 1024, 300, 512, (30, 2), (36, 2)),
        ("MX-64", 310, 1.0, 4096, 360, 2048, (30, 2), (36, 2)),
        ("MX-106", 320, 1.0, 4096, 360, 2048, (30, 2), (36, 2)),
        ("XL-320", 350, 2.0, 1024, 300, 512, (30, 2), (37, 2)),
        ("XL330-M288", 1200, 2.0, 4096, 360, 2048, (116, 4), (132, 4)),
        ("XL430-W250", 1060, 2.0, 4096, 360, 2048, (116, 4), (132, 4)),
        ("XM430-W350", 1020, 2.0, 4096, 360, 2048, (116, 4), (132, 4)),
        ("XC330-M288", 1240, 2.0, 4096, 360, 2048, (116, 4), (132, 4)),
        ("STS3215", 777, "FT-SCS", 4096, 360, 2048, (42, 2), (56, 2)),
    ],
)
def test_profiles_hold_the_makers_numbers(model, number, protocol, ticks, degrees, centre, goal, present):
    profile = load_profile(model)
    assert (profile.number, profile.protocol, profile.ticks, profile.range_deg) == (
        number, protocol, ticks, degrees,
    )  # fmt: skip
    assert profile.centre == centre
    for name, place in (("goal_position", goal), ("present_position", present)):
        register = profile.register(name)
        assert (register.address, register.width) == place
    assert profile.register("model_number").initial == number


def test_only_the_servo_nobody_measured_is_unverified():
    assert [model for model in MODELS if not load_profile(model).verified] == ["SR-518"]


@pytest.mark.parametrize("model", MODELS)
def test_registers_do_not_overlap_and_hold_their_own_range(model):
    rows = sorted(load_profile(model).registers.values(), key=lambda row: row.address)
    for before, after in pairwise(rows):
        assert before.end <= after.address
    for row in rows:
        assert row.low <= row.initial <= row.high
        assert 0 <= encode(row, row.low) < 1 << (8 * row.width)
        assert 0 <= encode(row, row.high) < 1 << (8 * row.width)
        assert row.access in ("r", "rw")


@pytest.mark.parametrize("model", MODELS)
def test_every_tick_returns_from_its_angle(model):
    profile = load_profile(model)
    back = [ticks_from_radians(profile, radians_from_ticks(profile, t)) for t in range(profile.ticks)]
    assert back == list(range(profile.ticks))


@pytest.mark.parametrize("model", MODELS)
def test_every_speed_returns_from_its_rate(model):
    profile = load_profile(model)
    speeds = range(1, min(profile.register("moving_speed").high, 3000) + 1)
    assert [speed_from_rate(profile, rate_from_speed(profile, s)) for s in speeds] == list(speeds)


def test_angles_of_an_ax_12_are_those_of_its_manual():
    profile = load_profile("ax-12")
    assert ticks_from_radians(profile, 0.0) == 512
    assert ticks_from_radians(profile, math.radians(-150)) == 0
    assert math.degrees(radians_from_ticks(profile, 1023)) == pytest.approx(149.707, abs=1e-3)
    assert rate_from_speed(profile, 1023) / RPM == pytest.approx(113.55, abs=0.01)


@given(st.sampled_from(MODELS), st.floats(-3, 3))
def test_rounding_is_to_the_nearest_tick_or_refused(model, angle):
    profile = load_profile(model)
    try:
        ticks = ticks_from_radians(profile, angle)
    except InputError:
        assert angle < profile.lower - profile.tick / 2.01 or angle > profile.upper + profile.tick / 2.01
    else:
        assert abs(radians_from_ticks(profile, ticks) - angle) <= profile.tick * 0.5000001


@pytest.mark.parametrize("angle", [math.radians(150), -3.0, math.nan, math.inf, 1e300])
def test_an_angle_out_of_range_is_refused_by_value_and_range(angle):
    with pytest.raises(InputError, match="AX-12A") as refused:
        ticks_from_radians(load_profile("AX-12A"), angle)
    if math.isfinite(angle):
        assert f"{angle:.4f}" in str(refused.value)
        assert "-2.6180 to 2.6129 rad" in str(refused.value)


def test_a_small_speed_limit_is_never_no_limit():
    profile = load_profile("MX-28")
    assert speed_from_rate(profile, 1e-9) == 1
    for rate in (0.0, -1.0, math.nan, 1e3):
        with pytest.raises(InputError, match="speed limit"):
            speed_from_rate(profile, rate)


@pytest.mark.parametrize("model", MODELS)
def test_signs_of_readings_are_undone(model):
    profile = load_profile(model)
    for name in ("present_speed", "present_load"):
        register = profile.register(name)
        for value in (-100, -1, 0, 1, 100):
            raw = encode(register, value)
            assert 0 <= raw < 1 << (8 * register.width)
            assert decode(register, raw) == value


def test_readings_are_in_si():
    ax, mx = load_profile("AX-12A"), load_profile("MX-28-2")
    assert physical(ax, "present_speed", 0x400 + 100) == pytest.approx(-11.1 * RPM)
    assert physical(ax, "present_load", 1023) == pytest.approx(1.0)
    assert physical(ax, "present_voltage", 111) == pytest.approx(11.1)
    assert physical(ax, "present_temperature", 37) == 37
    assert physical(ax, "return_delay", 250) == pytest.approx(500e-6)
    assert physical(mx, "present_position", 2**32 - 1) == pytest.approx(-2049 * 2 * math.pi / 4096)
    assert physical(mx, "present_speed", 2**32 - 10) == pytest.approx(-2.29 * RPM)
    with pytest.raises(UnknownNameError, match="AX-12A"):
        physical(ax, "acceleration", 0)


def test_a_value_beyond_its_register_is_refused():
    with pytest.raises(InputError, match=r"goal_position cannot hold 1024; its range is 0 to 1023"):
        encode(load_profile("AX-12A").register("goal_position"), 1024)


def test_baud_rates_are_those_of_the_manuals():
    ax, mx = load_profile("AX-12A"), load_profile("MX-28-2")
    assert [baud_from_register(ax, v) for v in (1, 3, 34, 207)] == [1_000_000, 500_000, 57_142, 9_615]
    assert register_from_baud(ax, 57_600) == 34
    assert [register_from_baud(mx, b) for b in (57_600, 1_000_000, 4_500_000)] == [1, 3, 7]
    with pytest.raises(InputError, match="cannot talk at 777777"):
        register_from_baud(mx, 777_777)


def test_unknown_models_are_told_with_the_known_ones():
    with pytest.raises(UnknownNameError, match=r"AX-12A, AX-18A, .* SR-518, STS3215"):
        load_profile("XM-430")


@pytest.mark.parametrize("name", ["bioloid", "bioloid24", "poppy12"])
def test_bundled_robots_know_their_servos(name):
    robot = load_robot(name)
    servos = ServoMap.of(robot)
    assert tuple(servo.joint for servo in servos.joints) == robot.joint_names
    assert sorted(servos.ids) == list(range(1, len(robot.joints) + 1))
    assert (servos.protocol, servos.baud) == (1.0, 1_000_000)
    for servo in servos.joints:
        assert servos.by_id(servo.id) is servos.joint(servo.joint) is servo


def test_direction_and_offset_stand_between_joint_and_ticks():
    robot = load_robot("bioloid")
    name = robot.joint_names[0]
    tick = math.radians(300 / 1024)
    servos = {**robot.servos, "direction": {name: -1}, "zero": {name: 100 * tick}}
    servo = ServoMap.of(replace(robot, servos=servos)).joint(name)
    assert servo.ticks_from_angle(0.0) == 612
    assert servo.ticks_from_angle(10 * tick) == 602
    assert servo.angle_from_ticks(602) == pytest.approx(10 * tick)
    assert (servo.lower, servo.upper) == pytest.approx((-411 * tick, 612 * tick))
    with pytest.raises(InputError, match=rf"joint {name} \(servo 7\) at -1.5000 rad: angle"):
        replace(servo, zero=2.5).ticks_from_angle(-1.5)


def test_a_measured_tick_overrides_the_models():
    robot = load_robot("poppy12")
    servo = ServoMap.of(replace(robot, servos={**robot.servos, "range_deg": 327.68})).joints[0]
    assert servo.angle_from_ticks(513) == pytest.approx(math.radians(0.32))


def test_all_faults_of_a_robots_servos_are_told_at_once():
    robot = load_robot("bioloid")
    ids = {**robot.servos["ids"], "right_knee": 7, "left_knee": 300, "tail": 40}
    del ids["left_elbow"]
    servos = {
        "model": "AX-12A", "models": {"right_elbow": "HAL-9000"}, "protocol": 2.0, "baud": 123, "ids": ids,
        "direction": {"right_knee": 0}, "zero": {"left_elbow": "45"}, "colour": "red",
    }  # fmt: skip
    with pytest.raises(TableError) as told:
        ServoMap.of(replace(robot, servos=servos))
    text = str(told.value)
    for part in (
        "7 is given to right_hip_yaw, right_knee",
        "ids.left_knee: is 300",
        "ids.tail: is no joint",
        "has none for left_elbow",
        "models.right_elbow: 'HAL-9000' is unknown",
        "protocol: is 2.0, but a AX-12A speaks 1.0",
        "cannot talk at 123 baud",
        "direction.right_knee: is 0",
        "zero.left_elbow: is '45'",
        "key colour: is unknown",
    ):
        assert part in text
    assert len(told.value.faults) == 10


def test_a_model_of_which_only_the_motor_is_known_is_refused_by_the_bus_alone(tmp_path):
    robot, mine = load_robot("bioloid"), tmp_path / "mine.toml"
    mine.write_text(motor_text(replace(load_motor("XL430"), model="mine")), encoding="utf-8")
    with pytest.raises(TableError, match=r"mine.toml' has no registers that a bus could write"):
        ServoMap.of(replace(robot, servos={**robot.servos, "model": str(mine)}))


def test_a_users_file_has_the_registers_of_the_model_that_it_names(tmp_path):
    mine = tmp_path / "mine.toml"
    model = load_motor("AX-12A")
    mine.write_text(motor_text(replace(model, model="mine", registers="AX-12A")), encoding="utf-8")
    assert load_profile(str(mine)) is load_profile("AX-12A")
    assert load_profile("mine.toml", tmp_path) is load_profile("AX-12A")
    mine.write_text(motor_text(replace(model, model="mine")), encoding="utf-8")
    with pytest.raises(UnknownNameError, match="simulated"):
        load_profile(str(mine))


@pytest.mark.parametrize(
    "servos", [{}, {"model": 7}, {"ids": 3}, {"model": "MX-28", "models": {"right_knee": "MX-28-2"}}]
)
def test_servos_that_cannot_be_read_are_faults_and_no_crash(servos):
    with pytest.raises(TableError):
        ServoMap.of(replace(load_robot("bioloid"), servos=servos))
