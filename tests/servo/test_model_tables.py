"""Register tables of servo models against public drivers: the makers' own, and the constants of another."""

from __future__ import annotations

import re
from importlib.resources import files
from itertools import pairwise

import pytest

from screwkin.motors.library import load_motor
from screwkin.servo.modes import servo_mode
from screwkin.servo.profiles import load_profile, profile_models

EASY = {
    "MX-28-2": "mx_28",
    "MX-64-2": "mx_64",
    "MX-106-2": "mx_106",
    "XL-320": "xl320",
    "XL330-M288": "xl330_m288_fw52",
    "XL430-W250": "xl430_w250",
    "XM430-W350": "xm430_w350",
    "XC330-M288": "xc330_m288_fw52",
}
OURS = {
    "Firmware Version": "firmware",
    "Return Delay Time": "return_delay",
    "Secondary(Shadow) ID": "secondary_id",
    "Max Voltage Limit": "voltage_limit_high",
    "Min Voltage Limit": "voltage_limit_low",
    "PWM Limit": "max_torque",
    "Max Position Limit": "angle_limit_high",
    "CCW Angle Limit": "angle_limit_high",
    "Min Position Limit": "angle_limit_low",
    "CW Angle Limit": "angle_limit_low",
    "Control Mode": "operating_mode",
    "Status Return Level": "status_level",
    "Registered Instruction": "registered",
    "Hardware Error Status": "hardware_error",
    "Position D Gain": "d_gain",
    "Position I Gain": "i_gain",
    "Position P Gain": "p_gain",
    "Feedforward 2nd Gain": "feedforward_2",
    "Feedforward 1st Gain": "feedforward_1",
    "Goal PWM": "torque_limit",
    "Profile Acceleration": "acceleration",
    "Profile Velocity": "moving_speed",
    "Present Current": "present_load",
    "Present Velocity": "present_speed",
    "Present Input Voltage": "present_voltage",
}
"""Names of the makers' that are others here; the rest is theirs in small letters."""

# Constants of the project lerobot (feetech/tables.py) for Feetech's STS servos: address and bytes.
STS = {
    "model_number": (3, 2),
    "id": (5, 1),
    "baud_rate": (6, 1),
    "return_delay": (7, 1),
    "status_level": (8, 1),
    "angle_limit_low": (9, 2),
    "angle_limit_high": (11, 2),
    "temperature_limit": (13, 1),
    "voltage_limit_high": (14, 1),
    "voltage_limit_low": (15, 1),
    "max_torque": (16, 2),
    "drive_mode": (18, 1),
    "shutdown": (19, 1),
    "alarm_led": (20, 1),
    "p_gain": (21, 1),
    "d_gain": (22, 1),
    "i_gain": (23, 1),
    "cw_margin": (26, 1),
    "ccw_margin": (27, 1),
    "current_limit": (28, 2),
    "resolution_divider": (30, 1),
    "homing_offset": (31, 2),
    "operating_mode": (33, 1),
    "overload_rest": (34, 1),
    "overload_time": (35, 1),
    "overload_torque": (36, 1),
    "torque_enable": (40, 1),
    "acceleration": (41, 1),
    "goal_position": (42, 2),
    "moving_speed": (46, 2),
    "torque_limit": (48, 2),
    "lock": (55, 1),
    "present_position": (56, 2),
    "present_speed": (58, 2),
    "present_load": (60, 2),
    "present_voltage": (62, 1),
    "present_temperature": (63, 1),
    "hardware_error": (65, 1),
    "moving": (66, 1),
    "present_current": (69, 2),
}


def makers_table(model: str) -> dict[str, tuple[int, int]]:
    """Address and bytes of every register by our name, of the makers' driver."""
    folder = files("dynamixel_easy_sdk") / "control_table"
    text = (folder / f"{model}.model").read_text("utf-8").split("[control table]")[1]
    rows = [line.split("\t") for line in text.strip().splitlines()[1:]]
    named = {OURS.get(name, re.sub(r"\W+", "_", name.strip()).lower()): row for *row, name in rows}
    return {name: (int(address), int(width)) for name, (address, width) in named.items()}


@pytest.mark.parametrize("model", EASY)
def test_every_register_of_the_makers_driver_is_where_it_says(model):
    profile, theirs = load_profile(model), makers_table(EASY[model])
    ours = {name: (row.address, row.width) for name, row in profile.registers.items()}
    common = {name for name in theirs if not name.startswith("indirect")}
    assert {name: ours.get(name) for name in common} == {name: theirs[name] for name in common}
    if profile.indirect:
        assert theirs["indirect_address_1"] == (profile.indirect.addresses, 2)
        assert theirs["indirect_data_1"] == (profile.indirect.data, 1)


@pytest.mark.parametrize("model", EASY)
def test_numbers_are_those_of_the_makers_driver(model):
    folder = files("dynamixel_easy_sdk") / "control_table"
    listed = dict(
        line.split("\t")[::-1] for line in (folder / "dynamixel.model").read_text().split("\n")[1:] if line
    )
    assert load_profile(model).number == int(listed[f"{EASY[model].removesuffix('_fw52')}.model"])


def test_the_table_of_an_sts3215_is_that_of_another_driver():
    profile = load_profile("STS3215")
    assert {name: (profile.register(name).address, profile.register(name).width) for name in STS} == STS
    signs = {"homing_offset": "bit-11", "moving_speed": "bit-15", "present_speed": "bit-15"}
    assert {name: profile.register(name).sign for name in signs} == signs
    assert profile.number == 777
    assert profile.baud_table[0] == 1_000_000


@pytest.mark.parametrize("model", profile_models())
def test_a_table_is_whole(model):
    profile = load_profile(model)
    rows = sorted(profile.registers.values(), key=lambda row: row.address)
    assert all(before.end <= after.address for before, after in pairwise(rows))
    assert profile.source
    assert profile.sheet
    new = {name: row.initial for name, row in profile.registers.items()}
    assert servo_mode(profile, new) == "joint"
    assert profile.indirect is None or profile.indirect.addresses >= profile.size
    lasting = {"id", "baud_rate", "angle_limit_low", "angle_limit_high", "shutdown", "operating_mode"}
    volatile = {"torque_enable", "goal_position", "present_position", "torque_limit"}
    for name in lasting & set(profile.registers):
        assert profile.register(name).address < profile.ram_begins
    for name in volatile:
        assert profile.register(name).address >= profile.ram_begins


@pytest.mark.parametrize("model", profile_models())
def test_a_motor_that_was_not_measured_is_the_makers_sheet(model):
    """One home for each figure: what is assumed of a motor gives the torque at rest that the sheet prints."""
    profile, figures = load_profile(model), load_motor(model)
    motor = figures.motor
    if figures.identified or "measured" in figures.source or "bam" in figures.source:
        assert motor.voltage == profile.voltage
        return
    assert motor.constant * motor.voltage / motor.resistance == pytest.approx(profile.stall_torque, rel=0.01)
    assert motor.voltage / motor.constant == pytest.approx(profile.no_load_speed, rel=0.03)
