"""Scene and panel on a server that only writes down what it is asked for."""

from collections import Counter
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

import screwkin as sk
from screwkin.viewer.film import write_film
from screwkin.viewer.guides import circuits_of
from screwkin.viewer.panel import Mailbox, Panel
from screwkin.viewer.session import advanced, begun, handled, with_motion
from screwkin.viewer.stage import Stage
from screwkin.viewer.track import track_of
from tests.analysis.conftest import robot, trajectory

__all__ = ["robot", "trajectory"]


class Handle(MagicMock):
    """A node or a widget; ``sent`` counts what was assigned to it by name."""

    def __setattr__(self, name, value):
        if name in ("position", "wxyz", "vertices", "text"):
            self.__dict__.setdefault("sent", Counter())[name] += 1
        super().__setattr__(name, value)


class Written:
    """A scene or a gui: every ``add_`` gives a handle with what it was given."""

    def __init__(self):
        self.handles = {}

    def __getattr__(self, name):
        def add(label="", *values, **options):
            handle = Handle(label=label, values=values, options=options)
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
    stage.say(session)
    assert scene.handles["/world/motion/ZMP/label"].text == f"ZMP {x:.0f}, {y:.0f} mm"
    border = scene.handles["/world/motion/polygon"].vertices.reshape(-1, 8, 3)  # a bar for every edge
    assert np.allclose(border[:, :4].mean(axis=1), track.polygon(k), atol=1e-6)
    stage.mark("feet", False)
    stage.show(session)
    assert scene.handles["/world/motion/polygon"].visible is False
    stage.mark("follow", False)
    stage.show(session)
    assert np.array_equal(scene.handles["/world"].position, np.zeros(3))
    stage.circuit("left_leg")
    stage.show(session)
    lit = [scene.handles[f"/world/circuit/{kind}"] for kind in ("real", "virtual")]
    assert all(len(handle.vertices) for handle in lit)
    body = scene.handles["/world/robot/torso/body 0"]
    assert body.opacity < 0.5, "one looks inside"
    stage.circuit("none")
    assert body.opacity is None
    stage.show(session)
    for handle in lit:
        handle.remove.assert_called_once_with()


def test_only_what_has_changed_is_sent(robot, trajectory):
    scene = Written()
    session = handled(with_motion(begun(robot), trajectory), {"play": True})
    stage = Stage(scene, session)
    stage.show(session)
    links = [scene.handles[f"/world/robot/{link.name}"] for link in robot.links]
    border = scene.handles["/world/motion/polygon"]
    before = [handle.sent.total() for handle in (*links, border)]
    stage.show(session)
    assert [handle.sent.total() for handle in (*links, border)] == before, "nothing moved"
    shows, polygons = 0, {session.track.polygon(session.sample).tobytes()}
    while session.clock.playing:
        session = advanced(session, 1 / 40)
        stage.show(session)
        shows += 1
        polygons.add(session.track.polygon(session.sample).tobytes())
    assert shows > 100
    assert len(polygons) <= border.sent["vertices"] < shows / 10, "drawn anew where it is another"
    assert "text" not in scene.handles["/world/motion/ZMP/label"].sent, "numbers are written apart"


def test_what_is_not_asked_for_is_not_put_up_and_lines_are_few_triangles(robot, trajectory):
    scene = Written()
    session = with_motion(begun(robot), trajectory)
    stage = Stage(scene, session)
    stage.show(session)
    assert not [name for name in scene.handles if "/axis" in name or "/frame " in name or "circuit" in name]
    assert len(scene.handles) < 2 * len(robot.links) + 20
    lines = [scene.handles[f"/world/motion/{name} trace"] for name in ("ZMP", "GCoM", "CoM")]
    assert sum(len(handle.values[1]) for handle in (*lines, scene.handles["/world/floor"])) < 2500
    stage.mark("axes", True)
    assert len([name for name in scene.handles if name.endswith("/name")]) == len(robot.tree)
    stage.mark("axes", False)
    put_up = dict(scene.handles)
    stage.mark("axes", True)
    assert scene.handles == put_up, "put up once"


def test_widgets_ask_only_for_what_a_person_did(robot, trajectory):
    gui, mailbox = Written(), Mailbox()
    session = begun(robot, sk.load_gait("paper"), 1)
    panel = Panel(gui, session, mailbox)
    assert gui.handles["play"].disabled
    session = with_motion(session, trajectory)
    panel.show(session)
    assert not gui.handles["play"].disabled
    assert gui.handles["time [s]"].max == pytest.approx(trajectory.duration)
    stride = gui.handles["stride [m]"]
    asked = stride.on_update.call_args.args[0]
    asked(SimpleNamespace(client=None, target=SimpleNamespace(value=0.01)))
    assert mailbox.taken() == {}
    asked(SimpleNamespace(client="one", target=SimpleNamespace(value=0.03)))
    assert mailbox.taken() == {"gait stride": 0.03}
    gui.handles["play"].on_click.call_args.args[0](None)
    panel.show(handled(session, mailbox.taken()))
    assert gui.handles["play"].label == "pause"


def test_mechanisms_name_their_circuits():
    assert circuits_of(sk.load_robot("linkages/four-bar")) == ("loop",)


def test_a_film_lasts_as_long_as_the_motion(robot, trajectory, tmp_path):
    from PIL import Image

    from screwkin.sim.camera import Camera

    track = track_of(robot, trajectory)
    camera = Camera(pictures=4, width=60, height=50)
    with Image.open(write_film(robot, track, tmp_path / "walk.gif", camera)) as film:
        assert film.n_frames == 4
        shown = [film.seek(i) or film.info["duration"] for i in range(film.n_frames)]
    assert sum(shown) == pytest.approx(1000 * trajectory.duration, abs=5.001)
