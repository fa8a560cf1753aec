"""``validate --log``: the joints as servos were measured, simulated and judged."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from screwkin.cli import run
from screwkin.trajectory import load_trajectory
from tests.verdicts import passing


@pytest.fixture(scope="module")
def sent(tmp_path_factory) -> Path:
    """Folder with a walk, a verdict on it, and the log of its play in ``sent``; read it only."""
    folder = tmp_path_factory.mktemp("sent")
    path = folder / "trajectory.npz"
    words = ["walk", "bioloid", "--gait", "smooth", "--steps", "1", "--no-plots", "-o", str(folder), "--json"]
    assert run(words) == 0
    passing(path)
    log = str(folder / "sent")
    assert run(["send", str(path), "--virtual", "--go", "-o", log, "--json"]) == 0
    early = ["--inject-fault", "pulled@2.5", "-o", str(folder / "cut")]
    assert run(["send", str(path), "--virtual", "--go", *early, "--json"]) == 4
    return folder


def test_what_the_servos_do_to_the_zmp_is_told_and_the_verdict_stays(cli, sent, tmp_path):
    before = (sent / "validation.json").read_bytes()
    out = tmp_path / "out"
    path, log = sent / "trajectory.npz", sent / "sent" / "play.npz"
    called = cli("validate", path, "--log", log, "--engine", "pybullet", "-o", out, "--json")
    data = called.data
    assert called.code == 0, data["reasons"]
    assert data["replayed_s"] == data["duration_s"] == load_trajectory(path).duration
    assert 3.0 < data["max_deviation_deg"] < 20.0
    assert 1.0 < data["zmp_rms_mm"] < 20.0, "servos 35 ms late move the ZMP; the plan alone errs by 0.3 mm"
    assert (sent / "validation.json").read_bytes() == before
    assert json.loads((out / "replay.json").read_text(encoding="utf-8"))["passed"]
    assert {"tracking.png", "contact_zmp.png", "report.html"} <= {path.name for path in out.iterdir()}
    assert "--log" in (out / "report.html").read_text(encoding="utf-8")


def test_files_go_beside_the_log_and_an_interrupted_log_is_judged_as_far_as_it_goes(cli, sent, tmp_path):
    shutil.copytree(sent / "cut", tmp_path / "cut")
    words = ["--log", tmp_path / "cut" / "play.npz", "--engine", "kinematic", "--no-plots"]
    called = cli("validate", sent / "trajectory.npz", *words)
    assert called.code == 3, "kinematic confirms nothing"
    assert "warning: the log ends at " in called.err
    assert [path.name for path in (tmp_path / "cut" / "replay").iterdir()] == ["replay.json"]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("nowhere.npz", "cannot be read"),
        ("trajectory.npz", "is no log of a play"),
        ("validation.json", "not an npz file"),
    ],
)
def test_a_wrong_log_is_refused_and_nothing_is_written(cli, refused, sent, tmp_path, name, told):
    assert told in refused(cli("validate", sent / "trajectory.npz", "--log", sent / name, "-o", "out"), 2)
    assert not (tmp_path / "out").exists()


def test_a_log_of_another_walk_is_refused(cli, refused, sent, walked):
    words = ["--log", sent / "sent" / "play.npz"]
    assert "another trajectory" in refused(cli("validate", walked / "trajectory.npz", *words), 2)
