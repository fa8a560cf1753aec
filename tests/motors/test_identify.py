"""Identification: known figures are recovered from simulated benches; records of real servos are replayed."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from screwkin.errors import InputError, UnknownNameError
from screwkin.motors.bench import BenchLog, load_bench_log, position_error, replayed_angles
from screwkin.motors.identify import identify
from screwkin.motors.library import load_motor
from screwkin.motors.pendulum import Pendulum
from screwkin.motors.records import Friction

TRUE = replace(
    load_motor("XL330").motor,
    constant=0.33,
    resistance=3.9,
    armature=0.0025,
    lag=0.008,
    friction=Friction(coulomb=0.012, viscous=0.003, load_motor=0.15, load_external=0.15),
)
REAL = os.environ.get("SCREWKIN_SERVO_LOGS", "")


def bench_log(name: str, gain: float, mass: float, seconds: float = 2.0) -> BenchLog:
    """What the bench would show of a servo with the true figures."""
    time = np.arange(0.0, seconds, 0.01)
    goal = 0.9 * np.sin(4.0 * time) + 0.4 * np.sin(11.0 * time)
    log = BenchLog(name, "XL330", time, goal, 0.0 * goal, gain, 7.4, Pendulum.of_mass(mass, 0.1))
    return replace(log, position=replayed_angles(TRUE, log))


def test_a_log_made_from_known_figures_is_replayed_by_them_and_by_no_others():
    log = bench_log("a", 300.0, 0.3)
    assert position_error(TRUE, log) == 0.0
    assert position_error(load_motor("XL330").motor, log) > 0.01


def test_fitted_figures_replay_logs_at_other_gains_and_masses():
    """The published figures are the start; the true ones are 15 to 30 % away."""
    logs = [bench_log("a", 150.0, 0.2), bench_log("b", 600.0, 0.3)]
    held = [bench_log("c", 300.0, 0.25)]
    found = identify(load_motor("XL330"), logs, held, "m3")
    assert found.held_back["c"] < 0.004 < position_error(load_motor("XL330").motor, held[0])
    motor = found.model.motor
    assert motor.constant / motor.resistance == pytest.approx(TRUE.constant / TRUE.resistance, rel=0.05)
    assert motor.gain == TRUE.gain
    assert found.model.identified


def test_nothing_to_fit_and_unknown_frictions_are_refused():
    with pytest.raises(InputError, match="at least one log"):
        identify(load_motor("XL330"), [])
    with pytest.raises(UnknownNameError, match="m6"):
        identify(load_motor("XL330"), [bench_log("a", 300.0, 0.3)], friction="m7")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"mass": float("nan")}, "mass"),
        ({"length": -0.1}, "above 0"),
        ({"vin": None}, "vin"),
        ({"entries": 3}, "no log of a bench"),
        ({"entries": []}, "0 entries"),
        ({"entries": [{"timestamp": 0.0, "goal_position": 0.0, "position": 0.0}] * 2}, "increase"),
        ({"entries": [{"timestamp": 0.0, "goal_position": 0.0}] * 2}, "position"),
        (
            {"entries": [{"timestamp": 0, "goal_position": 0, "position": 0, "torque_enable": False}] * 2},
            "torque",
        ),
    ],
)
def test_damaged_logs_are_refused_by_what_is_wrong(change, word, tmp_path):
    rows = [{"timestamp": t, "goal_position": 0.1, "position": 0.0} for t in (0.0, 0.1)]
    data = {"mass": 0.5, "length": 0.1, "kp": 100, "vin": 7.4, "motor": "xl330", "entries": rows}
    path = tmp_path / "log.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    assert load_bench_log(path).time.tolist() == [0.0, 0.1]
    path.write_text(json.dumps({**data, **change}), encoding="utf-8")
    with pytest.raises(InputError, match=word):
        load_bench_log(path)


@pytest.mark.slow
@pytest.mark.skipif(not REAL, reason="SCREWKIN_SERVO_LOGS names no folder of bench logs")
def test_half_of_the_real_logs_fits_the_other_half_from_its_goals_alone():
    """XL330 at gains 100 to 800 by one set of figures; logs: the source of the model's figures."""
    logs = [load_bench_log(path) for path in sorted(Path(REAL).glob("xl330-*.json"))]
    fitted, held = logs[0::4] + logs[3::4], logs[1::4] + logs[2::4]
    found = identify(load_motor("XL330"), fitted, held)
    assert np.mean(list(found.held_back.values())) <= 0.07
