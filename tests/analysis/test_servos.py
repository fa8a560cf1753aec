"""Verdicts on real servos: what is played, what is recorded, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.engines import Refinement, SimulatedCompliance, opened
from screwkin.analysis.readiness import ready
from screwkin.analysis.validate import planned_facts
from screwkin.analysis.verdict import bound_to, verdict_of
from screwkin.compliance.springs import joint_stiffness
from screwkin.errors import InputError, SafetyError, UnknownNameError
from screwkin.gait.compensation import compensate_walk, stiffness_of, way_of
from screwkin.motors.library import load_motor, motor_text
from screwkin.sim.compliant import Compliance
from tests.verdicts import passing

ROBOT = sk.load_robot("bioloid")
TABLE = SimulatedCompliance(motors="table")


@pytest.fixture(scope="module")
def fast():
    """The preview walk at 0.65 s a step, which falls on these servos if they are sent the plan itself."""
    return sk.walk(ROBOT, sk.load_gait("preview").replace(Tc=0.65), steps=4)


@pytest.fixture(scope="module")
def verdict(fast):
    pytest.importorskip("mujoco")
    return sk.validate(ROBOT, fast, "mujoco", servo="table")


def test_the_torque_term_on_a_plan_is_a_warning_and_send_refuses_such_a_verdict(verdict, fast, tmp_path):
    """What send would play is the plan; only the file with the commands is what was validated."""
    assert any("--compensate dynamic" in warning for warning in verdict.warnings)
    path = passing(fast.save(tmp_path / "trajectory.npz"), servo="table", compensation=verdict.compensation)
    with pytest.raises(SafetyError, match="compensation is none, the verdict says dynamic") as refused:
        ready(path)
    assert "write those with screwkin walk --compensate dynamic" in str(refused.value)


def test_a_servo_file_that_changed_since_is_refused(verdict, fast, tmp_path):
    """The robot's table holds the name of such a file, not its figures; the verdict holds their hash."""
    file = tmp_path / "mine.toml"
    file.write_text(motor_text(load_motor("AX-12A")), encoding="utf-8")
    commands = compensate_walk(ROBOT, fast, model="dynamic")
    own = replace(verdict, servo=str(file))
    data = verdict_of(ROBOT, commands, replace(own, **planned_facts(ROBOT, commands), warnings=())).to_dict()
    path = commands.save(tmp_path / "trajectory.npz")
    (tmp_path / "validation.json").write_text(json.dumps(data), encoding="utf-8")
    assert len(ready(path).verdict.motors_sha256) == 64
    weaker = replace(load_motor("AX-12A"), motor=replace(load_motor("AX-12A").motor, constant=1.9))
    file.write_text(motor_text(weaker), encoding="utf-8")
    with pytest.raises(SafetyError, match="motors_sha256 is"):
        ready(path)
    file.unlink()
    with pytest.raises(SafetyError, match=r"mine\.toml"):
        ready(path)


def test_verdicts_on_rigid_servos_hold_no_motors(fast):
    assert (
        bound_to(ROBOT, fast, "rigid")["motors_sha256"]
        == bound_to(ROBOT, fast, "springs")["motors_sha256"]
        == ""
    )
    assert bound_to(ROBOT, fast, "table") == bound_to(ROBOT, fast, "AX-12")


def test_motors_with_the_torque_term_hardly_tilt(verdict):
    assert verdict.passed, verdict.reasons
    assert verdict.servo == "table"
    assert verdict.max_tilt_deg < 0.2  # 3.5 mrad
    assert verdict.min_margin_mm > 20.0
    assert verdict.zmp_rms_mm < 2.0


def test_walks_on_motors_start_in_the_posture_of_the_plan(verdict, fast):
    """In that of the commands the soles would stand in the floor, which throws the robot up and turns it."""
    first = verdict.run.foot_force[0].sum(axis=0)
    assert np.abs(verdict.run.q[0] - fast.q[0]).max() < 1e-3
    assert first[2] < 2.0 * 9.81 * ROBOT.mass


def test_the_verdict_says_how_commands_allow_for_the_servos(verdict, fast):
    assert verdict.compensation == "dynamic"
    expected = dict(zip(ROBOT.joint_names, joint_stiffness(ROBOT).tolist(), strict=True))
    assert verdict.joint_stiffness == pytest.approx(expected)
    assert verdict.trajectory_sha256 == fast.sha256


@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_a_stiffness_wrong_by_a_third_is_survived(fast, factor):
    pytest.importorskip("mujoco")
    k = factor * joint_stiffness(ROBOT)[0]
    check = sk.validate(ROBOT, compensate_walk(ROBOT, fast, k, model="dynamic"), "mujoco", servo="table")
    assert not check.fell
    assert check.max_tilt_deg < 1.43  # 25 mrad


def test_commands_are_compensated_once_and_only_for_motors(fast):
    commands = TABLE.commands(ROBOT, fast)
    assert way_of(commands) == "dynamic"
    assert list(stiffness_of(commands).values()) == pytest.approx([40.0] * 18, rel=1e-4)
    assert TABLE.commands(ROBOT, commands) is commands
    assert SimulatedCompliance().commands(ROBOT, fast) is fast


def test_a_verdict_on_motors_outlasts_finer_settings_of_the_solver():
    pytest.importorskip("mujoco")
    walk = sk.walk(ROBOT, sk.load_gait("smooth"), steps=1)
    check = sk.validate(ROBOT, walk, "mujoco", servo="table", check_solver=True)
    assert check.passed, check.reasons
    assert check.solver["mujoco"]["passed"] == {
        "usual": True,
        "half the step": True,
        "twice the iterations": True,
    }


def test_motors_are_checked_against_the_step_that_the_engine_takes(tmp_path):
    """A rotor of 1e-4 kg m^2 swings up by itself at 1 ms, and not at half of it."""
    pytest.importorskip("mujoco")
    model = load_motor("AX-12A")
    file = tmp_path / "light.toml"
    file.write_text(motor_text(replace(model, motor=replace(model.motor, armature=1e-4))), encoding="utf-8")
    light = SimulatedCompliance().on(file)
    with pytest.raises(InputError, match="a step of 1 ms is too long for the servo"):
        opened(ROBOT, "mujoco", light)
    opened(ROBOT, "mujoco", light, finer=Refinement(step=2)).close()


def test_motors_are_not_repeated_under_other_conditions():
    with pytest.raises(InputError, match="only walks on elastic servos are repeated"):
        SimulatedCompliance(repeat=True).on("table")


def test_unknown_models_and_two_kinds_of_servos_are_refused(fast):
    with pytest.raises(UnknownNameError, match="AX-12A"):
        sk.validate(ROBOT, fast, "mujoco", servo="HAL-9000")
    with pytest.raises(InputError, match="choose one"):
        sk.validate(ROBOT, fast, "mujoco", servo="table", compliance=SimulatedCompliance(Compliance(60.0)))
