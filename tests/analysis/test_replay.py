"""What servos did, from a log: against where the virtual servos truly were; and logs that fit nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from screwkin.analysis.replay import replayed
from screwkin.errors import InputError
from screwkin.files import npz_bytes
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot
from screwkin.servo.bus import Bus
from screwkin.servo.log import PlayLog, load_log
from screwkin.servo.player import Player
from screwkin.servo.servo_map import ServoMap
from screwkin.servo.virtual.bus import SimulatedClock, VirtualBus
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.trajectory import Trajectory

ROBOT = load_robot("bioloid")
TICK = math.radians(300 / 1024)


@cache
def steps() -> Trajectory:
    return walk(ROBOT, load_gait("smooth"), 1)


@cache
def play() -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Arrays of a log; times and true joint angles in the middle of every frame of the walk."""
    clock = SimulatedClock()
    line = VirtualBus(virtual_servos(ROBOT), clock, adapter=1e-3)
    truth: list[np.ndarray] = []
    player = Player(Bus(line, clock=clock), ROBOT, progress=lambda share: truth.append(where(line, clock)))
    player.play(steps())
    meta = {"robot": "bioloid", "trajectory_sha256": steps().sha256}
    found = np.array(truth)
    found[:, 0] -= player._began
    return player.log.arrays(meta), found


def where(line: VirtualBus, clock: SimulatedClock) -> np.ndarray:
    line.advance()
    angles = [
        servo.direction * (line.servo(servo.id).body.angle - servo.zero)
        for servo in ServoMap.of(ROBOT).joints
    ]
    return np.array([clock.now(), *angles])


def record(tmp_path, **change) -> PlayLog:
    arrays = play()[0] | change
    path = tmp_path / "play.npz"
    path.write_bytes(npz_bytes(arrays))
    return load_log(path)


def test_the_replayed_motion_is_where_the_servos_truly_were(tmp_path):
    """Readings are rounded to ticks and some 36 ms apart; the motion between them is found to a tick."""
    log, truth = record(tmp_path), play()[1]
    planned, motion = replayed(ROBOT, steps(), log)
    assert planned is steps()
    there = motion.sampled(truth[:, 0] - log.start)[0]
    assert np.abs(there - truth[:, 1:]).max() < 3 * TICK
    assert np.sqrt(np.mean((there - truth[:, 1:]) ** 2)) < 0.5 * TICK
    assert np.abs(planned.q - motion.q).max() > 20 * TICK, "which is much less than the servos lag behind"
    rates = np.diff(motion.q, axis=0) / 0.02
    assert np.abs(rates - 0.5 * (motion.qd[1:] + motion.qd[:-1])).max() < 0.15, "rates belong to positions"


def test_an_interrupted_log_gives_the_part_that_was_played(tmp_path):
    arrays = play()[0]
    count = int(np.flatnonzero(np.isfinite(arrays["trajectory_time"]))[60])
    short = {
        name: column[:count] for name, column in arrays.items() if column.shape[:1] == arrays["time"].shape
    }
    planned, motion = replayed(ROBOT, steps(), record(tmp_path, **short))
    assert planned.samples == motion.samples == 60
    np.testing.assert_array_equal(planned.zmp, steps().zmp[:60])


def test_a_log_that_ends_before_the_walk_is_told(tmp_path):
    arrays = play()[0]
    short = {name: column[:20] for name, column in arrays.items() if column.shape[:1] == arrays["time"].shape}
    with pytest.raises(InputError, match="ends before the walk begins"):
        replayed(ROBOT, steps(), record(tmp_path, **short))


def test_a_joint_that_was_never_read_is_named(tmp_path):
    position = play()[0]["position"].copy()
    position[:, ROBOT.joint_names.index("left_knee")] = np.nan
    with pytest.raises(InputError, match="0 readings of left_knee"):
        replayed(ROBOT, steps(), record(tmp_path, position=position))


def test_readings_out_of_order_are_told(tmp_path):
    read_at = play()[0]["read_at"][::-1].copy()
    with pytest.raises(InputError, match="do not follow each other in time"):
        replayed(ROBOT, steps(), record(tmp_path, read_at=read_at))


def test_a_log_of_another_trajectory_or_robot_is_told(tmp_path):
    log = record(tmp_path)
    with pytest.raises(InputError, match=r"another trajectory.*unchanged"):
        replayed(ROBOT, replace(steps(), meta={}), log)
    with pytest.raises(InputError, match="the log is of robot bioloid"):
        replayed(load_robot("poppy12"), steps(), log)
    with pytest.raises(InputError, match="the log is of robot None"):
        replayed(ROBOT, steps(), replace(log, meta={}))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: data[: len(data) // 2], "truncated"),
        (lambda data: b"", "not an npz file"),
        (
            lambda data: npz_bytes({"time": np.zeros(3)}),
            "is no log of a play: trajectory_time, command, .* missing",
        ),
        (lambda data: npz_bytes(play()[0] | {"command": np.zeros((3, 2))}), r"command is float64 \(3, 2\)"),
        (lambda data: npz_bytes(play()[0] | {"meta": np.array("[]")}), "JSON object"),
    ],
)
def test_a_file_that_is_no_log_is_told_with_its_name(tmp_path, change, told):
    path = tmp_path / "play.npz"
    path.write_bytes(change(npz_bytes(play()[0])))
    with pytest.raises(InputError, match=told) as caught:
        load_log(path)
    assert str(path) in str(caught.value)


def test_a_log_that_is_not_there_is_told():
    with pytest.raises(InputError, match="cannot be read"):
        load_log("/nowhere/play.npz")
