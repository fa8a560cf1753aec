"""Footsteps to goals and along curves: they arrive, within the robot's limits, and soles stay apart."""

from __future__ import annotations

import json
import math
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.cli import run
from screwkin.errors import GaitError, InputError
from screwkin.gait.goals import load_curve, step_limits
from screwkin.gait.listed import Footsteps
from screwkin.gait.motion import Motion
from screwkin.gait.soles import outlines, sole_distance
from screwkin.gait.stance import LEFT, RIGHT, stance_of
from screwkin.gait.stepping import StepLimits

ROBOT = sk.load_robot("bioloid")
GAIT = sk.load_gait("auto").replace(bend=0.88, period=6)
STANCE = stance_of(ROBOT)


@cache
def limits() -> StepLimits:
    return step_limits(ROBOT, GAIT)


def middles(steps: Footsteps) -> np.ndarray:
    """Where the middle between the feet is when each step ends, as at home on the foot that stepped."""
    sides = [(RIGHT if steps.first == "right" else LEFT) * (-1) ** k for k in range(len(steps))]
    return np.array(
        [
            (p.x + math.sin(p.yaw) * s * STANCE.foot_y, p.y - math.cos(p.yaw) * s * STANCE.foot_y, p.yaw)
            for p, s in zip(steps.places, sides, strict=True)
        ]
    )


def checked(steps: Footsteps) -> np.ndarray:
    """The middles; every step is within limits, soles lie apart, the feet end side by side."""
    at, own = np.vstack([np.zeros(3), middles(steps)]), limits()
    for a, b in pairwise(at):
        assert own.shares(np.array([a, b]))[1] <= 1.0 + 1e-6
    np.testing.assert_allclose(at[-1], at[-2], atol=1e-9)
    feet = [(0.0, s * STANCE.foot_y, 0.0) for s in ((-1, 1) if steps.first == "right" else (1, -1))]
    feet += [(p.x, p.y, p.yaw) for p in steps.places]
    sole = np.array([[0.052, 0.033], [-0.052, 0.033], [-0.052, -0.033], [0.052, -0.033]])
    placed = np.array([[x, y, 0.0, yaw] for x, y, yaw in feet])
    drawn = outlines(sole, Motion(placed, placed * 0, placed * 0))
    assert sole_distance(drawn[1:], drawn[:-1]).min() > 0.003
    return at


@settings(max_examples=4, deadline=None)
@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-3.1, 3.1))
def test_steps_to_any_goal_arrive_there_and_back_home(x: float, y: float, yaw: float) -> None:
    if math.hypot(x, y) + abs(yaw) < 1e-3:
        return
    steps = sk.steps_to(ROBOT, GAIT, (x, y, yaw), (0.0, 0.0, 0.0), limits=limits())
    at = checked(steps)
    away = at - [x, y, yaw]
    away[:, 2] = np.angle(np.exp(1j * away[:, 2]))
    assert np.abs(away).max(axis=1).min() < 1e-9  # it was there
    assert abs(math.remainder(at[-1, 2], math.tau)) < 1e-9
    np.testing.assert_allclose(at[-1, :2], 0.0, atol=1e-9)


def test_a_mirrored_goal_has_as_many_steps() -> None:
    one = sk.steps_to(ROBOT, GAIT, (0.2, 0.3, 1.0), limits=limits())
    assert len(one) == len(sk.steps_to(ROBOT, GAIT, (0.2, -0.3, -1.0), limits=limits()))


def test_near_goals_take_few_steps_and_far_ones_are_walked_to_ahead() -> None:
    ahead, side = (limits().ahead, 0.0, 0.0), (0.0, limits().side, 0.0)
    assert len(sk.steps_to(ROBOT, GAIT, ahead, limits=limits())) == 2
    assert len(sk.steps_to(ROBOT, GAIT, side, limits=limits())) == 2
    far = sk.steps_to(ROBOT, GAIT, (0.0, 0.6, 0.0), limits=StepLimits(0.06, 0.02, 0.3))
    assert np.abs(middles(far)[:, 2]).max() == pytest.approx(math.pi / 2)  # it turns on its way
    back = checked(sk.steps_to(ROBOT, GAIT, (-0.2, 0.0, 0.0), limits=limits()))
    assert np.abs(back[:, 2]).max() < 1e-9  # backwards


