"""A servo model is one file: a user's own stands wherever a name does, and every fault of it is named."""

from __future__ import annotations

import copy
import math
import tomllib
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.errors import InputError, ScrewkinError, TableError
from screwkin.model.servo_models import bundled_tables
from screwkin.model.table import load_robot
from screwkin.motors.library import load_motor
from screwkin.servo.bus import Bus
from screwkin.servo.gate import Bounds
from screwkin.servo.model_file import bus_faults, unit_scale
from screwkin.servo.profiles import decode, encode, load_profile, profile_models
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.survey import measured_angles, scan, servo_differences
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.robot import virtual_servos

AX = (files("screwkin.motors") / "models" / "ax-12a.toml").read_text("utf-8")
MINE = (
    AX.replace('"AX-12A"', '"MINE-7"')
    .replace("number = 12", "number = 4242")
    .replace("initial = 12 }", "initial = 4242 }")
)


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(MINE, encoding="utf-8")
    return path


def test_a_users_file_stands_wherever_a_name_does(mine):
    """As a model of a robot's table, beside that table: map, gate, virtual servos, scan, readings."""
    robot = replace(load_robot("bioloid"), path=str(mine.parent / "robot.toml"))
    robot = replace(robot, servos={**robot.servos, "model": "mine.toml"})
    servos = ServoMap.of(robot)
    assert {joint.profile.model for joint in servos.joints} == {"MINE-7"}
    assert Bounds.of(robot).profiles[0].number == 4242
    clock = SimulatedClock()
    bus = Bus(VirtualBus(virtual_servos(robot), clock), servos.protocol, servos.baud, clock, patience=0.003)
    answering = scan(bus, range(1, 19))
    assert {servo.model for servo in answering} == {4242}
    assert servo_differences(answering, servos) == []
    home = dict(zip(robot.joint_names, robot.posture("home").q, strict=True))
    for joint, angle in measured_angles(bus, servos).items():
        servo = servos.joint(joint)
        assert servo.direction * (angle - servo.zero) == pytest.approx(home[joint], abs=servo.profile.tick)


def test_a_users_file_may_also_hold_the_motor(mine):
    assert load_motor(mine).model == load_profile(str(mine)).model == "MINE-7"
    assert load_motor(mine).motor == load_motor("AX-12A").motor
    bus_only = mine.with_name("bus.toml")
    bus_only.write_text(MINE[: MINE.index("[motor]")], encoding="utf-8")
    assert load_profile(str(bus_only)).registers == load_profile(str(mine)).registers
    with pytest.raises(TableError, match="Write at least constant"):
        load_motor(bus_only)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (
            "stall_torque = 1.5",
            "stall_torque = -1",
            r"\[sheet\], key stall_torque: is -1. Write a number above 0",
        ),
        ("stall_torque = 1.5", "", r"\[sheet\], key stall_torque: is missing. Write a number above 0"),
        (
            "no_load_rpm = 59.0",
            "no_load_rps = 1",
            r"\[sheet\], key no_load_rps: is unknown. Did you mean 'no_load_rpm'\? Known are source",
        ),
        (
            "protocol = 1.0",
            "protocol = 3.0",
            r"\[bus\], key protocol: is 3.0. Write 1.0 or 2.0 or \"FT-SCS\"",
        ),
        ("protocol = 1.0", "protocol = [1]", r"\[bus\], key protocol: is \[1\]"),
        ("ticks = 1024", 'ticks = "many"', r"\[bus\], key ticks: is 'many'. Write an integer above 1"),
        ("range_deg = 300.0", "range_deg = 400", "key range_deg: is 400. Write a number of degrees to 360"),
        (
            'baud = "divisor"',
            "baud = [9600, 0]",
            r'key baud: is \[9600, 0\]. Write "divisor" or a list of rates',
        ),
        ("reads = []", 'reads = ["slow"]', "key reads"),
        (
            "reads = []",
            "modes = { joint = 3 }",
            r"key modes: is \{'joint': 3\}. Write both modes and the register",
        ),
        ("reads = []", "unlocked_to_last = 1", "key unlocked_to_last: is 1. Write true or false"),
        (
            "reads = []",
            "indirect = { addresses = 168 }",
            "key indirect: .* Write addresses, data, count; and",
        ),
        ("reads = []", "modes = { fly = 3 }", "key modes: .* Write joint and others of joint, wheel"),
        (
            "address = 3, width = 1",
            "address = 3, width = 3",
            r"\[registers\] id, key width: is 3. Write 1, 2 or 4",
        ),
        ("address = 3, width = 1", "width = 1", r"\[registers\] id, key address: is missing"),
        ("address = 3, width = 1", "adress = 3, width = 1", r"\[registers\] id, key adress: is unknown"),
        ("address = 4, width = 1", "address = 3, width = 1", "lies within"),
        ("high = 253, initial = 1", "high = 253, initial = 300", "id, key initial: is 300. Write 0 to 253"),
        (
            "high = 253, initial = 1",
            "high = 256",
            "id, key high: is 256, low is 0. Write bounds within 0 to 255",
        ),
        (
            'unit = "0.1V", low = 50',
            'unit = "furlong", low = 50',
            "key unit: is 'furlong'. Write tick, speed",
        ),
        ('sign = "bit-10"', 'sign = "bit-9"', "key sign: is 'bit-9'"),
        ("goal_position =", "goal_place =", r"\[registers\], key goal_position: is missing"),
        ('model = "MINE-7"', "model = 7", "key model: is 7. Write the name of the servo model"),
        (
            'model = "MINE-7"',
            'model = "MINE-7"\ncolour = "red"',
            "key colour: is unknown. Known are model, aliases",
        ),
        ("[sheet]", "[shet]", r"key shet: is unknown"),
    ],
)
def test_every_fault_is_named_by_file_key_value_and_what_would_be_right(mine, old, new, named):
    assert MINE.count(old) >= 1
    mine.write_text(MINE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(TableError, match=named) as refused:
        load_profile(str(mine))
    assert str(mine) in str(refused.value)


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("fast_sync_read = 45", "firmware"),
        ("indirect = { addresses = 168, data = 224, count = 28 }", "firmware"),
        ("unlocked_to_last = true", "lock"),
    ],
)
def test_what_needs_a_register_says_which(mine, key, name):
    text = MINE.replace("reads = []", key)
    mine.write_text(text, encoding="utf-8")
    load_profile(str(mine))
    mine.write_text(text.replace(f"\n{name} = {{", f"\nother_{name} = {{"), encoding="utf-8")
    with pytest.raises(TableError, match=rf"\[registers\], key {name}: is missing, and \[bus\] has"):
        load_profile(str(mine))


