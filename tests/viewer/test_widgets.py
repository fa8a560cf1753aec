"""Scene and panel on a server that only writes down what it is asked for."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

import screwkin as sk
from screwkin.viewer.film import record
from screwkin.viewer.panel import Mailbox, Panel
from screwkin.viewer.session import begun, handled, with_motion
from screwkin.viewer.stage import Stage, circuits_of
from screwkin.viewer.track import track_of
from tests.analysis.conftest import robot, trajectory

__all__ = ["robot", "trajectory"]


class Written:
    """A scene or a gui: every ``add_`` gives a handle with what it was given."""

    def __init__(self):
        self.handles = {}

    def __getattr__(self, name):
        def add(label="", *values, **options):
            handle = MagicMock(points=np.zeros((1, 2, 3)), label=label, values=values, options=options)
            handle.add_tab.return_value.__enter__ = lambda s: None
            if name == "add_slider":
                handle.min, handle.max, *_ = values
            self.handles[label if isinstance(label, str) else name] = handle
            return handle

        if name.startswith(("add_", "set_")):
            return add
        raise AttributeError(name)


def test_the_latest_of_what_was_asked_for_counts_and_nothing_is_asked_twice():
    mailbox = Mailbox()
    for stride in (0.02, 0.03, 0.04):
        mailbox.ask("gait stride", stride)
    mailbox.ask("play")
    assert mailbox.taken() == {"gait stride": 0.04, "play": True}
    assert mailbox.taken() == {}
    for _ in range(2):
        mailbox.ask("play")
    assert mailbox.taken() == {}, "started and stopped again"


def test_the_scene_follows_the_motion(robot, trajectory):
    scene = Written()
    session = with_motion(begun(robot), trajectory)
    stage = Stage(scene, session)
    session = handled(session, {"time": 1.3})
    stage.show(session)
    k = session.sample
    track = track_of(robot, trajectory)
    for link, T in zip(robot.links, track.Ts[k], strict=True):
        assert np.allclose(scene.handles[f"/world/robot/{link.name}"].position, T[:3, 3])
    assert np.allclose(scene.handles["/world/motion/ZMP"].position[:2], trajectory.zmp[k])
    x, y = 1e3 * trajectory.zmp[k]
    assert scene.handles["/world/motion/ZMP/label"].text == f"ZMP {x:.0f}, {y:.0f} mm"
    polygon = scene.handles["/world/motion/polygon"].points
    assert np.allclose(polygon[:, 0, :2], track.polygon(k)[:, :2])
    stage.mark("feet", False)
    assert scene.handles["/world/motion/polygon"].visible is False
    stage.mark("follow", False)
    stage.show(session)
    assert np.array_equal(scene.handles["/world"].position, np.zeros(3))
    stage.circuit("left_leg")
    stage.show(session)
    assert scene.handles["/world/circuit"].values[0].shape[1:] == (2, 3)
    lit = scene.handles["/world/circuit"]
    stage.circuit("none")
    stage.show(session)
    lit.remove.assert_called_once_with()


def test_widgets_ask_only_for_what_a_person_did(robot, trajectory):
    gui, mailbox = Written(), Mailbox()
    session = begun(robot, sk.load_gait("paper"), 1)
    panel = Panel(gui, session, mailbox)
    assert gui.handles["play"].disabled
    session = with_motion(session, trajectory)
    panel.show(session, 1.0)
    assert not gui.handles["play"].disabled
    assert gui.handles["time [s]"].max == pytest.approx(trajectory.duration)
    stride = gui.handles["stride [m]"]
    asked = stride.on_update.call_args.args[0]
    asked(SimpleNamespace(client=None, target=SimpleNamespace(value=0.01)))
    assert mailbox.taken() == {}
    asked(SimpleNamespace(client="one", target=SimpleNamespace(value=0.03)))
    assert mailbox.taken() == {"gait stride": 0.03}
    gui.handles["play"].on_click.call_args.args[0](None)
    panel.show(handled(session, mailbox.taken()), 0.0)
    assert gui.handles["play"].label == "pause"


def test_mechanisms_name_their_circuits():
    assert circuits_of(sk.load_robot("linkages/four-bar")) == ("loop",)


def test_a_film_lasts_as_long_as_the_motion(robot, trajectory, tmp_path):
    from PIL import Image

    from screwkin.sim.camera import Camera

    track = track_of(robot, trajectory)
    camera = Camera(pictures=4, width=60, height=50)
    with Image.open(record(robot, track, tmp_path / "walk.gif", camera)) as film:
        assert film.n_frames == 4
        assert film.info["duration"] == pytest.approx(1000 * trajectory.duration / 3, abs=10)
