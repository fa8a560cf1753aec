"""What is measured on a run, against runs made up so that the answer is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.model.robot import Robot
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.measure import landing_leads, landings, slip, speed_use, torque_use, zmp_record
from screwkin.sim.run import Run, simulate
from screwkin.trajectory import Trajectory

LEGS = ("right_foot", "left_foot")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk(robot: Robot) -> Trajectory:
    return sk.walk(robot, sk.load_gait("walk"), steps=2)


@pytest.fixture(scope="module")
def run(robot: Robot, walk: Trajectory) -> Run:
    return simulate(robot, walk, KinematicBackend(robot, dt=0.005))


def pressed(run: Run, zmp: np.ndarray, force: np.ndarray) -> Run:
    """The run with a vertical ground force at given places."""
    zero = np.zeros(len(force))
    wrench = np.stack([zmp[:, 1] * force, -zmp[:, 0] * force, zero, zero, zero, force], axis=1)
    return replace(run, ground_wrench=wrench, ankle_wrench=np.stack([0.5 * wrench, 0.5 * wrench], axis=1))


def planned(run: Run, walk: Trajectory) -> np.ndarray:
    """Planned ZMP at the start of every step."""
    return np.stack([np.interp(run.time - run.dt, walk.time, axis) for axis in walk.zmp.T], axis=1)


def test_forces_where_the_plan_wants_them_give_no_deviation(run: Run, walk: Trajectory) -> None:
    record = zmp_record(pressed(run, planned(run, walk), np.full(len(run.time), 16.7)), walk)
    assert np.allclose(record.contact, record.planned, rtol=0, atol=1e-13)
    assert np.allclose(record.ankle, record.planned, rtol=0, atol=1e-13)
    assert record.time[0] >= 0.0
    assert record.time[-1] <= walk.duration
    assert len(record.time) == pytest.approx(walk.duration / run.dt, abs=2)


def test_a_shift_of_the_forces_is_found_to_the_last_digit(run: Run, walk: Trajectory) -> None:
    shifted = planned(run, walk) + np.array([0.003, -0.002])
    record = zmp_record(pressed(run, shifted, np.full(len(run.time), 16.7)), walk)
    assert np.allclose(record.contact - record.planned, [0.003, -0.002], rtol=0, atol=1e-13)


def test_the_mean_is_weighted_by_force(run: Run, walk: Trajectory) -> None:
    """A step with three times the force counts three times, so a hard knock is not hidden."""
    force = np.where(np.arange(len(run.time)) % 10 == 0, 30.0, 10.0)
    place = np.where(np.arange(len(run.time))[:, None] % 10 == 0, [0.012, 0.0], [0.0, 0.0])
    record = zmp_record(pressed(run, place, force), walk)
    assert np.allclose(record.contact[:, 0], 0.012 * 3 / 12, rtol=0, atol=1e-15)


def test_without_forces_there_is_no_zmp(run: Run, walk: Trajectory) -> None:
    assert np.isnan(zmp_record(run, walk).contact).all()


def test_the_record_ends_at_a_fall(run: Run, walk: Trajectory) -> None:
    fallen = pressed(replace(run, fallen_at=1.0), planned(run, walk), np.full(len(run.time), 16.7))
    assert zmp_record(fallen, walk).time[-1] < 1.0
    assert len(zmp_record(replace(fallen, fallen_at=-0.49), walk).time) == 0


def test_planned_feet_do_not_slip(run: Run, walk: Trajectory, robot: Robot) -> None:
    """The loops are closed at the samples; between them the joints' splines miss the feet by nanometres."""
    measured = slip(run, walk, robot)
    assert measured.largest < 1e-7
    assert measured.turned < 1e-9
    assert measured.total < 1e-7


