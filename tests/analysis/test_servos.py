"""Verdicts on real servos: what is played, what is recorded, and what is refused."""

import pytest

import screwkin as sk
from screwkin.analysis.engines import SimulatedCompliance
from screwkin.analysis.readiness import ready
from screwkin.compliance.springs import joint_stiffness
from screwkin.errors import InputError, SafetyError, UnknownNameError
from screwkin.gait.compensation import compensate, stiffness_of, way_of
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
    with pytest.raises(SafetyError, match="compensation is none, the verdict says dynamic"):
        ready(path)


def test_motors_with_the_torque_term_hardly_tilt(verdict):
    assert verdict.passed, verdict.reasons
    assert verdict.servo == "table"
    assert verdict.max_tilt_deg < 0.57  # 10 mrad
    assert verdict.zmp_rms_mm < 6.0


def test_the_verdict_says_how_commands_allow_for_the_servos(verdict, fast):
    assert verdict.compensation == "dynamic"
    expected = dict(zip(ROBOT.joint_names, joint_stiffness(ROBOT).tolist(), strict=True))
    assert verdict.joint_stiffness == pytest.approx(expected)
    assert verdict.trajectory_sha256 == fast.sha256


@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_a_stiffness_wrong_by_a_third_is_survived(fast, factor):
    pytest.importorskip("mujoco")
    k = factor * joint_stiffness(ROBOT)[0]
    check = sk.validate(ROBOT, compensate(ROBOT, fast, k, model="dynamic"), "mujoco", servo="table")
    assert not check.fell
    assert check.max_tilt_deg < 1.43  # 25 mrad


def test_commands_are_compensated_once_and_only_for_motors(fast):
    commands = TABLE.commands(ROBOT, fast)
    assert way_of(commands) == "dynamic"
    assert list(stiffness_of(commands).values()) == pytest.approx([40.0] * 18, rel=1e-4)
    assert TABLE.commands(ROBOT, commands) is commands
    assert SimulatedCompliance().commands(ROBOT, fast) is fast


def test_unknown_models_and_two_kinds_of_servos_are_refused(fast):
    with pytest.raises(UnknownNameError, match="AX-12A"):
        sk.validate(ROBOT, fast, "mujoco", servo="HAL-9000")
    with pytest.raises(InputError, match="choose one"):
        sk.validate(ROBOT, fast, "mujoco", servo="table", compliance=SimulatedCompliance(Compliance(60.0)))
