"""Plays on a bench as logs for identification."""

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError
from screwkin.servo.bench import bench_log_of_play, pendulum_of
from screwkin.servo.log import Log

BENCH = """
[robot]
name = "bench"
description = "a mass on a servo"
source = "a test"
base_link = "stand"
base = "fixed"

[servos]
model = "XL330"
gain = 300

[[link]]
name = "stand"
mass = 1.0
com = [0, 0, 0]
inertia = { xx = 1e-3, yy = 1e-3, zz = 1e-3, xy = 0, xz = 0, yz = 0 }

[[link]]
name = "arm"
mass = 0.5
com = [0.06, 0, -0.08]
inertia = { xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0 }

[[joint]]
name = "shaft"
parent = "stand"
child = "arm"
type = "revolute"
s = [0, 1, 0]
s0 = [0, 0, 0]
lower = -3.0
upper = 3.0
velocity = 6.0
effort = 1.5
"""


def test_a_table_of_one_joint_is_a_pendulum_whose_weight_stands_where_its_mass_does():
    """The mass is 0.1 m from the shaft, turned from straight down by atan(0.06 / 0.08) against its axis."""
    pendulum = pendulum_of(sk.robot_from_text(BENCH))
    assert pendulum.inertia == pytest.approx(0.5 * 0.1**2)
    assert pendulum.weight == pytest.approx(0.5 * 9.81 * 0.1)
    hanging = -pendulum.offset
    x = 0.06 * np.cos(hanging) - 0.08 * np.sin(hanging)
    assert x == pytest.approx(0.0, abs=1e-12)


def test_a_play_is_a_log_of_the_answers_at_their_own_times(tmp_path):
    log = Log(["shaft"], [1])
    for k in range(40):
        log.frame(0.02 * k, 0.02 * k, 0.02 * k, np.array([0.01 * k]))
        if k % 2:
            log.measured(0, {"position": 0.005 * k}, 0.02 * k + 0.003)
    path = log.save(tmp_path / "play.npz", {"robot": "bench"})
    bench = bench_log_of_play(path, sk.robot_from_text(BENCH))
    assert len(bench.time) == 20
    assert bench.time[1] == pytest.approx(0.04)
    assert bench.position[1] == pytest.approx(0.015)
    assert bench.goal[1] == pytest.approx(0.03 + 0.0015)
    assert (bench.model, bench.gain, bench.voltage) == ("XL330", 300, None)


def test_a_walking_robot_is_no_bench():
    with pytest.raises(InputError, match="is no bench"):
        pendulum_of(sk.load_robot("bioloid"))