def test_a_stance_foot_that_drifts_slips_by_the_drift_of_its_middle(
    run: Run, walk: Trajectory, robot: Robot
) -> None:
    """The left foot bears from the start; it creeps forward evenly and turns through the whole walk."""
    T = run.T_world_foot.copy()
    share = np.clip(run.time / walk.duration, 0, 1)
    T[:, 1, 0, 3] += 0.020 * share
    angle = 0.1 * share
    T[:, 1, :2, 0] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    measured = slip(replace(run, T_world_foot=T), walk, robot)
    stance = walk.contact[:, walk.feet.index("left_foot")]
    ends = np.flatnonzero(np.diff(np.concatenate([[0], stance.astype(int), [0]])))
    longest = float(np.max((ends[1::2] - ends[::2]) * 0.02)) / walk.duration
    assert measured.largest == pytest.approx(0.8 * 0.020 * longest, rel=0.05)
    assert measured.turned == pytest.approx(0.8 * 0.1 * longest, rel=0.05)
    assert measured.total == pytest.approx(0.020 * stance.mean(), rel=0.05)


@pytest.mark.parametrize("later", [1.0, -1.0])
def test_steps_that_a_controller_takes_later_or_sooner_do_not_slip(
    run: Run, walk: Trajectory, robot: Robot, later: float
) -> None:
    """Feet stand as planned, but all of it later: by the plan's contact they would slip, by their own not."""
    rows = np.clip(np.arange(len(run.time)) - round(later / run.dt), 0, len(run.time) - 1)
    after = np.minimum(np.searchsorted(walk.time, run.time), walk.samples - 1)
    both = walk.contact & np.roll(walk.contact, 1, axis=0)
    contact = both[after][:, [walk.feet.index(foot) for foot in LEGS]]
    moved = replace(run, T_world_foot=run.T_world_foot[rows])
    assert slip(moved, walk, robot).largest > 0.01
    assert slip(replace(moved, contact=contact[rows]), walk, robot).largest < 1e-7


def test_torque_use_is_the_worst_mean_of_a_window_after_settling(run: Run, robot: Robot) -> None:
    torque = np.zeros((len(run.time), len(robot.joints)))
    torque[run.time < 0, 3] = 9.0
    torque[(run.time > 1.0) & (run.time < 1.0501), 7] = -1.2
    torque[(run.time > 1.0) & (run.time < 1.0251), 8] = 1.5
    use = torque_use(replace(run, torque=torque), robot)
    assert use[3] == 0.0
    assert use[7] == pytest.approx(1.2 / 1.5)
    assert use[8] == pytest.approx(0.5)


def test_speed_use_is_the_planned_peak(walk: Trajectory, robot: Robot) -> None:
    knee = robot.joint_names.index("right_knee")
    assert speed_use(walk, robot)[knee] == pytest.approx(np.abs(walk.qd[:, knee]).max() / 6.0)


@pytest.mark.parametrize("early", [0.06, 0.0, -0.04])
def test_feet_that_touch_early_or_late_are_timed_against_their_planned_landings(
    run: Run, walk: Trajectory, early: float
) -> None:
    """Every foot is loaded while the plan has it standing, and from so much before its landing on."""
    time = run.time - run.dt
    loaded = np.zeros((len(time), 2))
    for i, foot in enumerate(LEGS):
        stands = walk.contact[:, walk.feet.index(foot)]
        loaded[:, i] = np.interp(time + early, walk.time, stands.astype(float)) > 1 - 1e-6
    force = np.zeros((len(time), 2, 3))
    force[..., 2] = 10.0 * loaded
    leads = landing_leads(replace(run, foot_force=force), walk, LEGS)
    assert len(leads) == len(landings(walk)) > 1
    np.testing.assert_allclose(leads, early, atol=run.dt + 1e-9)
    at = np.searchsorted(walk.time, landings(walk))
    assert (walk.contact[at].sum(axis=1) > walk.contact[at - 1].sum(axis=1)).all()


def test_no_foot_lands_that_touches_nothing_or_fell_before(run: Run, walk: Trajectory) -> None:
    nothing = replace(run, foot_force=np.zeros((len(run.time), 2, 3)))
    assert landing_leads(nothing, walk, LEGS).size == 0
    touching = replace(run, foot_force=np.ones((len(run.time), 2, 3)), fallen_at=float(walk.time[3]))
    assert landing_leads(touching, walk, LEGS).size == 0
