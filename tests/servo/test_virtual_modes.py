"""Virtual servos do what their makers' manuals say of modes, directions, offsets, dividers and turns.

The makers' own driver writes and reads, in simulated time.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.servo.modes import servo_mode
from screwkin.servo.profiles import load_profile, profile_models
from screwkin.servo.virtual.body import approached, spin
from screwkin.servo.virtual.frame import frame_of
from tests.servo.benches import Bench, X, refusal

RPM = 2 * math.pi / 60


@pytest.mark.parametrize("model", profile_models())
def test_a_new_servo_of_every_model_is_pinged_and_goes_where_it_is_sent(model):
    bench = Bench(model)
    assert bench.bus.ping(1) == bench.profile.number
    centre = bench.profile.centre
    assert bench.read("present_position") == centre
    bench.set_up(goal_position=centre)
    bench.write("goal_position", centre + 100)
    bench.after(2.0)
    assert bench.read("present_position") == centre + 100
    assert bench.read("present_voltage") == round(10 * bench.profile.voltage)
    assert bench.servo.alarms == 0
    assert bench.servo.mode == "joint"


@pytest.mark.parametrize("model", profile_models())
@given(data=st.data())
def test_a_position_means_the_angle_at_which_it_is_shown(model, data):
    """Whatever direction, offset and divider: what is shown at the angle of a position is that position."""
    profile = load_profile(model)
    modes = ["joint", "wheel", "multi-turn", "extended position", "velocity"]
    values = {
        name: data.draw(st.integers(register.low, register.high))
        for name in ("drive_mode", "homing_offset", "multi_turn_offset", "resolution_divider")
        if (register := profile.registers.get(name))
    }
    frame = frame_of(profile, data.draw(st.sampled_from(modes)), values)
    position = data.draw(st.integers(0, profile.ticks - 1))
    assert frame.shown(frame.angle(position)) == position


def test_offsets_and_dividers_are_those_of_the_manuals_examples():
    mx, x, sts = load_profile("MX-28"), load_profile("XM430-W350"), load_profile("STS3215")
    middle = 0.0
    assert (
        frame_of(mx, "multi-turn", {"multi_turn_offset": 1024, "resolution_divider": 1}).shown(middle) == 3072
    )
    assert frame_of(mx, "multi-turn", {"resolution_divider": 2}).shown(middle) == 1024
    assert (
        frame_of(mx, "multi-turn", {"multi_turn_offset": 1024, "resolution_divider": 4}).shown(middle) == 1536
    )
    assert frame_of(mx, "joint", {"multi_turn_offset": 1024, "resolution_divider": 4}).shown(middle) == 2048
    assert frame_of(x, "joint", {"homing_offset": 1000}).shown(middle) == 3048
    assert (
        frame_of(x, "joint", {"homing_offset": 1025}).shown(middle) == 2048
    )  # beyond a quarter turn: ignored
    assert frame_of(x, "extended position", {"homing_offset": 4096}).shown(middle) == 6144
    assert frame_of(x, "joint", {"drive_mode": 1, "homing_offset": 10}).shown(100 * x.tick) == 2048 - 100 + 10
    assert frame_of(sts, "joint", {"homing_offset": 500}).shown(middle) == 1548


@given(
    st.floats(-9, 9),
    st.floats(-9, 9),
    st.floats(-2, 2),
    st.lists(st.floats(0.001, 0.2), min_size=1, max_size=5),
)
def test_turning_does_not_depend_on_how_often_one_looks(rate, wanted, angle, steps):
    at, speed = angle, rate
    for dt in steps:
        at, speed = spin(at, speed, wanted, dt, 0.03)
    once = spin(angle, rate, wanted, sum(steps), 0.03)
    assert (at, speed) == pytest.approx(once, abs=1e-9)
    assert spin(angle, 0.0, wanted, 1e-4, 10.0)[1] == pytest.approx(wanted * 1e-5, rel=1e-3, abs=1e-12)
    assert approached(angle, angle + 1.0, 5.0, 9.0, 0.03)[0] == pytest.approx(angle + 1.0)


@pytest.mark.parametrize(
    ("model", "share"), [("AX-12A", True), ("AX-18A", True), ("XL-320", True), ("MX-28", False)]
)
def test_in_wheel_mode_the_speed_register_turns_a_servo_without_end(model, share):
    bench = Bench(model)
    mode = {"operating_mode": 1} if model == "XL-320" else {"angle_limit_low": 0, "angle_limit_high": 0}
    bench.set_up(**mode, moving_speed=256)
    assert bench.servo.mode == "wheel"
    expected = 256 / 1023 * bench.profile.no_load_speed if share else 256 * bench.profile.speed_unit
    bench.after(20.0)
    assert bench.body.rate == pytest.approx(expected)
    assert bench.body.angle > 2 * math.pi
    bench.write("moving_speed", -256)
    bench.after(1.0)
    assert bench.body.rate == pytest.approx(-expected)
    bench.write("moving_speed", 0)
    bench.after(1.0)
    assert bench.body.rate == pytest.approx(0.0, abs=1e-6)
    bench.write("goal_position", 100)  # no goal in this mode
    assert bench.after(1.0).rate == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("model", X)
def test_in_velocity_mode_a_goal_is_a_rate_within_its_limit(model):
    bench = Bench(model)
    bench.set_up(operating_mode=bench.profile.modes["velocity"], goal_position=0)
    bench.write("goal_velocity", 100)
    assert bench.after(1.0).rate == pytest.approx(22.9 * RPM)
    assert bench.read("present_speed") == 100
    limit = bench.read("velocity_limit")
    refusal({"range"}, lambda: bench.write("goal_velocity", limit + 1))
    bench.write("goal_velocity", -100)
    assert bench.after(1.0).rate == pytest.approx(-22.9 * RPM)
    start = bench.read("present_position")
    bench.after(60.0)
    assert bench.read("present_position") < start - 4096  # it counts on


@pytest.mark.parametrize("model", ["MX-28-2", "XM430-W350", "STS3215"])
def test_in_pwm_mode_a_goal_is_a_share_of_the_voltage(model):
    bench = Bench(model)
    goal = "goal_pwm" if model == "STS3215" else "torque_limit"
    bench.set_up(operating_mode=bench.profile.modes["pwm"])
    full = bench.profile.register(goal).high
    bench.write(goal, full // 2)
    half = (full // 2) / full * bench.profile.no_load_speed
    assert bench.after(1.0).rate == pytest.approx(half)
    bench.body.load = -0.25 * bench.profile.stall_torque
    assert bench.after(1.0).rate == pytest.approx(half - 0.25 * bench.profile.no_load_speed)
    bench.body.load = -0.75 * bench.profile.stall_torque
    assert bench.after(1.0).rate == pytest.approx(0.0, abs=1e-9)  # its gears hold


@pytest.mark.parametrize("model", ["XM430-W350", "XL330-M288", "XC330-M288", "MX-64", "MX-106", "MX-64-2"])
def test_in_current_mode_a_goal_is_a_torque(model):
    bench = Bench(model)
    if "torque_control" in bench.profile.registers:
        bench.set_up(torque_control=1)
        goal = "goal_torque"
    else:
        bench.set_up(operating_mode=bench.profile.modes["current"])
        goal = "goal_current"
    assert bench.servo.mode == "current"
    units = round(0.3 / bench.profile.load_unit)
    bench.write(goal, units)
    assert bench.after(1.0).rate == pytest.approx(bench.profile.no_load_speed)
    bench.body.load = -0.4 * bench.profile.stall_torque  # more than it pulls
    assert bench.after(1.0).rate == pytest.approx(-bench.profile.no_load_speed)
    bench.body.load = 0.0
    bench.write(goal, 0)
    assert bench.after(1.0).rate == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("model", X)
def test_only_extended_position_mode_takes_goals_beyond_a_turn(model):
    bench = Bench(model)
    bench.set_up(goal_position=2048)
    refusal({"range"}, lambda: bench.write("goal_position", 6000))
    bench.write("torque_enable", 0)
    bench.write("operating_mode", bench.profile.modes["extended position"])
    bench.set_up(goal_position=2048)
    bench.write("goal_position", -6000)
    bench.after(8.0)
    assert bench.read("present_position") == -6000
    assert bench.body.angle == pytest.approx(-8048 * bench.profile.tick)


def test_several_turns_of_an_mx_of_protocol_1_and_of_an_sts():
    mx = Bench("MX-28")
    mx.set_up(angle_limit_low=4095, angle_limit_high=4095, resolution_divider=2, multi_turn_offset=100)
    assert mx.servo.mode == "multi-turn"
    mx.write("goal_position", 3000)
    mx.after(8.0)
    assert mx.body.angle == pytest.approx((2900 * 2 - 2048) * mx.profile.tick)
    sts = Bench("STS3215")
    sts.set_up(angle_limit_low=0, angle_limit_high=0)
    assert sts.servo.mode == "multi-turn"
    sts.write("goal_position", 9000)
    sts.after(8.0)
    assert sts.body.angle == pytest.approx((9000 - 2048) * sts.profile.tick)
    assert sts.read("present_position") == 9000


def test_a_reversed_servo_turns_the_other_way_and_counts_the_other_way():
    for model, bit in (("XM430-W350", 1), ("MX-106", 1), ("STS3215", 12 | 128)):
        bench = Bench(model)
        bench.set_up(drive_mode=bit, goal_position=2048)
        bench.write("goal_position", 2148)
        bench.after(2.0)
        assert bench.body.angle == pytest.approx(-100 * bench.profile.tick)
        assert bench.read("present_position") == 2148


def test_in_current_based_position_mode_a_small_current_is_overloaded_early():
    overloaded = []
    for current in (1193, 200):
        bench = Bench("XM430-W350")
        bench.set_up(operating_mode=5, goal_current=current, goal_position=2048)
        bench.body.load = -1.5  # of 4.1 N m: 0.37; 200 counts are 0.23
        bench.after(1.0)
        overloaded.append(bool(bench.servo.alarms))
    assert overloaded == [False, True]


@pytest.mark.parametrize("model", profile_models())
def test_mode_follows_the_registers_of_the_servo(model):
    bench = Bench(model)
    for mode, value in bench.profile.modes.items():
        bench.write("operating_mode", value)
        assert bench.servo.mode == mode
    values = {name: bench.servo.get(name) for name in bench.profile.registers}
    assert servo_mode(bench.profile, values) == bench.servo.mode
