"""The list of walks, and what is said of two engines' verdicts on them."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path

import screwkin as sk
from benchmarks.verdicts import ENGINES, SERVOS, Outcome, Walk, done, main, markdown, walks


def test_the_list_holds_a_hundred_different_walks_of_three_robots() -> None:
    rows = walks()
    assert len(rows) == len(set(rows)) == 100
    assert len({row.robot for row in rows}) == 3
    for row in rows:
        assert sk.load_gait(row.gait).name == row.gait
        assert row.robot in sk.robot_names()


def test_verdicts_that_differ_are_listed_with_their_reasons() -> None:
    walk = Walk("one", "walk", 1.0, 0.1)
    good = Outcome(walk, "rigid", "pybullet", True, (), 0.2, 1.0)
    bad = replace(good, engine="mujoco", passed=False, reasons=("a stance foot slips",), zmp_rms_mm=0.7)
    other = replace(good, walk=replace(walk, gait="turn"))
    text = markdown([good, bad, other, replace(other, engine="mujoco")])
    assert "| rigid | 2 | 1 | 1 | 0 |" in text
    assert (
        "- one walk, Tc 1 s, stride 0.1 m, servos rigid. pybullet: passes; mujoco: a stance foot slips"
        in text
    )
    assert "mujoco, rigid servos" in text
    assert "0.70 mm" in text


def test_a_run_that_ended_early_goes_on_from_its_last_finished_walk(tmp_path: Path) -> None:
    walk = Walk("one", "walk", 1.0, None)
    row = Outcome(walk, "rigid", "pybullet", False, ("it fell",), None, 40.0)
    file = tmp_path / "verdicts.jsonl"
    assert done(file) == []
    file.write_text(json.dumps([asdict(row)]) + '\n[{"walk": {"rob')
    assert done(file) == [row]


def test_the_result_of_what_is_finished_runs_no_walk(tmp_path: Path) -> None:
    walk = walks()[0]
    rows = [Outcome(walk, servo, engine, True, (), 0.1, 0.1) for servo, engine in product(SERVOS, ENGINES)]
    file = tmp_path / "verdicts.jsonl"
    file.write_text(json.dumps([asdict(row) for row in rows]))
    assert main(["--so-far", "-o", str(tmp_path)]) == 0
    assert "1 walks of 4 steps of the 100 in" in (tmp_path / "verdicts.md").read_text()
    assert len(json.loads((tmp_path / "verdicts.json").read_text())) == 4
    assert done(file) == rows
