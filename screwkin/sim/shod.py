"""Feet that stand on all of their soles, for an engine that knows boxes alone.

A sole is the table's, found in what a foot looks like, or written by hand; boxes are what the file's authors
let collide. Where boxes end above the sole or short of it, the robot would stand on less than it was planned
for: on a strip of 10 mm, if that is what protrudes. A small cube in every such corner carries it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Vector, as_array
from screwkin.model.records import Box, Link
from screwkin.model.robot import Robot

CUBE = 1e-3
"""Edge of the cubes [m]."""
_CARRIED = 1e-4  # m: how far a corner may lie from the box that carries it


def shod(robot: Robot) -> Robot:
    """The robot with a cube in every corner of a sole that no box of its link carries.

    Args:
        robot: of numbers.
    """
    cubes = {
        robot.limb(sole.limb).link: list(_cubes(robot.link(robot.limb(sole.limb).link), sole.corners))
        for sole in robot.soles
    }
    if not any(cubes.values()):
        return robot
    links = tuple(
        replace(link, boxes=(*link.boxes, *cubes[link.name])) if cubes.get(link.name) else link
        for link in robot.links
    )
    return replace(robot, links=links)


def _cubes(link: Link, corners: tuple[Vector, ...]) -> Iterator[Box]:
    """Cubes whose lowest points, along the sole's normal, are the corners that no box carries."""
    points = np.array([as_array(corner) for corner in corners], dtype=float)
    across = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)
    up = across / np.linalg.norm(across)
    for point in points:
        if not any(_holds(box, point) for box in link.boxes):
            x, y, z = (point + 0.5 * CUBE * np.abs(up).sum() * up).tolist()
            yield Box(Vector(x, y, z), Vector(CUBE, CUBE, CUBE))


def _holds(box: Box, point: Array) -> bool:
    """Whether a point (3,) lies in a box, or on it."""
    away = np.abs(point - np.asarray(as_array(box.center), dtype=float))
    return bool((away <= 0.5 * np.asarray(as_array(box.size), dtype=float) + _CARRIED).all())
