"""Verdicts on real servos: what is played, what is recorded, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.engines import Refinement, SimulatedCompliance, opened, servo_for
from screwkin.analysis.readiness import ready
from screwkin.analysis.replay import replayed
from screwkin.analysis.validate import planned_facts
from screwkin.analysis.verdict import bound_to, verdict_of
from screwkin.cli.playing import played
from screwkin.cli.send import virtual_bus
from screwkin.compliance.springs import joint_stiffness
from screwkin.errors import InputError, SafetyError, UnknownNameError
from screwkin.gait.compensation import compensate_walk, stiffness_of, way_of
from screwkin.motors.library import load_motor, motor_text
from screwkin.servo.log import load_log
from screwkin.servo.player import PlaySettings
from screwkin.sim.compliant import Compliance
from tests.verdicts import passing, passing_data

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


def test_send_plays_the_commands_that_the_simulated_servos_were_sent(verdict, fast, tmp_path):
    path = fast.save(tmp_path / "trajectory.npz")
    data = verdict_of(ROBOT, fast, verdict).to_dict()
    (tmp_path / "validation.json").write_text(json.dumps(data), encoding="utf-8")
    may = ready(path)
    assert np.array_equal(may.commands.q, TABLE.commands(ROBOT, fast).q)
    assert np.array_equal(may.frames.q, may.commands.sampled(may.commands.time[0] + may.frames.time)[0])
    assert np.abs(may.commands.q - fast.q).max() > 0.01, "commands that are seen to allow for torques"
    assert may.deviation == pytest.approx(ready(passing(path)).deviation, rel=0.2), "of what is reached"


@pytest.mark.parametrize(
    "changed",
    [
        {"compensation": "none"},
        {"joint_stiffness": None},
        {"joint_stiffness": dict.fromkeys(ROBOT.joint_names, 60.0)},
        {"servo": "rigid"},
        {"servo": "MX-28"},
        {"servo": "springs"},
    ],
    ids=str,
)
def test_commands_other_than_the_verdicts_are_refused(fast, tmp_path, changed):
    path = passing(fast.save(tmp_path / "trajectory.npz"), **{"servo": "table", **changed})
    if "servo" in changed:  # a verdict on the table's servos, whose name of them is another one
        data = passing_data(path, "table") | changed
        (tmp_path / "validation.json").write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(SafetyError, match="is not what was validated"):
        ready(path)


def test_without_a_word_servos_are_the_tables_where_commands_can_allow_for_them(fast):
    assert servo_for("auto", ROBOT, fast) == "table"
    assert servo_for("rigid", ROBOT, fast) == "rigid"
    assert servo_for("auto", ROBOT, fast, "kinematic") == "rigid"
    assert servo_for("auto", ROBOT, fast, compliance=SimulatedCompliance(Compliance(60.0))) == "rigid"
    assert servo_for("auto", replace(ROBOT, servos={}), fast) == "rigid"
    looped = sk.load_robot("linkages/knee-parallelogram")
    assert servo_for("auto", looped, fast) == "rigid", "loops share torques"
    assert servo_for("auto", ROBOT, replace(fast, feet=fast.feet[:1], contact=fast.contact[:, :1])) == "rigid"


def test_virtual_servos_that_are_loaded_by_the_plan_stand_where_it_is(tmp_path):
    """Each bends under its torque, and commands undo it: what is left is lag in motion, a tick at rest."""
    walk = sk.walk(ROBOT, sk.load_gait("smooth"), steps=1)
    may = ready(passing(walk.save(tmp_path / "trajectory.npz"), servo="table"))
    bus, guard, follow = virtual_bus(may)
    played(bus, may, PlaySettings(), tmp_path / "play.npz", {}, guard, follow)
    log = load_log(tmp_path / "play.npz")
    planned, motion = replayed(ROBOT, walk, log)
    off, late = np.abs(motion.q - planned.q).max(axis=0), 0.04 * np.abs(planned.qd).max(axis=0)
    assert (off < late + 0.006).all()
    at_rest = log.time > log.time[np.isfinite(log.trajectory_time)][-1] + 0.25
    stood = np.nanmean(log.position[at_rest], axis=0)
    assert np.abs(stood - walk.q[-1]).max() < 0.006
    assert np.abs(may.commands.q[-1] - walk.q[-1]).max() > 0.01, "seen in the readings, were it not undone"


def test_a_servo_file_that_changed_since_is_refused(verdict, fast, tmp_path):
    """The robot's table holds the name of such a file, not its figures; the verdict holds their hash."""
    file = tmp_path / "mine.toml"
    file.write_text(motor_text(load_motor("AX-12A")), encoding="utf-8")
    commands = compensate_walk(ROBOT, fast, model="dynamic")
    own = replace(verdict, servo=str(file))
    data = verdict_of(
        ROBOT, commands, replace(own, **planned_facts(ROBOT, commands), compensation="dynamic")
    ).to_dict()
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
