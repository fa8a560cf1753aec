"""``screwkin bus identify`` on logs of a simulated bench."""

import json
from dataclasses import replace

import numpy as np
import pytest

from screwkin.motors.bench import load_bench_log, replayed_angles
from screwkin.motors.library import load_motor


@pytest.fixture
def logs(tmp_path):
    """Four logs of a servo whose friction is not the published one, at two gains and two masses."""
    servo = load_motor("XL330").motor
    servo = replace(servo, resistance=4.5, friction=replace(servo.friction, coulomb=0.02))
    paths = []
    for i, (gain, mass) in enumerate([(150, 0.2), (600, 0.2), (150, 0.3), (600, 0.3)]):
        path = tmp_path / f"log{i}.json"
        time = np.arange(0.0, 1.0, 0.02)
        rows = [
            {"timestamp": t, "goal_position": g, "position": 0.0}
            for t, g in zip(time.tolist(), np.sin(6 * time).tolist(), strict=True)
        ]
        data = {"mass": mass, "length": 0.1, "kp": gain, "vin": 7.4, "motor": "xl330", "entries": rows}
        path.write_text(json.dumps(data), encoding="utf-8")
        for row, angle in zip(rows, replayed_angles(servo, load_bench_log(path)).tolist(), strict=True):
            row["position"] = angle
        path.write_text(json.dumps(data), encoding="utf-8")
        paths.append(path)
    return paths


def test_half_of_the_logs_is_held_back_and_the_profile_is_a_model(cli, logs, tmp_path):
    called = cli("bus", "identify", *logs, "--friction", "m1", "-o", "out", "--json")
    assert called.code == 0, called.err
    told = called.data
    assert list(told["fitted"]) == ["log0.json", "log3.json"]
    assert list(told["held_back"]) == ["log1.json", "log2.json"]
    assert told["mean_held_back"] < 0.03
    assert load_motor(tmp_path / told["profile"]).motor.gain == load_motor("XL330").motor.gain


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--friction", "m9"], "m9"),
        (["--model", "HAL-9000"], "HAL-9000"),
        (["absent.json"], "absent.json"),
        (["play.npz"], "--bench"),
    ],
)
def test_what_cannot_be_identified_is_refused_once(cli, refused, logs, words, named):
    assert named in refused(cli("bus", "identify", logs[0], *words), 2)
