"""A motion in the scene: its ZMP, GCoM and CoM with their ways, its soles and support polygons, its floor."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.model.robot import Robot
from screwkin.sim.solids import robot_size
from screwkin.viewer.nodes import Moved, Redrawn, put_mesh
from screwkin.viewer.scene import STANDING, pieces_of
from screwkin.viewer.strokes import bars, legs_of, ribbons, thinned
from screwkin.viewer.track import Track

ZMP, GCOM = (166, 38, 110), (43, 120, 80)
POLYGON, SOLE = (90, 105, 125), (60, 120, 190)
ACCURACY = 1e-3
"""How far a drawn way may lie from the way itself, in sizes of the robot."""


class Played:
    """What is seen of one motion beside the robot."""

    def __init__(self, scene: Any, robot: Robot, track: Track, shown: dict[str, bool]) -> None:
        self._track, self._shown, self._scene = track, shown, scene
        self._size = size = robot_size(robot)
        self._paths = {"ZMP": track.zmp, "GCoM": track.gcom, "CoM": track.com}
        balls = [
            scene.add_icosphere(
                f"/world/motion/{name}",
                radius=0.02 * size,
                color=ZMP if name == "ZMP" else GCOM,
                subdivisions=2,
                cast_shadow=False,
                receive_shadow=False,
            )
            for name in self._paths
        ]
        self._balls = Moved(balls)
        self._label = scene.add_label("/world/motion/ZMP/label", "ZMP")
        ways = [self._way(name, path) for name, path in self._paths.items()]
        self._traces = [self._label, *balls, *ways]  # it goes before the ball that carries it
        self._polygon = Redrawn(scene, "/world/motion/polygon", POLYGON)
        self._soles = [Redrawn(scene, f"/world/motion/sole {k}", SOLE) for k in range(len(track.soles))]
        self._drawn: dict[str, bytes] = {}
        self._blocks = [
            put_mesh(scene, f"/world/motion/block {k}", (piece.vertices, piece.faces), piece.colour)
            for k, piece in enumerate([] if track.terrain.flat else pieces_of(robot, terrain=track.terrain))
            if piece.link == STANDING
        ]
        self.mark()

    def show(self, sample: int) -> None:
        """Move everything to a sample of the motion."""
        places = np.tile(np.eye(4), (len(self._paths), 1, 1))
        places[:, :3, 3] = [path[sample] for path in self._paths.values()]
        self._balls.to(places)
        track, feet = self._track, self._shown["feet"]
        self._outline("polygon", self._polygon, track.polygon(sample), feet)
        for k, (sole, node) in enumerate(zip(track.soles, self._soles, strict=True)):
            self._outline(f"sole {k}", node, sole[sample], feet and bool(track.contact[sample, k]))

    def say(self, sample: int) -> None:
        """Write the ZMP beside its ball."""
        x, y, _ = 1e3 * self._track.zmp[sample]
        self._label.text = f"ZMP {x:.0f}, {y:.0f} mm"

    def mark(self) -> None:
        """Show and hide what is marked to be shown."""
        for handle in self._traces:
            handle.visible = self._shown["traces"]
        for handle in self._blocks:
            handle.visible = self._shown["feet"]

    def remove(self) -> None:
        """Take all of it out of the scene."""
        for handle in (*self._traces, *self._blocks, self._polygon, *self._soles):
            handle.remove()

    def _way(self, name: str, path: Array) -> Any:
        """The line of a point over the whole motion; on the floor a ribbon just above it."""
        size, floor = self._size, name != "CoM"
        lifted = path + np.array([0.0, 0.0, 0.003 * size * floor])
        legs = legs_of(lifted[thinned(lifted, ACCURACY * size)])
        shape = ribbons(legs, 0.005 * size) if floor else bars(legs, 0.004 * size)
        return put_mesh(self._scene, f"/world/motion/{name} trace", shape, ZMP if name == "ZMP" else GCOM)

    def _outline(self, name: str, node: Redrawn, corners: Array, visible: bool) -> None:
        """The border of a polygon (k, 3), drawn anew only where it is another."""
        key = corners.round(6).tobytes() if visible else b""
        if self._drawn.get(name) != key:
            self._drawn[name] = key
            lines = legs_of(corners, closed=True) if visible else np.zeros((0, 2, 3))
            node.as_(bars(lines, 0.007 * self._size), visible and len(lines) > 0)
