"""The controls of the browser viewer: what ``controls`` describes, as widgets that ask for things by key."""

from __future__ import annotations

from collections.abc import Callable
from threading import Condition
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.viewer.controls import Slider, gait_sliders, joint_sliders
from screwkin.viewer.guides import NO_CIRCUIT, circuits_of
from screwkin.viewer.session import SPEEDS, Session
from screwkin.viewer.track import Track

MARKS = {
    "axes": "screw axes",
    "frames": "frames",
    "traces": "ZMP and CoM",
    "feet": "feet, support",
    "robot": "body",
    "follow": "go along with it",
}
_POINTS = 240  # of the plot of the margin, at most: it is drawn anew several times a second


class Mailbox:
    """What was asked for since one last looked, the latest value of each key; browsers write from threads."""

    def __init__(self) -> None:
        self._some, self._asked = Condition(), dict[str, object]()

    def ask(self, key: str, value: object = True) -> None:
        """Ask for something; an older value of the same key that was not looked at yet is forgotten."""
        with self._some:
            if key == "play" and key in self._asked:
                del self._asked[key]  # started and stopped again
            else:
                self._asked[key] = value
            self._some.notify()

    def taken(self, patience: float = 0.0) -> dict[str, object]:
        """What was asked for, in order; the mailbox is empty then.

        Args:
            patience: how long to wait for something [s].
        """
        with self._some:
            self._some.wait_for(lambda: bool(self._asked), patience)
            asked, self._asked = self._asked, {}
        return asked


class Panel:
    """The widgets of a viser server; ``show`` makes them say what a session says."""

    def __init__(self, gui: Any, session: Session, mailbox: Mailbox) -> None:
        self._gui, self._mailbox = gui, mailbox
        self._joints: list[Any] = []
        self._track: Track | None = None
        self._plot: Any = None
        gui.set_panel_label(session.robot.name)
        self._reading = gui.add_markdown(session.reading)
        self._note = gui.add_markdown("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("motion"):
            self._play = self._button("play", "play")
            self._time = self._slider(Slider("time", "s", 0.0, 1.0, 0.01, 0.0), "time")
            self._asking(gui.add_dropdown("speed", SPEEDS, initial_value="1"), "speed")
            self._motion_tab = gui.add_folder("margin of the ZMP [mm]")
        if session.gait is not None:
            with tabs.add_tab("gait"):
                for slider in gait_sliders(session.robot, session.gait):
                    self._slider(slider, f"gait {slider.name}")
        with tabs.add_tab("joints"):
            self._button("back home", "home")
            self._joints = [
                self._slider(slider, f"joint {slider.name}")
                for slider in joint_sliders(session.robot, session.q)
            ]
        with tabs.add_tab("show"):
            for mark, label in MARKS.items():
                self._asking(gui.add_checkbox(label, mark not in ("axes", "frames")), f"mark {mark}")
            circuits = circuits_of(session.robot)
            if circuits:
                self._asking(gui.add_dropdown("circuit", (NO_CIRCUIT, *circuits)), "circuit")
        self.show(session)

    def show(self, session: Session) -> None:
        """Say what the session says."""
        if session.track is not self._track:
            self._put_up_motion(session)
        self._play.label = "pause" if session.clock.playing else "play"
        self._reading.content = session.reading
        self._note.content = session.note
        self._time.value = session.clock.time
        for handle, value in zip(self._joints, session.q.tolist(), strict=True):
            handle.value = float(np.clip(value, handle.min, handle.max))
        if session.track is not None and session.sample is not None:
            self._plot.data = _plotted(session.track, session.sample)

    def _put_up_motion(self, session: Session) -> None:
        """The slider of time and the plot of another motion."""
        self._track = track = session.track
        self._play.disabled = self._time.disabled = track is None
        if self._plot is not None:
            self._plot.remove()
            self._plot = None
        if track is None:
            return
        self._time.max = track.duration
        with self._motion_tab:
            self._plot = self._gui.add_uplot(
                _plotted(track, session.sample or 0),
                (
                    {"label": "t [s]"},
                    _line("margin", "#a6266e"),
                    _line("now", "#444444"),
                    _line("0", "#b00020"),
                ),
                scales={"x": {"time": False}},
                aspect=1.6,
            )

    def _button(self, label: str, key: str) -> Any:
        handle = self._gui.add_button(label)
        handle.on_click(lambda event: self._mailbox.ask(key))
        return handle

    def _slider(self, slider: Slider, key: str) -> Any:
        handle = self._gui.add_slider(slider.label, slider.lower, slider.upper, slider.step, slider.value)
        return self._asking(handle, key)

    def _asking(self, handle: Any, key: str) -> Any:
        handle.on_update(self._asked(key))
        return handle

    def _asked(self, key: str) -> Callable[[Any], None]:
        def ask(event: Any) -> None:
            if event.client is not None:  # else the viewer itself moved the widget
                self._mailbox.ask(key, event.target.value)

        return ask


def _line(label: str, colour: str, width: float = 1.5) -> dict[str, Any]:
    return {"label": label, "stroke": colour, "width": width, "points": {"show": False}}


def _plotted(track: Track, sample: int) -> tuple[Array, ...]:
    """Times, margin [mm], a needle where the motion is now, and the border of the support polygon."""
    every = np.arange(0, len(track.time), -(-len(track.time) // _POINTS))
    margin = np.nan_to_num(1e3 * track.margin[every], neginf=0.0)
    needle = np.full(len(margin), min(0.0, margin.min()))
    needle[np.abs(every - sample).argmin()] = max(margin.max(), 1.0)
    return track.time[every], margin, needle, np.zeros(len(margin))
