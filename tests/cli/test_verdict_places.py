"""Where a verdict goes, and what it may replace: whatever is sent was validated, and stays so."""

from __future__ import annotations

import shutil

import pytest

from tests.cli.conftest import told_once
from tests.verdicts import passing

ENGINES = ("kinematic", "mujoco")


@pytest.fixture
def sent(walked, tmp_path):
    """A copy of the walk, with a verdict that lets it be sent."""
    folder = tmp_path / "sent"
    folder.mkdir()
    shutil.copy(walked / "trajectory.npz", folder)
    return passing(folder / "trajectory.npz")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_verdict_goes_where_it_is_asked_for_and_nothing_else_changes(cli, sent, tmp_path, engine):
    (sent.parent / "report.html").write_text("passed", encoding="utf-8")
    before = {path.name: path.read_bytes() for path in sent.parent.iterdir()}
    assert cli("send", sent).code == 0
    called = cli("validate", sent, "--engine", engine, "--no-plots", "-o", tmp_path / "other")
    assert called.code in (0, 3)
    assert {path.name: path.read_bytes() for path in sent.parent.iterdir()} == before
    assert [path.name for path in (tmp_path / "other").iterdir()] == ["validation.json"]
    assert f"send goes by the one in {sent.parent}" in called.out
    assert cli("send", sent).code == 0


def test_an_engine_without_forces_replaces_no_verdict_of_one_with_forces(cli, sent, tmp_path):
    before = {path.name: path.read_bytes() for path in sent.parent.iterdir()}
    message = told_once(cli("validate", sent, "--engine", "kinematic", "--no-plots"), 2)
    assert "cannot replace" in message
    assert "-o DIR" in message
    assert {path.name: path.read_bytes() for path in sent.parent.iterdir()} == before


def test_what_a_simulation_makes_untrue_is_removed_with_a_word_and_the_rest_stays(cli, sent):
    for name in ("report.html", "zmp_y.png", "upright.png", "mine.png"):
        (sent.parent / name).write_text("old", encoding="utf-8")
    called = cli("validate", sent, "--engine", "mujoco", "--no-plots")
    assert called.code in (0, 3)
    gone = f"removed from {sent.parent}, as they showed an earlier result: report.html, upright.png"
    assert gone in called.err
    assert {path.name for path in sent.parent.iterdir()} == {
        "trajectory.npz",
        "validation.json",
        "zmp_y.png",
        "mine.png",
    }