def test_all_faults_are_listed_at_once(mine):
    mine.write_text(
        MINE.replace("ticks = 1024", "ticks = 0").replace("voltage = 12.0", "", 1), encoding="utf-8"
    )
    with pytest.raises(TableError) as refused:
        load_profile(str(mine))
    assert len(refused.value.faults) == 2
    robot = load_robot("bioloid")
    with pytest.raises(TableError, match="key ticks: is 0"):
        ServoMap.of(replace(robot, servos={**robot.servos, "model": str(mine)}))


@pytest.mark.parametrize(
    "text", ["", "model = ", "\x00", "[registers]", "registers = 3\n[bus]", "registers = []"]
)
def test_what_is_no_model_is_refused(mine, text):
    mine.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"mine\.toml|TOML"):
        load_profile(str(mine))


def places(table: Any, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every key of a table and of those in it."""
    found = []
    for key, value in table.items():
        found.append((*path, key))
        if isinstance(value, dict):
            found += places(value, (*path, key))
    return found


ODD = (
    st.none()
    | st.booleans()
    | st.integers(-3, 70000)
    | st.floats()
    | st.text(max_size=4)
    | st.lists(st.integers(), max_size=2)
)


@given(st.data())
def test_no_value_whatever_is_accepted_and_then_breaks(data):
    """Anything put anywhere into a bundled file is a named fault, or its registers hold their range."""
    table = copy.deepcopy(dict(data.draw(st.sampled_from(bundled_tables()))[0]))
    *path, key = data.draw(st.sampled_from(places({k: table[k] for k in ("sheet", "bus", "registers")})))
    inner = table
    for name in path:
        inner = inner[name]
    inner[key] = data.draw(ODD | st.just({}))
    if not list(bus_faults(table)):
        from screwkin.servo.profiles import _profile

        for register in _profile(table, "drawn").registers.values():
            for value in (register.low, register.initial, register.high):
                assert decode(register, encode(register, value)) == value


@pytest.mark.parametrize("model", profile_models())
def test_every_value_of_every_register_returns_from_what_it_holds(model):
    for register in load_profile(model).registers.values():
        step = max(1, (register.high - register.low) // 997)
        for value in {*range(register.low, register.high, step), register.high, register.initial}:
            raw = encode(register, value)
            assert 0 <= raw < 1 << (8 * register.width)
            assert decode(register, raw) == value


def test_units_are_a_number_and_a_unit():
    assert [
        unit_scale(unit) for unit in ("0.1V", "2us", "20ms", "4.5mA", "degC", "tick", "")
    ] == pytest.approx([0.1, 2e-6, 0.02, 4.5e-3, 1.0, 1.0, 1.0])
    assert math.isnan(unit_scale("0.1furlong"))


def test_bundled_files_have_no_faults():
    for table, where in bundled_tables():
        assert not list(bus_faults(table)), where
        assert tomllib.loads(AX)["model"] == "AX-12A"


def test_an_error_of_a_file_is_one_of_ours(tmp_path):
    with pytest.raises(ScrewkinError, match="servo model file"):
        load_profile(str(tmp_path / "none.toml"))