def test_steps_along_a_curve_stay_on_it() -> None:
    angle = np.linspace(0.0, 1.5, 9)
    steps = sk.steps_along(ROBOT, GAIT, 0.6 * np.column_stack([np.sin(angle), 1 - np.cos(angle)]), limits())
    at = checked(steps)
    radius = np.hypot(at[:, 0], at[:, 1] - 0.6)
    assert np.abs(radius - 0.6).max() < 0.003
    np.testing.assert_allclose(at[-1], [0.6 * math.sin(1.5), 0.6 * (1 - math.cos(1.5)), 1.5], atol=0.01)
    yaws = sk.steps_along(ROBOT, GAIT, [(0.1, 0.0, 0.5), (0.1, 0.1, 0.5)], limits())
    np.testing.assert_allclose(checked(yaws)[-1], [0.1, 0.1, 0.5], atol=1e-9)


@pytest.mark.parametrize(
    ("goals", "said"),
    [
        ([], "no goal is given"),
        ([(1, 2)], r"\(1, 2\) is no goal; expected \(x, y, yaw\)"),
        ([(1, 2, math.nan)], "is no goal"),
        (["abc"], "'abc' is no goal"),
        ([(0, 0, 0)], "the robot stands where it is to go"),
    ],
)
def test_goals_that_are_none_are_refused(goals: list[object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        sk.steps_to(ROBOT, GAIT, *goals)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("curve", "said"),
    [
        ([(0, 0)], "a curve is a list of two points"),
        ("abc", "a curve is a list of two points"),
        ([(0, 0), (1, math.inf)], "finite numbers"),
        ([(0, 0), (1, 1), (1, 1)], "points 2 and 3 of the curve are one"),
    ],
)
def test_curves_that_are_none_are_refused(curve: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        sk.steps_along(ROBOT, GAIT, curve)


def test_a_file_of_a_curve_is_read_and_its_faults_named(tmp_path: Path) -> None:
    file = tmp_path / "curve.csv"
    file.write_text("x, y, yaw\n0, 0, 0\n100*mm, 0, 10*deg\n")
    np.testing.assert_allclose(load_curve(file), [[0, 0, 0], [0.1, 0, math.radians(10)]])
    for text, said in (
        ("a,b\n", "row 1: its columns are a, b"),
        ("x,y\n0\n1,one\n", "row 2: 1 cells.* row 3"),
    ):
        file.write_text(text)
        with pytest.raises(GaitError, match=f"(?s){said}"):
            load_curve(file)


def test_the_command_line_walks_to_a_goal_and_back_home(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["walk", "bioloid", "--set", "bend=0.88", "--set", "period=6", "--no-plots", "--json"]
    assert run([*words, "--goal=0.02,0,0", "--goal=0,0,0", "-o", str(tmp_path / "out")]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 4
    walk = sk.load_trajectory(tmp_path / "out" / "trajectory.npz")
    assert "--goal=0.02,0,0 --goal=0,0,0" in walk.meta["command"]
    np.testing.assert_allclose(walk.T_world_base[-1], walk.T_world_base[0], atol=1e-8)
    np.testing.assert_allclose(walk.q[-1], ROBOT.posture("home").q, atol=1e-8)
    curve = tmp_path / "curve.csv"
    curve.write_text("x,y\n0,0\n0.05,0\n")
    assert run([*words, "--curve", str(curve), "--goal=0,0,0"]) == 2
    assert "--goal and --curve each say where the walk goes" in capsys.readouterr().err


@pytest.mark.slow
def test_fifty_steps_a_curve_and_a_goal_and_back_are_walked_in_both_engines_with_the_tables_servos() -> None:
    curve = [(0.0, 0.0), (0.2, 0.0), (0.4, 0.1), (0.5, 0.3)]
    lists = [
        sk.steps_along(ROBOT, GAIT, [(0.0, 0.0), (0.7, 0.0), (1.3, 0.2)]),
        sk.steps_along(ROBOT, GAIT, curve),
        sk.steps_to(ROBOT, GAIT, (0.2, 0.15, 0.8), (0.0, 0.0, 0.0)),
    ]
    assert len(lists[0]) >= 50
    for steps in lists:
        check = sk.validate(ROBOT, sk.walk(ROBOT, GAIT, steps), engine="auto", servo="table")
        assert check.passed, check.reasons
