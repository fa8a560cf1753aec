"""``demo``: the whole story, told once, with a report at its end."""

import json

import pytest

import screwkin as sk
from tests.bodies import humanoid


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """A short demo: exit code, story and folder."""
    import contextlib
    import io

    from screwkin.cli import run

    folder = tmp_path_factory.mktemp("demo") / "out"
    story = io.StringIO()
    with contextlib.redirect_stdout(story):
        code = run(["demo", "--gait", "smooth", "--steps", "1", "-o", str(folder)])
    return code, story.getvalue(), folder


@pytest.fixture
def without_pictures(monkeypatch):
    """A demo that draws nothing, neither film nor report: half of its time, and other tests look at them."""
    import screwkin.cli.simulation as simulation

    monkeypatch.setattr(simulation, "_camera", lambda duration: None)
    monkeypatch.setattr(simulation, "drawn", lambda draw: ())
    monkeypatch.setattr(simulation, "write_page", lambda *_: None)


def test_the_default_robot_walks_and_the_story_names_every_stage(shown):
    code, story, folder = shown
    assert code == 0
    for part in (
        "right_knee",
        "mobility 24",
        "gait smooth",
        "smallest margin",
        "pybullet",
        "All 18 servos hold their positions.",
        "It walks: passed.",
    ):
        assert part in story
    assert str(folder / "report.html") in story


def test_the_folder_holds_trajectory_verdict_film_and_report(shown):
    _, _, folder = shown
    names = {path.name for path in folder.iterdir()}
    assert {"trajectory.npz", "trajectory.csv", "validation.json", "walk.gif", "report.html"} <= names
    assert not [name for name in names if name.startswith(".")]
    assert {"play.npz", "tracking.png"} <= names
    assert "What was commanded to the servos" in (folder / "report.html").read_text(encoding="utf-8")
    assert json.loads((folder / "validation.json").read_text(encoding="utf-8"))["passed"]


def test_a_walk_that_falls_ends_with_3_and_json_alone_on_stdout(cli, without_pictures, tmp_path):
    gait = tmp_path / "stiff.toml"
    from screwkin.model.library import find_gait

    text = find_gait("paper").read_text(encoding="utf-8")
    gait.write_text(text.replace("sway = 1.0", "sway = 0.0"), encoding="utf-8")
    called = cli("demo", "--gait", gait, "--steps", 1, "-o", "out", "--json")
    assert called.code == 3
    assert called.err == ""
    assert called.data["passed"] is False
    assert called.data["mobility"] == 24
    assert called.data["reasons"]
    assert (called.data["packets"], called.data["servos"]) == (0, None), "nothing is sent that did not pass"


def test_a_walk_too_fast_for_the_servos_is_shown_but_not_sent(cli, without_pictures, tmp_path):
    from screwkin.model.library import find_gait

    text = find_gait("walk").read_text(encoding="utf-8")
    gait = tmp_path / "hasty.toml"
    gait.write_text(text.replace("Tc = 1.5", "Tc = 1.0"), encoding="utf-8")
    called = cli("demo", "--gait", gait, "--steps", 1, "-o", "out")
    assert called.code == 0
    assert "Refused: " in called.out
    assert "rad/s, its servo at most 6.00" in called.out
    assert not (tmp_path / "out" / "play.npz").exists()


def test_json_counts_the_packets_and_tells_how_the_play_ended(cli, without_pictures):
    data = cli("demo", "--gait", "smooth", "--steps", 1, "-o", "out", "--json").data
    assert data["packets"] > data["servos"]["frames"] > 100
    assert (data["servos"]["faults"], data["servos"]["state"]) == ([], "hold")


def test_without_the_simulator_the_report_still_tells_the_rest(cli, monkeypatch, tmp_path):
    import screwkin.cli.simulation
    from screwkin.errors import MissingDependencyError

    def absent(*_, **__):
        raise MissingDependencyError("pybullet is not installed: pip install pybullet")

    monkeypatch.setattr(screwkin.cli.simulation, "validated", absent)
    called = cli("demo", "--steps", 1, "-o", "out")
    assert called.code == 2
    assert "pip install pybullet" in called.err
    assert "The report holds what was done so far" in called.err
    assert (tmp_path / "out" / "report.html").exists()
    assert not (tmp_path / "out" / "validation.json").exists()


def test_a_robot_that_cannot_walk_is_refused(cli, refused, tmp_path):
    called = cli("demo", "linkages/four-bar")
    assert called.code == 2
    assert "fixed base" in called.err
    assert list(tmp_path.iterdir()) == []


def test_a_robot_without_servos_has_nothing_to_play_to(tmp_path):
    from screwkin.cli.demo import _played_to_virtual

    play = _played_to_virtual(tmp_path / "trajectory.npz", "linkages/four-bar", tmp_path / "play.npz")
    assert play["lines"] == ["The robot's table has no [servos]: nothing to play to."]
    assert (play["packets"], play["servos"]) == (0, None)


def test_a_robot_of_ones_own_walks_a_gait_that_fits_it(cli, without_pictures, tmp_path):
    path = tmp_path / "body.toml"
    path.write_text(humanoid(), encoding="utf-8")
    called = cli("demo", path, "--steps", 1, "-o", tmp_path / "out")
    assert called.code in (0, 3), called.err
    assert "3. The gait auto" in called.out
    assert "--auto" in sk.load_trajectory(tmp_path / "out" / "trajectory.npz").meta["command"]
