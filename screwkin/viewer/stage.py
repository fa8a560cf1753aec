"""The scene of the browser viewer: what ``scene`` and ``marks`` describe, put up once and then moved."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.dynamics.terrain import Terrain
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.mechanism import Mechanism
from screwkin.viewer.marks import axes_of, frames_of, way_of
from screwkin.viewer.scene import STANDING, pieces_of, size_of
from screwkin.viewer.session import Session
from screwkin.viewer.track import Track

NO_CIRCUIT = "none"
ZMP, GCOM = (166, 38, 110), (43, 120, 80)
FLOOR = 12.0
"""How far the lines of the floor reach, in sizes of the robot."""
LINES = (205, 208, 212)
POLYGON, SOLE = (90, 105, 125), (60, 120, 190)
TURNS, SLIDES = (214, 120, 20), (20, 130, 170)
REAL, VIRTUAL = (230, 60, 30), (150, 110, 220)


class Stage:
    """What stands in the scene of a viser server; ``show`` moves it to where a session has it."""

    def __init__(self, scene: Any, session: Session) -> None:
        self._scene, self._robot = scene, session.robot
        self.size = size_of(session.robot)
        self._links: list[Any] = []
        self._marks: dict[str, list[Any]] = {"axes": [], "frames": [], "traces": [], "feet": [], "robot": []}
        self._shown = {"axes": False, "frames": False, "traces": True, "feet": True, "robot": True}
        self._track: Track | None = None
        self._moving: dict[str, Any] = {}
        self._circuit = NO_CIRCUIT
        self._world = scene.add_frame("/world", show_axes=False)
        self._follow = True
        self._put_up_floor()
        self._put_up_robot()

    def show(self, session: Session) -> None:
        """Move everything to where the session has it."""
        if session.track is not self._track:
            self._put_up_track(session.track)
        Ts = session.Ts
        for handle, (position, wxyz) in zip(self._links, _placed(Ts), strict=True):
            handle.position, handle.wxyz = position, wxyz
        away = np.zeros(3)
        if session.track is not None and session.sample is not None:
            self._show_sample(session.track, session.sample)
            away = session.track.followed[session.sample] * [1.0, 1.0, 0.0]
        self._world.position = -away if self._follow else np.zeros(3)
        self._show_circuit(session, Ts)

    def mark(self, what: str, visible: bool) -> None:
        """Show or hide ``axes``, ``frames``, ``traces``, ``feet`` or the ``robot``; or ``follow`` it."""
        if what == "follow":
            self._follow = visible
            return
        self._shown[what] = visible
        for handle in self._marks[what]:
            handle.visible = visible

    def circuit(self, name: str) -> None:
        """Light up a circuit of the closed mechanism by its name, or none."""
        self._circuit = name

    def _put_up_floor(self) -> None:
        """Thin lines: a shader that draws an endless grid costs most of a picture without a graphics card."""
        reach, step = FLOOR * self.size, self.size / 4
        at = np.arange(-reach, reach + step / 2, step)
        ends = np.full_like(at, reach)
        along = np.stack([np.stack([at, side * ends, 0 * at], axis=1) for side in (-1, 1)], axis=1)
        lines = np.concatenate([along, along[..., [1, 0, 2]]])
        self._scene.add_line_segments("/world/floor", lines, LINES, thickness=1.0, thickness_units="screen")

    def _put_up_robot(self) -> None:
        scene, robot = self._scene, self._robot
        self._links = [scene.add_frame(f"/world/robot/{link.name}", show_axes=False) for link in robot.links]
        for k, piece in enumerate(pieces_of(robot)):
            name = f"/world/robot/{robot.links[piece.link].name}/body {k}"
            self._marks["robot"].append(
                scene.add_mesh_simple(
                    name,
                    piece.vertices,
                    piece.faces,
                    color=piece.colour,
                    flat_shading=True,
                    side="double",
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )
        for axis in axes_of(robot):
            name = f"/world/robot/{robot.links[axis.link].name}/axis {axis.joint}"
            colour = SLIDES if axis.slides else TURNS
            self._marks["axes"] += [
                scene.add_line_segments(
                    name, axis.ends[None], colour, thickness=0.006 * self.size, visible=False
                ),
                scene.add_label(f"{name}/name", axis.joint, position=axis.ends[1], visible=False),
            ]
        for frame in frames_of(robot):
            wxyz, p = _quaternions(frame.pose[None, :3, :3])[0], frame.pose[:3, 3]
            self._marks["frames"].append(
                scene.add_frame(
                    f"/world/robot/{robot.links[frame.link].name}/frame {frame.name}",
                    axes_length=0.12 * self.size,
                    axes_radius=0.006 * self.size,
                    position=p,
                    wxyz=wxyz,
                    visible=False,
                )
            )

    def _put_up_track(self, track: Track | None) -> None:
        """Traces, soles and markers of another motion."""
        self._track = track
        scene, thick = self._scene, 0.005 * self.size
        for what in ("traces", "feet"):
            for handle in self._marks[what]:
                handle.remove()
            self._marks[what] = []
        self._moving = {}
        if track is None:
            return
        lift = np.array([0.0, 0.0, 0.003 * self.size])
        for name, path, colour in (
            ("ZMP", track.zmp, ZMP),
            ("GCoM", track.gcom, GCOM),
            ("CoM", track.com, GCOM),
        ):
            ball = scene.add_icosphere(f"/world/motion/{name}", radius=0.02 * self.size, color=colour)
            line = scene.add_line_segments(
                f"/world/motion/{name} trace",
                _segments(path + lift * (name != "CoM")),
                colour,
                thickness=thick / 2,
            )
            self._moving[name] = ball
            self._marks["traces"] += [ball, line]
        self._moving["label"] = scene.add_label("/world/motion/ZMP/label", "ZMP")
        self._marks["traces"].append(self._moving["label"])
        empty = np.zeros((1, 2, 3))
        for name, colour in (("polygon", POLYGON), *((f"sole {k}", SOLE) for k in range(len(track.soles)))):
            line = scene.add_line_segments(f"/world/motion/{name}", empty, colour, thickness=thick)
            self._moving[name] = line
            self._marks["feet"].append(line)
        self._put_up_blocks(track.terrain)
        for what in ("traces", "feet"):
            self.mark(what, self._shown[what])

    def _put_up_blocks(self, terrain: Terrain) -> None:
        if terrain.flat:
            return
        for k, piece in enumerate(pieces_of(self._robot, terrain=terrain)):
            if piece.link == STANDING:
                self._marks["feet"].append(
                    self._scene.add_mesh_simple(
                        f"/world/motion/block {k}",
                        piece.vertices,
                        piece.faces,
                        color=piece.colour,
                        side="double",
                    )
                )

    def _show_sample(self, track: Track, k: int) -> None:
        moving = self._moving
        for name, path in (("ZMP", track.zmp), ("GCoM", track.gcom), ("CoM", track.com)):
            moving[name].position = path[k]
        x, y, _ = 1e3 * track.zmp[k]
        moving["label"].text = f"ZMP {x:.0f}, {y:.0f} mm"
        _draw(moving["polygon"], _closed(track.polygon(k)))
        for i, sole in enumerate(track.soles):
            _draw(moving[f"sole {i}"], _closed(sole[k]) if track.contact[k, i] else np.zeros((0, 2, 3)))

    def _show_circuit(self, session: Session, Ts: Array) -> None:
        name = "/world/circuit"
        if self._circuit == NO_CIRCUIT:
            if "circuit" in self._moving:
                self._moving.pop("circuit").remove()
            return
        way = way_of(_mechanism(self._robot), self._circuit, Ts, session.T_world_base)
        colours = np.array([[VIRTUAL if v else REAL] * 2 for v in way.virtual], dtype=np.uint8)
        key = (self._circuit, Ts.tobytes())
        if getattr(self, "_lit", None) != key:
            self._lit = key
            self._moving["circuit"] = self._scene.add_line_segments(
                name, way.legs, colours, thickness=0.012 * self.size
            )


def circuits_of(robot: Any) -> tuple[str, ...]:
    """Names of the circuits of a robot's closed mechanism, none where it has none."""
    from screwkin.errors import ScrewkinError

    try:
        return _mechanism(robot).circuit_names
    except ScrewkinError:
        return ()


def _mechanism(robot: Any) -> Mechanism:
    return closed_mechanism(robot)


def _quaternions(R: Array) -> Array:
    """Unit quaternions wxyz (N, 4) of rotations (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(np.roll(Rotation.from_matrix(R).as_quat(), 1, axis=-1))


def _placed(Ts: Array) -> list[tuple[Array, Array]]:
    """Position and quaternion of every link."""
    return list(zip(Ts[:, :3, 3], _quaternions(Ts[:, :3, :3]), strict=True))


def _segments(path: Array) -> Array:
    """A path (T, 3) as segments (T - 1, 2, 3)."""
    return np.stack([path[:-1], path[1:]], axis=1)


def _closed(corners: Array) -> Array:
    """The border of a polygon (k, 3) as segments (k, 2, 3)."""
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def _draw(line: Any, segments: Array) -> None:
    """Give a line other segments, where they are others."""
    shown = segments if len(segments) else np.zeros((1, 2, 3))
    shown = shown.astype(np.float32)
    if shown.shape != line.points.shape or not np.array_equal(shown, line.points):
        line.points = shown
