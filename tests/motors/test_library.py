"""Files of servo models: what they hold, and what is refused."""

import dataclasses

import pytest

import screwkin as sk
from screwkin.errors import InputError, TableError, UnknownNameError
from screwkin.motors.library import load_motor, motor_models, motor_text, motors_of, names_motors
from screwkin.motors.records import Friction, Motor


def test_every_bundled_model_names_its_source_and_marks_what_is_not_identified():
    for name in motor_models():
        model = load_motor(name)
        assert model.source
        assert model.identified != bool(model.ranges), name
        for figure, (least, most) in model.ranges.items():
            owner = model.motor if hasattr(model.motor, figure) else model.motor.friction
            assert least <= getattr(owner, figure) <= most, (name, figure)


@pytest.mark.parametrize("name", motor_models())
def test_a_model_written_to_a_file_is_read_as_it_was(name, tmp_path):
    path = tmp_path / "mine.toml"
    model = load_motor(name)
    path.write_text(motor_text(model), encoding="utf-8")
    assert load_motor(path) == model


def test_names_and_aliases_are_found_in_any_case_and_others_are_listed():
    assert load_motor("ax-12") is load_motor("AX-12A")
    with pytest.raises(UnknownNameError, match="XL330"):
        load_motor("AX-13")
    with pytest.raises(UnknownNameError, match="file"):
        load_motor("nowhere.toml")


def test_every_fault_of_a_file_is_listed_at_once(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(
        "model = 'mine'\n[motor]\nconstant = 0\nvoltage = nan\ngain = 1\nspeed = 2\narmature = -1\n"
        "[motor.friction]\ncoulombs = 1\n[ranges]\ngain = 3\n",
        encoding="utf-8",
    )
    with pytest.raises(TableError) as caught:
        load_motor(path)
    for word in ("constant", "voltage", "resistance", "speed", "armature", "coulombs", "gain"):
        assert word in str(caught.value)


def test_a_table_sets_supply_and_gain_of_its_motors_and_may_name_a_file(tmp_path):
    robot = sk.load_robot("bioloid")
    own = tmp_path / "mine.toml"
    own.write_text(motor_text(load_motor("XL330")), encoding="utf-8")
    changed = dataclasses.replace(
        robot, servos={**robot.servos, "models": {"left_knee": str(own)}, "voltage": 7.4, "gain": 200.0}
    )
    motors = dict(zip(robot.joint_names, motors_of(changed), strict=True))
    assert motors["left_knee"].constant == load_motor("XL330").motor.constant
    assert {(motor.voltage, motor.kp) for motor in motors.values()} == {(7.4, 200.0)}
    with pytest.raises(InputError, match="voltage"):
        motors_of(dataclasses.replace(robot, servos={**robot.servos, "voltage": -1}))


def test_a_robot_without_servo_models_says_so():
    robot = sk.load_robot("bioloid")
    bare = dataclasses.replace(robot, servos={})
    assert names_motors(robot)
    assert not names_motors(bare)
    with pytest.raises(InputError, match="names no servo model"):
        motors_of(bare)


def test_every_figure_of_the_records_can_stand_in_a_file():
    """A figure added to a record is in its file too: the writer knows no list of its own."""
    text = motor_text(load_motor("AX-12A"))
    for f in (*dataclasses.fields(Motor), *dataclasses.fields(Friction)):
        assert f.name in text
