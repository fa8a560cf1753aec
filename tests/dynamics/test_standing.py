"""Motions of joints alone: base, feet, contacts and ZMP follow from feet that stand flat and still."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.analysis.consistency import motion_faults
from screwkin.cli import run
from screwkin.errors import InputError, TrajectoryError
from screwkin.model.joint_file import load_joints

ROBOT = sk.load_robot("bioloid")


@cache
def _walk(gait: str) -> sk.Trajectory:
    return sk.walk(ROBOT, sk.load_gait(gait).replace(rate=100), steps=2)


def _turned(T: np.ndarray, p: np.ndarray) -> np.ndarray:
    return np.asarray(p @ T[:2, :2].T + T[:2, 3])


@pytest.mark.parametrize(("gait", "zmp"), [("preview", 2e-4), ("turn", 2e-4)])
def test_the_joints_of_a_walk_give_back_its_base_its_feet_and_its_zmp(gait: str, zmp: float) -> None:
    walk = _walk(gait)
    again = sk.Trajectory.from_joints(ROBOT, walk.time, walk.q)
    T = walk.T_world_base[0] @ np.linalg.inv(again.T_world_base[0])
    np.testing.assert_allclose(T @ again.T_world_base, walk.T_world_base, atol=1e-5)
    for tip, pose in walk.T_world_tip.items():
        np.testing.assert_allclose(T @ again.T_world_tip[tip], pose, atol=1e-5)
    away = _turned(T, again.zmp) - walk.zmp
    assert np.sqrt((away**2).sum(axis=1).mean()) < zmp
    differs = (again.contact != walk.contact).any(axis=1)
    changes = (np.diff(walk.contact.astype(int), axis=0) != 0).any(axis=1).sum()
    assert differs.sum() <= 10 * changes  # samples of feet that are 0.1 mm high
    assert [fault for fault in motion_faults(ROBOT, again) if "of the base" not in fault] == []


def test_with_the_contacts_of_the_walk_margins_are_those_of_the_walk_too() -> None:
    walk = _walk("preview")
    again = sk.Trajectory.from_joints(ROBOT, walk.time, walk.q, walk.contact)
    assert (again.contact == walk.contact).all()
    assert again.feet == walk.feet
    np.testing.assert_allclose(again.margin, walk.margin, atol=1e-3)
    assert again.meta["robot"] == walk.meta["robot"]


@settings(max_examples=15)
@given(st.lists(st.floats(-0.4, 0.4), min_size=12, max_size=12), st.integers(0, 1))
def test_a_standing_foot_keeps_its_place_whatever_the_joints_do(bends: list[float], foot: int) -> None:
    """Rates and accelerations too: a foot's twist and its change, by Jacobian and differences, are zero."""
    time, legs = (
        np.linspace(0.0, 1.0, 101),
        np.array(
            [n.endswith(("pitch", "roll", "yaw", "knee")) and "leg" not in n for n in ROBOT.joint_names]
        ),
    )
    q = np.tile(sk.home(ROBOT).q, (len(time), 1))
    q[:, np.flatnonzero(legs)[:12]] += np.outer(np.sin(2 * time) ** 2, bends)
    contact = np.zeros((len(time), 2), dtype=bool)
    contact[:, foot] = True
    moved = sk.Trajectory.from_joints(ROBOT, time, q, contact)
    tip = moved.feet[foot]
    np.testing.assert_allclose(moved.T_world_tip[tip], moved.T_world_tip[tip][:1].repeat(101, 0), atol=1e-12)
    J = sk.jacobian(ROBOT, sk.State(moved.T_world_base, moved.q), tip)
    rates = np.concatenate([moved.base_twist, moved.qd], axis=1)
    np.testing.assert_allclose(J @ rates[..., None], 0.0, atol=1e-10)
    change = np.gradient(moved.base_twist, time, axis=0)[2:-2]
    np.testing.assert_allclose(moved.base_acceleration[2:-2], change, atol=2e-2 * (1 + np.abs(change).max()))


def test_a_motion_that_starts_turned_is_laid_ahead_over_the_origin() -> None:
    walk = _walk("turn")
    later = sk.Trajectory.from_joints(ROBOT, walk.time[250:], walk.q[250:])
    places = [pose[0] for tip, pose in later.T_world_tip.items() if tip in later.feet]
    assert np.mean([T[:2, 3] for T in places], axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.mean([np.arctan2(T[1, 0], T[0, 0]) for T in places]) == pytest.approx(0.0, abs=1e-9)


def test_feet_that_contradict_each_other_are_said_to() -> None:
    q = np.tile(sk.home(ROBOT).q, (20, 1))
    q[:, ROBOT.joint_names.index("left_knee")] += np.linspace(0, 0.3, 20)
    contact = np.ones((20, 2), dtype=bool)
    contact[15:, 0] = False
    notes = sk.Trajectory.from_joints(ROBOT, np.arange(20) / 50, q, contact).meta["notes"]
    assert any(note.startswith("the base jumps by up to") for note in notes)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"q": np.zeros((5, 3))}, r"q has shape \(5, 3\), expected \(5, 18\)"),
        ({"time": [0, 1, 2, 2, 3]}, "time must increase"),
        ({"q": np.full((5, 18), np.nan)}, "NaN or infinity"),
        ({"contact": np.zeros((5, 2), dtype=bool)}, r"no foot stands in sample 0 \(0 s\)"),
        ({"contact": np.ones((5, 3), dtype=bool)}, r"contact has shape \(5, 3\), expected \(5, 2\)"),
    ],
)
def test_what_is_no_motion_of_the_robot_is_refused(change: dict[str, object], said: str) -> None:
    right = {"time": np.arange(5.0), "q": np.tile(sk.home(ROBOT).q, (5, 1))}
    with pytest.raises(InputError, match=said):
        sk.Trajectory.from_joints(ROBOT, **{**right, **change})


def test_loops_are_refused() -> None:
    robot = sk.load_robot("linkages/four-bar")
    with pytest.raises(InputError, match="has closures"):
        sk.Trajectory.from_joints(robot, [0, 1], np.zeros((2, 4)))


@pytest.mark.parametrize("ending", ["csv", "json"])
def test_files_of_joints_come_back_in_any_order_and_zmp_takes_them(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    walk = _walk("preview")
    path = walk.save(tmp_path / f"joints.{ending}")
    time, q = load_joints(path, ROBOT)
    np.testing.assert_allclose(time, walk.time, atol=1e-9)
    assert (q == walk.q).all()
    assert run(["zmp", str(path), "--json"]) == 2
    assert "screwkin zmp" in capsys.readouterr().err
    assert run(["zmp", str(path), "--robot", "bioloid", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["min_margin_mm"] == pytest.approx(
        1e3 * walk.margin.min(), abs=0.5
    )


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "time,right_knee\n0,1\n0.1,x\n", "row 3: expected 2 numbers"),
        ("a.csv", "right_knee\n0\n", "row 1: expected a header that begins with time"),
        ("a.csv", "time,right_kne\n0,1\n", "'right_kne' is no joint of bioloid. Did you mean 'right_knee'"),
        ("a.json", '{"points": []}', "no trajectory_msgs/JointTrajectory: key 'joint_names' is missing"),
        ("a.json", "{", "no trajectory_msgs/JointTrajectory: no JSON: Expecting"),
    ],
)
def test_files_that_hold_no_joints_are_refused_with_their_row(
    name: str, text: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TrajectoryError, match=said.replace(".", "[.]")):
        load_joints(path, ROBOT)
