"""Where the surfaces of links are, loaded link by link: only few of a robot's meshes say how it stands."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.errors import InputError, MissingDependencyError
from screwkin.model.inertias import inertia_matrix
from screwkin.model.records import Link, Shape, ShapeRole
from screwkin.model.robot import Robot
from screwkin.model.shapes import box_points, honours_up, shape_points

WHOLE = 0.5
"""Greatest diagonal of a solid box that may stand for a link, by the robot's size."""


class Outline:
    """Points of a robot's links in base axes, zero pose.

    A link's collision shapes and boxes count; where it has none, its pictures; where these cannot be read,
    the solid box with its inertia (``guessed``). ``unread`` lists for every such link what went wrong.
    """

    def __init__(self, robot: Robot, size: float) -> None:
        self.robot, self.size = robot, size
        self.unread: dict[str, list[str]] = {}
        self.guessed = list[str]()
        self._points: dict[str, Array] = {}

    def of(self, links: Iterable[str]) -> Array:
        """Points (N, 3) [m] of links, none of what has no surface."""
        names = list(links)
        for name in names:
            if name not in self._points:
                self._points[name] = self._load(name)
        return np.concatenate([*(self._points[name] for name in names), np.zeros((0, 3))])

    def _load(self, name: str) -> Array:
        """Points of one link."""
        link = self.robot.link(name)
        touched = self._clouds(link, "collision") + [box_points(box) for box in link.boxes]
        clouds = touched or self._clouds(link, "visual")
        if clouds:
            return np.concatenate(clouds)
        if link.mass and (link.shapes or self._bare):
            solid = _solid(link)
            if np.linalg.norm(solid[-1] - solid[0]) <= WHOLE * self.size:  # else no moments of this robot
                self.guessed.append(name)
                return solid
        return np.zeros((0, 3))

    def _clouds(self, link: Link, role: ShapeRole) -> list[Array]:
        clouds = []
        for shape in link.shapes:
            if shape.role == role:
                try:
                    clouds.append(shape_points(shape, self._upright(shape)))
                except (InputError, MissingDependencyError) as wrong:
                    self.unread.setdefault(link.name, []).append(str(wrong))
        return clouds

    def _upright(self, shape: Shape) -> bool:
        """Whether files that say which axis is up are believed: asked of all meshes, once one says so."""
        return not shape.file.lower().endswith(".dae") or self._honours

    @cached_property
    def _honours(self) -> bool:
        return honours_up(self.robot)

    @cached_property
    def _bare(self) -> bool:
        """Whether no link has any shape."""
        return not any(link.shapes or link.boxes for link in self.robot.links)

    @property
    def remarks(self) -> list[str]:
        """What a user should know of the meshes."""
        texts = []
        if self.unread:
            first = next(iter(self.unread.values()))[0]
            texts.append(f"meshes of {', '.join(self.unread)} cannot be read; {first}")
        if self.guessed:
            texts.append(f"boxes of their inertia stand for {', '.join(self.guessed)}")
        return texts

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
