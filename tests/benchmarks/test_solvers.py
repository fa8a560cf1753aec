"""Motions of public robots at finer settings: what a row says, and the motions themselves."""

from __future__ import annotations

import numpy as np

import screwkin as sk
from benchmarks.solvers import Row, markdown, merged, motion_of, same


def row(usual: bool, finer: bool, rms: list[float]) -> Row:
    own = {"passed": {"usual": usual, "half the step": finer}, "spread": {"zmp_rms_mm": rms}}
    return {
        "file": "a.urdf",
        "motion": "walk",
        "name": "one",
        "mass": 30.0,
        "joints": 12,
        "engines": {"mujoco": own},
    }


def test_a_verdict_outlasts_finer_settings_if_neither_it_nor_its_zmp_moves() -> None:
    rows = [row(True, True, [0.1, 1.9]), row(True, True, [0.1, 2.9]), row(True, False, [0.1, 0.2])]
    assert [same(one) for one in rows] == [True, False, False]
    assert markdown(rows[:1]).count("| walk |") == 1
    rows = [one | {"file": f"{k}.urdf"} for k, one in enumerate(rows)]
    text = markdown([*rows, {"file": "b.urdf", "motion": "stand", "reason": "no legs"}])
    assert "1 of 3 motions in MuJoCo; 0 of 0 motions in PyBullet." in text
    assert "| 0.urdf | 30.0 | 12 | walk |  |  | passes | 0.10 to 1.90 |" in text
    assert "| b.urdf | 0.0 |  | stand | no legs |" in text


def test_rows_of_both_engines_are_one_line_that_needs_both() -> None:
    good, bad = row(True, True, [0.1, 0.2]), row(True, False, [0.3, 0.4])
    other = {**bad, "engines": {"pybullet": bad["engines"]["mujoco"]}}
    (one,) = merged([good, other])
    assert list(one["engines"]) == ["mujoco", "pybullet"]
    assert same(good)
    assert not same(one)
    assert "| walk | fails/passes | 0.30 to 0.40 | passes | 0.10 to 0.20 |" in markdown([good, other])


def test_a_squat_goes_down_and_up_with_the_feet_in_place() -> None:
    robot = sk.load_robot("poppy12")
    squat = motion_of(robot, "squat")
    height = squat.T_world_base[:, 2, 3]
    assert height.min() < 0.93 * height[0] < height[-1] * (1 + 1e-12)
    for poses in squat.T_world_tip.values():
        np.testing.assert_allclose(poses, np.broadcast_to(poses[0], poses.shape), atol=1e-9)
    assert squat.margin.min() > 0
