"""The scene of the browser viewer: what ``scene`` and ``marks`` describe, put up once and then moved."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.sim.solids import robot_size
from screwkin.viewer.guides import NO_CIRCUIT, LitCircuit, link_node, put_axes, put_frames
from screwkin.viewer.nodes import Moved, put_mesh
from screwkin.viewer.playing import Played
from screwkin.viewer.scene import pieces_of
from screwkin.viewer.session import Session
from screwkin.viewer.strokes import Triangles, ribbons

FLOOR, TILE = 2.5, 0.5
"""How far the lines of the floor reach about the robot, and how far they lie apart, in sizes of the robot."""
LINES = (205, 208, 212)
GLASS = 0.3
"""Opacity of bodies in which axes, frames or a circuit are to be seen."""


class Stage:
    """What stands in the scene of a viser server; ``show`` moves it to where a session has it."""

    def __init__(self, scene: Any, session: Session) -> None:
        self._scene, self._robot = scene, session.robot
        self._marked = {"axes": False, "frames": False, "traces": True, "feet": True, "robot": True}
        self._marks: dict[str, list[Any]] = {}
        self._played: Played | None = None
        self._track: object = None
        self._follow = True
        self._world = scene.add_frame("/world", show_axes=False)
        self._away = np.zeros(3)
        self._size = robot_size(session.robot)
        self._floor = Moved([put_mesh(scene, "/world/floor", floor_lines(self._size), LINES)])
        links = [scene.add_frame(link_node(link.name), show_axes=False) for link in session.robot.links]
        self._links = Moved(links)
        self._marks["robot"] = [
            put_mesh(
                scene,
                f"{link_node(session.robot.links[piece.link].name)}/body {k}",
                (piece.vertices, piece.faces),
                piece.colour,
            )
            for k, piece in enumerate(pieces_of(session.robot))
        ]
        self._circuit = LitCircuit(scene, session.robot)

    def show(self, session: Session) -> None:
        """Move everything to where the session has it."""
        if session.track is not self._track:
            self._put_up_motion(session)
        self._links.to(session.Ts)
        away = np.zeros(3)
        if self._played is not None and session.track is not None and session.sample is not None:
            self._played.show(session.sample)
            away = session.track.followed[session.sample] * [1.0, 1.0, 0.0]
        self._go_along(away)
        under = np.eye(4)[None].copy()
        under[0, :3, 3] = np.round(away / (TILE * self._size)) * TILE * self._size
        self._floor.to(under)
        self._circuit.show(session)

    def say(self, session: Session) -> None:
        """Write the numbers that stand in the scene: less often than it moves, as letters are drawn anew."""
        if self._played is not None and session.sample is not None:
            self._played.say(session.sample)

    def mark(self, what: str, visible: bool) -> None:
        """Show or hide ``axes``, ``frames``, ``traces``, ``feet`` or the ``robot``; or ``follow`` it."""
        if what == "follow":
            self._follow = visible
            return
        self._marked[what] = visible
        if visible and what in ("axes", "frames") and what not in self._marks:
            put = put_axes if what == "axes" else put_frames
            self._marks[what] = put(self._scene, self._robot)
        for handle in self._marks.get(what, ()):
            handle.visible = visible
        if self._played is not None:
            self._played.mark()
        self._look_inside()

    def circuit(self, name: str) -> None:
        """Light up a circuit of the closed mechanism by its name, or none."""
        self._circuit.name = name
        self._look_inside()

    def _look_inside(self) -> None:
        """Bodies are of glass where something within them is to be seen."""
        inside = self._marked["axes"] or self._marked["frames"] or self._circuit.name != NO_CIRCUIT
        for handle in self._marks["robot"]:
            handle.opacity = GLASS if inside else None

    def _put_up_motion(self, session: Session) -> None:
        self._track = session.track
        if self._played is not None:
            self._played.remove()
        self._played = None
        if session.track is not None:
            self._played = Played(self._scene, self._robot, session.track, self._marked)

    def _go_along(self, away: Array) -> None:
        """Move the world the other way, so that the robot stays in the picture."""
        wanted = -away if self._follow else np.zeros(3)
        if not np.array_equal(wanted, self._away):
            self._world.position = self._away = wanted


def floor_lines(size: float) -> Triangles:
    """Tiles as thin ribbons about the robot: far lines cost as much as near ones, and are hardly seen."""
    reach = FLOOR * size
    at = np.arange(-reach, reach + TILE * size / 2, TILE * size)
    ends, none = np.full_like(at, reach), np.zeros_like(at)
    along = np.stack([np.stack([at, side * ends, none], axis=1) for side in (-1, 1)], axis=1)
    return ribbons(np.concatenate([along, along[..., [1, 0, 2]]]), 0.005 * size)
