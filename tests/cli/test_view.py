"""``view``: what it shows, what it refuses; the browser is tested in ``tests/viewer``."""

import pytest

import screwkin as sk
import screwkin.cli.view as verb
from screwkin.cli.walk import TO_FIT
from screwkin.gait.fitting import fitting_gait
from tests.bodies import humanoid


@pytest.fixture
def shown(monkeypatch):
    """The sessions that would be shown in a browser."""
    sessions = []

    def serve(session, host, port, ready):
        sessions.append(session)
        ready(f"http://{host}:{port}")

    monkeypatch.setattr(verb, "serve", serve)
    return sessions


def test_a_robot_a_linkage_and_a_motion_are_shown(cli, shown, walked):
    assert cli("view", "bioloid", "--json", "--port", 9000).data == {
        "url": "http://127.0.0.1:9000",
        "robot": "bioloid",
    }
    assert "Ctrl-C" in cli("view", "linkages/four-bar").out
    assert cli("view", walked / "trajectory.npz").code == 0
    robot, linkage, motion = shown
    assert (robot.gait.name, robot.track, robot.advice) == ("walk", None, TO_FIT)
    assert (linkage.gait, linkage.track) == (None, None)
    assert (motion.gait.name, motion.steps) == ("paper", 2)
    assert motion.track.duration == pytest.approx(sk.load_trajectory(walked / "trajectory.npz").duration)


def test_auto_shows_the_gait_that_walk_would_fit(cli, shown, refused, walked):
    assert cli("view", "poppy12", "--auto").code == 0
    assert shown[0].gait.to_dict() == fitting_gait(sk.load_robot("poppy12")).to_dict()
    both = refused(cli("view", "poppy12", "--auto", "--gait", "walk"), 2)
    assert "--auto and --gait exclude each other" in both
    assert "leave --auto out" in refused(cli("view", walked / "trajectory.npz", "--auto"), 2)


def test_what_cannot_be_shown_is_refused(cli, refused, shown, walked, tmp_path):
    assert "leave --gait out" in refused(cli("view", walked / "trajectory.npz", "--gait", "walk"), 2)
    assert "ends in .gif" in refused(cli("view", "bioloid", "--record", "walk.mp4"), 2)
    assert "no motion to film" in refused(cli("view", "linkages/four-bar", "--record", "a.gif"), 2)
    assert "unknown robot" in refused(cli("view", "bioloidd"), 2)
    assert "steps is 0" in refused(cli("view", "bioloid", "--steps", 0), 2)
    assert shown == []
    assert list(tmp_path.iterdir()) == []


def test_who_films_a_walk_that_is_none_is_told_of_one_that_fits(cli, refused, tmp_path):
    (tmp_path / "body.toml").write_text(humanoid(), encoding="utf-8")
    words = ("view", "body.toml", "--record", "a.gif")
    advice = "or fit a gait to the robot: --auto"
    assert refused(cli(*words), 2).rstrip().endswith(advice)
    assert advice not in refused(cli(*words, "--gait", "walk"), 2)
    assert advice not in refused(cli("view", "linkages/four-bar", "--record", "a.gif"), 2)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--port", "0"), "--port 0: expected a whole number from 1 to 65535"),
        (("--port", "65536"), "--port 65536"),
        (("--host", "192.0.2.1"), "cannot listen at 192.0.2.1, port 8080"),
    ],
)
def test_an_address_at_which_nobody_can_listen_is_refused(cli, refused, words, message):
    """192.0.2.1 is of the range that is kept for examples; no computer has it."""
    pytest.importorskip("viser")
    assert message in refused(cli("view", "linkages/four-bar", *words), 2)


def test_an_interrupt_ends_it_with_130(cli, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(verb, "serve", interrupted)
    called = cli("view", "linkages/four-bar")
    assert (called.code, called.err) == (130, "interrupted\n")
