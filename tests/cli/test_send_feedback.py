"""``send --feedback``: what lets a walk be walked so, what stops it, and a play on the virtual bus."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import Y, as_array, rotate
from screwkin.analysis.engines import simulated_on
from screwkin.analysis.verdict import Verdict, verdict_from_json
from screwkin.campaign import feedback_bound as bounding
from screwkin.campaign.feedback_bound import BOUND, FARTHEST, WORLDS, FeedbackBound, bound_faults
from screwkin.campaign.governor import OLDEST, SLACK, FeedbackGovernor
from screwkin.cli import run
from screwkin.model.robot import Robot
from screwkin.servo.imu import ImuReading
from screwkin.servo.log import load_log
from screwkin.servo.watch import PlayStopped
from screwkin.sim.feedback import WalkController
from screwkin.stabiliser.law import Gains
from screwkin.stabiliser.walk import StabilisedWalk, stabilised
from screwkin.trajectory import load_trajectory
from tests.cli.conftest import told_once
from tests.verdicts import passing

IMU = ("--feedback", "imu:virtual", "--rate", "100")
QUICK = ["Tc=0.5", "stride=0.05", "lift=0.012", "lead=0.6", "horizon=1"]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk of two steps with its verdict on the table's servos; read it only."""
    folder = tmp_path_factory.mktemp("quick")
    words = ["walk", "bioloid", "--gait", "preview", "--steps", "2", "--rate", "100", "--no-plots"]
    assert (
        run([*words, *(word for text in QUICK for word in ("--set", text)), "-o", str(folder), "--json"]) == 0
    )
    passing(folder / "trajectory.npz", "table")
    return folder


@pytest.fixture(scope="module")
def walk(quick: Path, robot: Robot) -> StabilisedWalk:
    return stabilised(robot, load_trajectory(quick / "trajectory.npz"))


def verdict(folder: Path) -> Verdict:
    return verdict_from_json((folder / "validation.json").read_text())


def allowing(folder: Path, robot: Robot, **changed: object) -> FeedbackBound:
    """The record of a campaign in which nothing went wrong."""
    beside = verdict(folder)
    usual = FeedbackBound(
        trajectory_sha256=beside.trajectory_sha256,
        robot_sha256=beside.robot_sha256,
        servo=beside.servo,
        motors_sha256=beside.motors_sha256,
        engine="mujoco",
        worlds=WORLDS,
        seeds=tuple(range(20)),
        falls=0,
        deviation=dict.fromkeys(robot.joint_names, 0.3),
        gains=json.loads(json.dumps(asdict(Gains()))),
        versions={},
    )
    return replace(usual, **changed)


@pytest.fixture
def sent(quick: Path, tmp_path: Path, robot: Robot) -> Path:
    """A copy of that walk that a campaign lets be walked with feedback."""
    folder = tmp_path / "sent"
    folder.mkdir()
    for file in quick.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    (folder / BOUND).write_text(allowing(quick, robot).to_json())
    return folder / "trajectory.npz"


# ---- What lets a walk be walked so


def test_without_a_campaign_it_is_refused(cli, quick):
    message = told_once(cli("send", quick / "trajectory.npz", *IMU), 4)
    assert "never walked with feedback" in message
    assert "--feedback --runs 20" in message


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"trajectory_sha256": "0" * 64}, "the trajectory changed"),
        ({"robot_sha256": "0" * 64}, "the robot's table changed"),
        ({"servo": "rigid"}, "the servos changed"),
        ({"motors_sha256": ""}, "the servos' figures changed"),
        ({"gains": {}}, "the gains changed"),
        ({"seeds": tuple(range(19))}, "19 runs, at least 20"),
        ({"seeds": (1,) * 40}, "1 runs"),
        ({"falls": 1}, "1 of 20 runs fell"),
        ({"engine": "kinematic"}, "simulates no falls"),
        ({"deviation": {"right_knee": 0.1}}, "the joints changed"),
    ],
)
def test_a_record_of_something_else_speaks_against_it(
    quick: Path, robot: Robot, changed: dict[str, object], words: str
) -> None:
    assert bound_faults(allowing(quick, robot), robot, verdict(quick)) == []
    faults = bound_faults(allowing(quick, robot, **changed), robot, verdict(quick))
    assert len(faults) == 1
    assert words in faults[0]


@given(far=st.floats(FARTHEST, 1e6, exclude_min=True))
def test_no_campaign_lets_a_joint_come_anywhere(quick: Path, robot: Robot, far: float) -> None:
    wide = {**dict.fromkeys(robot.joint_names, 0.1), "left_knee": far}
    assert "a joint came" in bound_faults(allowing(quick, robot, deviation=wide), robot, verdict(quick))[0]


@pytest.mark.parametrize("text", ["", "{", "[]", '{"falls": 0}', '{"falls": NaN}'])
def test_a_damaged_record_is_refused_by_name(cli, sent, text):
    (sent.parent / BOUND).write_text(text)
    assert BOUND in told_once(cli("send", sent, *IMU), 4)


def test_options_that_do_not_fit_are_said(cli, sent):
    assert "write imu:PORT" in told_once(cli("send", sent, "--feedback", "gyro"), 2)
    real = cli("send", sent, "--feedback", "imu:virtual", "--port", "/dev/none")
    assert "imu:/dev/ttyUSB1" in told_once(real, 2)
    assert "imu:virtual" in told_once(cli("send", sent, "--feedback", "imu:/dev/x", "--virtual"), 2)
    slow = cli("send", sent, "--feedback", "imu:virtual")
    assert "goes at 100 frames per second" in told_once(slow, 2)
    assert "--runs walks with --feedback" in told_once(cli("validate", sent, "--runs", "3"), 2)
    assert "at least 1" in told_once(cli("validate", sent, "--feedback", "--runs", "-1"), 2)


