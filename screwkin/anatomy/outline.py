"""Where the surfaces of links are, loaded link by link: only few of a robot's meshes say how it stands."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Robot
from screwkin.model.shapes import link_points


class Outline:
    """Points of a robot's links in base axes, zero pose; ``remarks`` says which meshes could not be read.

    A link's collision shapes and boxes count; where it has none, its pictures; without these, no points.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
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
        from dataclasses import fields

        from screwkin.model.records import RobotRecord

        def part(chosen: list[str]) -> RobotRecord:
            values = {f.name: getattr(self.robot, f.name) for f in fields(RobotRecord)}
            return RobotRecord(**values | {"links": tuple(self.robot.link(name) for name in chosen)})

        touched = link_points(part(names), "collision")
        bare = [name for name in names if name not in touched.points]
        seen = link_points(part(bare), "visual")
        self._points |= {name: np.zeros((0, 3)) for name in names} | seen.points | touched.points
        self.remarks |= dict.fromkeys((*touched.remarks, *seen.remarks))

    def lowest(self, links: Iterable[str], up: Array) -> float:
        """Height of the lowest point of links along a direction [m]; of their frames where none has points."""
        names = list(links)
        points = self.of(names)
        if not len(points):
            points = np.array([as_array(self.robot.link(name).frame.p) for name in names], dtype=float)
        return float((points @ up).min())
