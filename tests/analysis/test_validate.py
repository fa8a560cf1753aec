"""Good walks pass, bad ones fail for the reasons that they have."""

from __future__ import annotations

import copy
import json
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.validate import Validation, judged, validate
from screwkin.analysis.verdict import Criteria
from screwkin.errors import InputError, UnknownNameError
from screwkin.files import text_sha256
from screwkin.model.robot import Robot, robot_text
from screwkin.sim.camera import Camera
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.run import Run, simulate
from screwkin.trajectory import Trajectory

FIELDS = {
    *(
        "passed",
        "reasons",
        "fell",
        "distance",
        "planned_distance",
        "end_error_mm",
        "zmp_rms_mm",
        "zmp_max_mm",
    ),
    *("min_margin_mm", "slip_mm", "trajectory_sha256", "engine"),
}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


def planned(robot: Robot, steps: int = 2, **settings: Any) -> Trajectory:
    return sk.walk(robot, sk.load_gait("walk").replace(**settings), steps=steps)


@pytest.fixture(scope="module")
def walk(robot: Robot) -> Trajectory:
    return planned(robot, Tc=0.8)


@pytest.fixture(scope="module")
def perfect(robot: Robot, walk: Trajectory) -> Run:
    """The plan carried out to the letter, in the name of an engine with forces."""
    return pressing(robot, simulate(robot, walk, KinematicBackend(robot, dt=0.01)), walk)


def pressing(robot: Robot, run: Run, walk: Trajectory) -> Run:
    """A run of perfect tracking as if of an engine with forces: the robot's weight at the planned ZMP."""
    x, y = (np.interp(run.time - run.dt, walk.time, axis) for axis in walk.zmp.T)
    weight, none = np.full_like(x, 9.81 * float(robot.mass)), np.zeros_like(x)
    wrench = np.stack([y * weight, -x * weight, none, none, none, weight], axis=1)
    return replace(run, engine="pybullet", ground_wrench=wrench)


@pytest.fixture(scope="module")
def check(robot: Robot, walk: Trajectory) -> Validation:
    pytest.importorskip("pybullet")
    return validate(robot, walk, servo="rigid", camera=Camera(pictures=3, width=80, height=60))


def test_a_walk_passes_and_contacts_agree_with_the_plan(check: Validation) -> None:
    assert check.passed
    assert check.reasons == ()
    assert not check.fell
    assert check.end_error_mm < 2.0
    assert check.slip_mm < 1.0
    assert check.zmp_rms_xy_mm is not None
    assert check.zmp_max_xy_mm is not None
    assert max(check.zmp_rms_xy_mm) == check.zmp_rms_mm <= 1.0
    assert max(check.zmp_max_xy_mm) == check.zmp_max_mm <= 5.0


def test_ankle_sensors_tell_the_same_zmp_as_the_contacts(check: Validation) -> None:
    """They leave out only the momentum of the feet's own 32 g."""
    assert check.ankle_rms_xy_mm is not None
    assert 0.0 < max(check.ankle_rms_xy_mm) < 0.4


def test_the_contacts_follow_the_multibody_zmp_and_not_the_centre_of_mass(
    check: Validation, walk: Trajectory
) -> None:
    """Were the comparison blind, the ground projection of the CoM would fit as well."""
    com = np.stack([np.interp(check.zmp.time, walk.time, walk.com[:, i]) for i in (0, 1)], axis=1)
    wrong = 1e3 * np.sqrt(np.mean((check.zmp.contact - com) ** 2, axis=0))
    assert wrong.min() > 5.0


def test_the_verdict_is_json_with_the_fields_of_the_contract(check: Validation, walk: Trajectory) -> None:
    data = json.loads(json.dumps(check.to_dict(), allow_nan=False))
    assert set(data) >= FIELDS
    assert data["trajectory_sha256"] == walk.sha256
    assert data["engine"] == "pybullet+mujoco"
    assert set(data["engines"]) == set(data["engine_settings"]) == {"pybullet", "mujoco"}
    assert data["planned_distance"] == pytest.approx(walk.T_world_base[-1, 0, 3] - walk.T_world_base[0, 0, 3])
    assert data["distance"] == pytest.approx(data["planned_distance"], abs=1e-3)
    assert data["min_margin_mm"] == pytest.approx(1e3 * walk.margin.min())
    assert set(data["torque_use"]) == set(walk.joint_names)
    assert 0.2 < max(data["torque_use"].values()) < 1.0