def test_a_campaign_takes_the_farthest_of_runs_that_stood(
    quick: Path, robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three runs of which the middle one fell: what it did says nothing."""
    runs = iter([(False, 0.1), (True, 0.9), (False, 0.2)])
    worlds = []

    def walked(*_: object, perturbation, servo, feedback):
        assert feedback
        worlds.append(perturbation)
        fell, far = next(runs)
        came = {"deviation": dict.fromkeys(robot.joint_names, far)}
        return SimpleNamespace(servo=servo, fell=fell, engine_settings={"mujoco": {"feedback": came}})

    monkeypatch.setattr(bounding, "validate", walked)
    plan = load_trajectory(quick / "trajectory.npz")
    bound = bounding.feedback_bound(robot, plan, (4, 5, 6), "mujoco", "table")
    assert (bound.falls, bound.seeds, max(bound.deviation.values())) == (1, (4, 5, 6), 0.2)
    assert [world.seed for world in worlds] == [4, 5, 6]
    assert bound_faults(bound, robot, verdict(quick)) == ["3 runs, at least 20", "1 of 3 runs fell"]


# ---- What stops it


class FakeImu:
    """Says a turn, at a time."""

    def __init__(self) -> None:
        self.turn, self.time, self.lost = np.eye(3), 0.0, False

    def poll(self) -> ImuReading | None:
        if self.lost:
            raise OSError("gone")
        return None if self.turn is None else ImuReading(0, self.turn, self.time)


def governed(walk: StabilisedWalk, bound: float = 0.3) -> tuple[FeedbackGovernor, FakeImu, WalkController]:
    controller, imu = WalkController(walk), FakeImu()
    names = walk.body.robot.joint_names
    allowed = SimpleNamespace(deviation=dict.fromkeys(names, bound))
    return FeedbackGovernor(controller, imu, lambda: 0.0, allowed, names), imu, controller


def stopped(governor: FeedbackGovernor, q: np.ndarray) -> str:
    with pytest.raises(PlayStopped) as error:
        governor.goals(q, 1.0)
    assert error.value.fault.kind == "feedback"
    return error.value.fault.message


def test_no_imu_a_stale_one_a_lost_one_and_a_leaning_one_stop_it(walk: StabilisedWalk) -> None:
    q = walk.start.q
    for change, words in (
        ({"turn": None}, "has said nothing"),
        ({"time": -1.01 * OLDEST}, "nothing for 0.0"),
        ({"lost": True}, "port is gone"),
        ({"turn": as_array(rotate(Y, 0.2))}, "leans by 0.20 rad"),
    ):
        governor, imu, _ = governed(walk)
        vars(imu).update(change)
        assert words in stopped(governor, q)
    governor, _, _ = governed(walk)
    assert "never read" in stopped(governor, np.full(18, np.nan))


def test_a_joint_that_leaves_its_bound_stops_it_before_its_goal_is_sent(walk: StabilisedWalk) -> None:
    """A robot tilted ever more: goals stay within the bound to the last one; then it says which joint."""
    governor, imu, controller = governed(walk, 0.2)
    message, q = "", walk.start.q
    for k in range(len(walk.q)):
        imu.turn = as_array(rotate(Y, 0.002 * k))
        try:
            q = governor.goals(q, 0.01 * k)
        except PlayStopped as error:
            message = error.fault.message
            break
        far = np.abs(controller.course.q - walk.q[walk.phase(controller.course)])
        assert far.max() <= 0.21 + 1e-12
    assert "from its plan, allowed 0.210" in message


def test_a_robot_that_follows_walks_to_its_end(walk: StabilisedWalk) -> None:
    governor, _, controller = governed(walk, 0.5)
    q, count = walk.start.q, 0
    while not governor.done:
        q = governor.goals(q, 0.01 * count)
        count += 1
    assert count == pytest.approx(len(walk.q), rel=0.05)
    assert controller.course.landed == len(walk.steps)


# ---- On the virtual bus


def test_virtual_servos_walk_by_a_virtual_imu(cli, sent):
    """To its end, its goals beside the plan's commands within the bound; a dry run says the bound."""
    dry = cli("send", sent, *IMU, "--json").data
    assert dry["feedback"] == "virtual"
    assert dry["feedback_bound_rad"] == 0.3
    assert dry["moved"] is False
    played = cli("send", sent, *IMU, "--virtual", "--go", "-o", "play", "--json")
    assert played.code == 0, played.err
    assert played.data["faults"] == []
    log, plan = load_log(Path("play", "play.npz")), load_trajectory(sent)
    during = np.isfinite(log.trajectory_time)
    time, sent_q = log.trajectory_time[during], log.command[during]
    assert time.max() == pytest.approx(plan.duration, abs=0.011)
    assert (np.diff(time) > -0.011).all()
    commands = simulated_on("table").commands(sk.load_robot("bioloid"), plan)
    columns = [plan.joint_names.index(name) for name in log.joint_names]
    far = np.abs(sent_q - commands.sampled(plan.time[0] + time)[0][:, columns]).max()
    assert 1e-3 < far < 0.3 + SLACK + 0.05  # allowed for servos at phases that are a cycle apart


def test_a_bound_that_is_too_narrow_stops_the_play(cli, sent, robot):
    narrow = allowing(sent.parent, robot, deviation=dict.fromkeys(robot.joint_names, 0.001))
    (sent.parent / BOUND).write_text(narrow.to_json())
    played = cli("send", sent, *IMU, "--virtual", "--go", "-o", "play")
    assert played.code == 4
    assert "feedback fault" in played.err
    assert "hold their positions" in played.err
