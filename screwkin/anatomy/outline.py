"""Where the surfaces of links are, loaded link by link: only few of a robot's meshes say how it stands."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.model.inertias import inertia_matrix
from screwkin.model.records import Link, RobotRecord
from screwkin.model.robot import Robot
from screwkin.model.shapes import link_points

WHOLE = 0.5
"""Greatest diagonal of a solid box that may stand for a link, by the robot's size."""


class Outline:
    """Points of a robot's links in base axes, zero pose; ``remarks`` says which meshes could not be read.

    A link's collision shapes and boxes count; where it has none, its pictures; without these, no points.
    """

    def __init__(self, robot: Robot, size: float) -> None:
        self.robot, self.size = robot, size
        self.remarks: dict[str, None] = {}
        self._points: dict[str, Array] = {}

    def of(self, links: Iterable[str]) -> Array:
        """Points (N, 3) [m] of links, none of what has no surface."""
        names = list(links)
        new = [name for name in names if name not in self._points]
        if new:
            self._load(new)
        clouds = [self._points[name] for name in names]
        return np.concatenate([*clouds, np.zeros((0, 3))])

    def _load(self, names: list[str]) -> None:
        def part(chosen: list[str]) -> RobotRecord:
            values = {f.name: getattr(self.robot, f.name) for f in fields(RobotRecord)}
            return RobotRecord(**values | {"links": tuple(self.robot.link(name) for name in chosen)})

        bare_robot = not any(link.shapes or link.boxes for link in self.robot.links)
        touched = link_points(part(names), "collision")
        bare = [name for name in names if name not in touched.points]
        seen = link_points(part(bare), "visual")
        for name in bare:
            link = self.robot.link(name)
            if name not in seen.points and (link.shapes or bare_robot) and link.mass:
                solid = _solid(link)
                if np.linalg.norm(solid[-1] - solid[0]) > WHOLE * self.size:
                    continue  # moments that no link of this robot can have
                self._points[name] = solid
                self.remarks[f"{name}: no surface can be read; a solid box of its inertia stands for it"] = (
                    None
                )
        names = [name for name in names if name not in self._points]
        empty = {name: np.zeros((0, 3)) for name in names}
        self._points |= {**empty, **seen.points, **touched.points}
        self.remarks |= dict.fromkeys((*touched.remarks, *seen.remarks))

    def roughly(self, links: Iterable[str]) -> Array:
        """One point for every link (N, 3) [m], whatever its surface: its CoM, or its frame if massless."""
        chosen = [self.robot.link(name) for name in links]
        points = [as_array(link.com if link.mass else link.frame.p) for link in chosen]
        return np.array(points, dtype=float).reshape(-1, 3)


def _solid(link: Link) -> Array:
    """Corners (8, 3) [m] of the solid box with a link's mass and moments of inertia, which no surface shows.

    For edges a, b, c the principal moments are m (b^2 + c^2) / 12 and so on, so that m a^2 = 6 (J - 2 Ja)
    with the sum J of all three.
    """
    moments, axes = np.linalg.eigh(inertia_matrix(link.inertia))
    edges = np.sqrt(np.maximum(6 * (moments.sum() - 2 * moments) / float(link.mass), 0))
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
    return np.asarray(as_array(link.com).astype(float) + 0.5 * (signs * edges) @ axes.T)