def test_pictures_are_taken_when_a_camera_is_given(check: Validation) -> None:
    assert [picture.shape for picture in check.pictures] == [(60, 80, 3)] * 3
    assert not np.array_equal(check.pictures[0], check.pictures[2])


def test_servos_that_would_have_to_be_faster_are_a_warning_and_no_reason(check: Validation) -> None:
    assert check.speed_use["right_knee"] > 1.0
    assert "right_knee" in check.warnings[0]
    assert "6.0 rad/s" in check.warnings[0]


def test_a_hurried_walk_falls_with_all_its_reasons(robot: Robot) -> None:
    pytest.importorskip("mujoco")
    check = validate(robot, planned(robot, steps=4, Tc=0.5), engine="mujoco", servo="rigid")
    assert not check.passed
    assert check.fell
    assert check.fell_at is not None
    assert check.zmp.time[-1] < check.fell_at
    text = "\n".join(check.reasons)
    for reason in ("fell at", "end error", "planned ZMP leaves the support polygon"):
        assert reason in text


def test_weak_servos_do_not_carry_the_robot(robot: Robot, walk: Trajectory) -> None:
    pytest.importorskip("mujoco")
    weak = replace(robot, joints=tuple(replace(joint, effort=0.3) for joint in robot.joints))
    check = validate(weak, walk, engine="mujoco", servo="rigid")
    assert check.fell
    assert any("torque at the servo's limit for 50 ms" in reason for reason in check.reasons)


def test_the_kinematic_engine_tracks_exactly_but_confirms_nothing(robot: Robot, walk: Trajectory) -> None:
    check = validate(robot, walk, engine="kinematic")
    assert not check.passed
    assert check.reasons[0] == "engine kinematic simulates no forces and confirms nothing; use mujoco"
    assert check.end_error_mm < 1e-9
    assert check.zmp_rms_mm is None
    assert check.zmp_max_mm is None


def verdict(robot: Robot, walk: Trajectory, run: Run) -> tuple[str, ...]:
    return judged(robot, walk, run, Criteria()).reasons


def test_the_plan_itself_gives_no_reason(robot: Robot, walk: Trajectory, perfect: Run) -> None:
    assert verdict(robot, walk, perfect) == ()


@pytest.mark.parametrize(("off", "fails"), [(0.0099, False), (0.0101, True)])
def test_the_end_may_be_10_mm_off(
    robot: Robot, walk: Trajectory, perfect: Run, off: float, fails: bool
) -> None:
    T = perfect.T_world_base.copy()
    T[-1, 1, 3] += off
    reasons = verdict(robot, walk, replace(perfect, T_world_base=T))
    assert any(reason.startswith("end error") for reason in reasons) is fails


def test_on_a_long_way_the_end_may_be_5_percent_off(robot: Robot) -> None:
    """Six steps of 0.1 m: 30 mm are allowed."""
    long = planned(robot, steps=6, Tc=0.8)
    run = pressing(robot, simulate(robot, long, KinematicBackend(robot, dt=0.01)), long)
    T = run.T_world_base.copy()
    T[-1, 0, 3] += 0.029
    assert verdict(robot, long, replace(run, T_world_base=T)) == ()
    T[-1, 0, 3] += 0.002
    assert "allowed 30.0 mm" in verdict(robot, long, replace(run, T_world_base=T))[0]


def test_a_margin_that_only_the_file_claims_does_not_count(robot: Robot) -> None:
    tipping = planned(robot, sway=0.0)
    run = pressing(robot, simulate(robot, tipping, KinematicBackend(robot, dt=0.01)), tipping)
    claimed = replace(tipping, margin=np.ones(tipping.samples))
    assert verdict(robot, claimed, run) == verdict(robot, tipping, run)
    assert "planned ZMP leaves the support polygon" in verdict(robot, claimed, run)[0]


@pytest.mark.parametrize(("creep", "fails"), [(0.009, False), (0.011, True)])
def test_a_stance_foot_may_slip_10_mm(
    robot: Robot, walk: Trajectory, perfect: Run, creep: float, fails: bool
) -> None:
    T = perfect.T_world_foot.copy()
    T[perfect.time > 0.5, 1, 1, 3] += creep
    reasons = verdict(robot, walk, replace(perfect, T_world_foot=T))
    assert any("slips" in reason for reason in reasons) is fails


