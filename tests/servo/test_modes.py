"""What a goal means to a servo follows from its registers, as the makers' tables say."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.servo.modes import mode_registers, servo_mode
from screwkin.servo.profiles import load_profile, profile_models

MODELS = profile_models()


@pytest.mark.parametrize("model", MODELS)
def test_a_new_servo_is_a_joint(model):
    profile = load_profile(model)
    new = {name: register.initial for name, register in profile.registers.items()}
    assert servo_mode(profile, new) == "joint"
    assert servo_mode(profile, {name: new[name] for name in mode_registers(profile)}) == "joint"


@pytest.mark.parametrize(
    ("model", "values", "mode"),
    [
        ("AX-12A", {"angle_limit_low": 0, "angle_limit_high": 0}, "wheel"),
        ("AX-12A", {"angle_limit_low": 1023, "angle_limit_high": 1023}, "joint"),
        ("AX-12A", {"angle_limit_low": 400, "angle_limit_high": 620}, "joint"),
        ("MX-28", {"angle_limit_low": 0, "angle_limit_high": 0}, "wheel"),
        ("MX-28", {"angle_limit_low": 4095, "angle_limit_high": 4095}, "multi-turn"),
        ("MX-28-2", {"operating_mode": 1}, "velocity"),
        ("MX-28-2", {"operating_mode": 3}, "joint"),
        ("MX-28-2", {"operating_mode": 4}, "extended position"),
        ("MX-28-2", {"operating_mode": 16}, "pwm"),
        ("MX-28-2", {"operating_mode": 5}, "unknown"),
        ("XM430-W350", {"operating_mode": 5}, "current-based position"),
        ("XM430-W350", {"operating_mode": 0}, "current"),
        ("MX-64", {"angle_limit_low": 0, "angle_limit_high": 4095, "torque_control": 1}, "current"),
        ("MX-64", {"angle_limit_low": 0, "angle_limit_high": 4095, "torque_control": 0}, "joint"),
        ("XL-320", {"operating_mode": 1}, "wheel"),
        ("XL-320", {"operating_mode": 2}, "joint"),
        ("STS3215", {"operating_mode": 0, "angle_limit_low": 0, "angle_limit_high": 4095}, "joint"),
        ("STS3215", {"operating_mode": 0, "angle_limit_low": 0, "angle_limit_high": 0}, "multi-turn"),
        ("STS3215", {"operating_mode": 1, "angle_limit_low": 0, "angle_limit_high": 4095}, "velocity"),
    ],
)
def test_modes_are_those_of_the_makers_tables(model, values, mode):
    assert servo_mode(load_profile(model), values) == mode


@given(st.sampled_from(MODELS), st.integers(0, 4095), st.integers(0, 4095), st.integers(0, 255))
def test_only_one_pattern_of_registers_is_another_mode(model, low, high, mode):
    profile = load_profile(model)
    values = {"angle_limit_low": low, "angle_limit_high": high, "operating_mode": mode, "torque_control": 0}
    chosen = servo_mode(profile, values)
    if profile.modes:
        turns = model == "STS3215" and low == high == 0
        assert (chosen == "joint") == (mode == profile.modes["joint"] and not turns)
    elif low != high:
        assert chosen == "joint"
