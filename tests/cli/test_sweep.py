"""``screwkin sweep``: a grid of settings and seeds, its files, and how it goes on."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

import screwkin as sk
from tests.bodies import humanoid

GRID = ("sweep", "bioloid", "--gait", "walk", "--engine", "kinematic", "--set", "steps=1", "--set", "rate=20")


def test_a_campaign_leaves_its_rows_and_what_has_ended_is_not_played_again(cli, tmp_path):
    words = (*GRID, "--set", "Tc=1:1.2:0.2", "--runs", 3, "--seed", 4, "-o", "c")
    called = cli(*words, "--json")
    assert called.code == 0, called.err
    data, folder = called.data, tmp_path / "c"
    assert (data["rows"], data["falls"], data["interval"]) == (6, 0, None)
    assert (data["planned"], data["refused"], data["crashed"]) == (6, 0, 0)
    assert [setting["values"]["Tc"] for setting in data["settings"]] == ["1", "1.2"]
    assert json.loads((folder / "campaign.json").read_text())["axes"]["servo"] == ["auto"]  # as of validate
    names = {"campaign.json", "rows.jsonl", "rows.csv", "rows.npz", "settings.csv", "falls.png"}
    assert {path.name for path in folder.iterdir()} == names
    with (folder / "rows.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert [row["Tc"] for row in rows] == ["1"] * 3 + ["1.2"] * 3
    assert len({row["seed"] for row in rows}) == 3
    assert np.load(folder / "rows.npz")["margin_mm"].shape == (6,)

    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with (folder / "rows.jsonl").open("a") as file:
        file.write('{"row": 6, "stat')
    again = cli(*words)
    assert again.code == 0
    assert "6 of 6 rows have ended before; 0 are left" in again.err
    assert "equal seeds" not in again.out  # of rows that are only planned nobody knows if they stand
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("chosen", [False, True])
def test_what_refuses_a_robot_of_ones_own_is_said_and_that_a_gait_may_be_fitted_if_nobody_chose_one(
    cli, tmp_path, chosen
):
    (tmp_path / "body.toml").write_text(humanoid(), encoding="utf-8")
    words = ["body.toml", "--set", "rate=20", "--set", "steps=1,2", *(["--gait", "walk"] if chosen else [])]
    swept = cli("sweep", *words, "--engine", "kinematic", "--no-plots", "-o", "c", "--json")
    assert (swept.code, swept.data["refused"]) == (0, 2)
    (line,) = [line for line in swept.err.splitlines() if line.startswith("refused, row 0: ")]
    with (tmp_path / "c" / "rows.csv").open(newline="") as file:
        assert next(csv.DictReader(file))["reason"] in line
    assert line.endswith("or fit a gait to the robot: --auto") != chosen


def test_a_robot_that_no_gait_moves_is_refused_before_anything_is_played(cli, tmp_path, refused):
    (tmp_path / "body.toml").write_text(humanoid().partition("[[posture]]")[0], encoding="utf-8")
    assert "no posture 'home'" in refused(cli("sweep", "body.toml", "-o", "c"), 2)
    assert not (tmp_path / "c").exists()


PLACES = [(0.03, -0.04, 0.0), (0.05, 0.04, 0.1), (0.05, -0.04, 0.1)]


def test_a_list_of_footsteps_is_swept(cli, tmp_path):
    rows = ["x,y,yaw", *(",".join(map(str, place)) for place in PLACES)]
    (tmp_path / "places.csv").write_text("\n".join(rows))
    words = ("--footsteps", "places.csv", "--set", "rate=20", "--set", "lift=0.02,0.03")
    swept = cli("sweep", "bioloid", *words, "--engine", "kinematic", "--no-plots", "-o", "c", "--json")
    assert swept.code == 0, swept.err
    assert (swept.data["planned"], swept.data["crashed"], swept.data["refused"]) == (2, 0, 0)
    with (tmp_path / "c" / "rows.csv").open(newline="") as file:
        margins = {row["lift"]: float(row["margin_mm"]) for row in csv.DictReader(file)}
    robot, gait = sk.load_robot("bioloid"), sk.load_gait("auto").replace(rate=20, lift=0.02)
    margin = sk.zmp(robot, sk.walk(robot, gait, sk.footsteps(PLACES))).margin.min()
    assert margins["0.02"] == pytest.approx(1e3 * margin, abs=1e-3)


def test_a_list_of_footsteps_needs_a_gait_that_follows_its_feet(cli, tmp_path, refused):
    (tmp_path / "places.csv").write_text("x,y,yaw\n0.03,-0.04,0\n")
    message = refused(cli("sweep", "bioloid", "--gait", "walk", "--footsteps", "places.csv", "-o", "c"), 2)
    assert "'geometric' moves its waist by key points" in message
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "Tc=1:2"), "--set Tc=1:2 is no range"),
        (("--set", "strid=0.1,0.2"), "no such parameter"),
        (("--set", "Tc=fast"), "fast"),
        (("--set", "engine=kinematic,odd"), "unknown engine 'odd'"),
        (("--set", "servo=rigid,odd"), "odd"),
        (("--set", "feedback=maybe"), "unknown feedback 'maybe'"),
        (("--feedback", "--set", "feedback=off,on"), "--feedback and --set feedback"),
        (("--perturb", "x3", "--set", "perturb=x1,x2"), "--perturb and --set perturb"),
        (("--perturb", "x3"), "no forces to perturb"),
        (("--perturb", "strong"), "'strong' is none; write x1"),
        (("--perturb", "mas~0.1"), "Did you mean 'mass'?"),
        (("--perturb", "mass.hip=1.1"), "unknown link 'hip'"),
        (("--runs", "0"), "--runs 0"),
        (("--jobs", "0"), "--jobs 0"),
        (("--auto",), "--auto and --gait exclude each other"),
        (("--jobs", "2", "--cluster", "tcp://localhost:1"), "--jobs and --cluster"),
        (("--seeds", "seeds.txt", "--runs", "3"), "--seeds and --runs"),
        (("--set", "gait=walk,smooth"), "--gait and --set gait"),
    ],
)
def test_a_campaign_that_cannot_be_played_is_refused_before_it_begins(cli, tmp_path, refused, words, message):
    (tmp_path / "seeds.txt").write_text("1\n2\n")
    assert message in refused(cli(*GRID, *words, "-o", "c"), 2)
    assert not (tmp_path / "c").exists()


def test_a_folder_of_another_campaign_is_left_as_it_is(cli, tmp_path, refused):
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "campaign.json").write_text(json.dumps({"robot": "other"}))
    message = refused(cli(*GRID, "-o", "c"), 2)
    assert "another campaign" in message
    assert [path.name for path in (tmp_path / "c").iterdir()] == ["campaign.json"]


def test_the_best_gait_of_a_search_is_a_gait_file(cli, tmp_path):
    words = (*GRID, "--optimise", "margin", "--set", "sway=0.5:1.5", "--evaluations", 12)
    called = cli(*words, "-o", "c", "--json")
    assert called.code == 0, called.err
    data = called.data
    assert data["evaluations"] == data["rows"] == 13
    assert data["cost"] < data["first"]
    gait = sk.load_gait(tmp_path / "c" / "optimum.toml")
    assert gait.sway == data["optimum"]["sway"]
    walk = sk.walk(sk.load_robot("bioloid"), gait)
    assert -1e3 * walk.margin.min() == pytest.approx(data["cost"], abs=1e-6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "sway=a:b"), "no bounds"),
        (("--set", "sway=1:2", "--set", "sway=1:3"), "given twice"),
        (("--set", "swa=1:2"), "no such parameter"),
        (("--set", "Tc=0:2"), "Tc"),
        (("--set", "Tc=1,2", "--set", "sway=1:2"), "Tc=LEAST:GREATEST"),
    ],
)
def test_a_search_that_is_none_is_refused_before_it_begins(cli, tmp_path, refused, words, message):
    assert message in refused(cli(*GRID, "--optimise", "margin", *words, "-o", "c"), 2)
    assert not (tmp_path / "c").exists()