def test_a_plan_whose_zmp_leaves_the_soles_fails_even_if_it_stands(
    robot: Robot, walk: Trajectory, perfect: Run
) -> None:
    margin = walk.margin.copy()
    margin[100] = -0.0012
    assert verdict(robot, replace(walk, margin=margin), perfect) == (
        "planned ZMP leaves the support polygon by 1.2 mm",
    )


SERIES = ("T_world_base", "q", "qd", "torque", "T_world_foot", "ground_wrench", "foot_force")


@pytest.mark.parametrize("name", SERIES)
def test_what_the_simulation_did_not_measure_fails_by_name(
    robot: Robot, walk: Trajectory, perfect: Run, name: str
) -> None:
    series = np.array(getattr(perfect, name))
    series[100] = np.nan
    assert (
        f"no number for {name} at {perfect.time[100]:.2f} s"
        in verdict(robot, walk, replace(perfect, **{name: series}))[0]
    )


def test_a_run_without_ground_forces_fails(robot: Robot, walk: Trajectory, perfect: Run) -> None:
    nothing = replace(perfect, ground_wrench=np.zeros_like(perfect.ground_wrench))
    assert "no ZMP was measured: nothing pressed on the floor" in verdict(robot, walk, nothing)


def test_an_edited_robot_is_judged_as_edited_and_recorded_so(
    robot: Robot, walk: Trajectory, perfect: Run
) -> None:
    assert judged(robot, walk, perfect, Criteria()).robot_sha256 == walk.meta["robot"]["sha256"]
    heavy = replace(robot, links=tuple(replace(link, mass=1.1 * link.mass) for link in robot.links))
    check = judged(heavy, walk, perfect, Criteria())
    assert check.robot_sha256 == text_sha256(robot_text(heavy)) != walk.meta["robot"]["sha256"]
    assert "judged with another table" in check.warnings[0]


def test_walks_of_edited_robots_record_the_edited_table(robot: Robot) -> None:
    gait = sk.load_gait("walk")
    torso = robot.links[0]
    for edited in (
        robot.replace(masses={torso.name: 2 * torso.mass}),
        replace(robot, links=(replace(torso, mass=2 * torso.mass), *robot.links[1:])),
    ):
        recorded = sk.walk(edited, gait, steps=1).meta["robot"]
        assert sk.robot_from_text(recorded["table"]).links[0].mass == pytest.approx(2 * torso.mass)
        assert recorded["path"] == ""


def test_unknown_engines_and_foreign_trajectories_are_refused(robot: Robot, walk: Trajectory) -> None:
    with pytest.raises(
        UnknownNameError, match=r"unknown engine 'gazebo'; valid: auto, pybullet, mujoco, kinematic"
    ):
        validate(robot, walk, engine="gazebo")  # type: ignore[arg-type]
    names = ("head", *walk.joint_names[1:])
    with pytest.raises(InputError, match=r"joints are not those of bioloid: .* the foreign head"):
        validate(robot, replace(walk, joint_names=names), engine="kinematic")
    one = replace(walk, feet=("right_foot",), contact=walk.contact[:, :1])
    with pytest.raises(InputError, match="no contact of left_foot"):
        validate(robot, one, engine="kinematic")


@pytest.mark.slow
@pytest.mark.parametrize("Tc", [0.8, 1.0, 1.5, 2.0])
def test_eight_steps_pass_at_every_pace(robot: Robot, Tc: float) -> None:
    check = validate(robot, planned(robot, steps=8, Tc=Tc), servo="rigid")
    assert check.passed
    assert check.end_error_mm < 2.0
    assert check.zmp_rms_mm is not None
    assert check.zmp_max_mm is not None
    assert check.zmp_rms_mm <= 1.0
    assert check.zmp_max_mm <= 5.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gait", "settings"), [("walk", {"Tc": 0.5}), ("paper", {"Tc": 0.5}), ("walk", {"sway": 0.0})]
)
def test_what_cannot_balance_falls(robot: Robot, gait: str, settings: dict[str, float]) -> None:
    check = validate(robot, sk.walk(robot, sk.load_gait(gait).replace(**settings), steps=8), servo="rigid")
    assert check.fell
    assert not check.passed


def test_a_verdict_survives_pickles_and_copies(check: Validation) -> None:
    for other in (pickle.loads(pickle.dumps(check)), copy.deepcopy(check)):  # noqa: S301
        assert other.to_dict() == check.to_dict()
        np.testing.assert_array_equal(other.run.q, check.run.q)
