"""The extent of shapes and links: points whose convex hull is theirs, in the zero pose, in base axes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, leaves
from screwkin.errors import InputError, MissingDependencyError
from screwkin.model.meshes import hull_faces, load_mesh, upward_axis
from screwkin.model.records import Box, Link, RobotRecord, Shape, ShapeRole

Faces = NDArray[np.int64]

_SIGNS = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
_STEP = math.radians(15)  # between points of round faces: their chords are 0.9 % of a radius inside
_FINE = math.radians(1)  # of cylinders: the flats of feet that lie on their sides tilt by less than noise
_LEVEL = 1e-12  # a component of an axis that counts as none
_NEAR = 0.05  # of a mesh's diagonal: what axes may miss it by


def shape_points(shape: Shape, upright: bool = True) -> Array:
    """Points (N, 3) [m] whose convex hull is that of a shape, in base axes.

    Args:
        shape: of numbers.
        upright: turn COLLADA meshes as their files ask for; see ``honours_up``.

    Raises:
        InputError: its mesh cannot be read.
        MissingDependencyError: trimesh is absent.
    """
    T = as_array(shape.pose)
    return _own_points(shape, upright) @ T[:3, :3].T + T[:3, 3]


def shape_triangles(shape: Shape, upright: bool = True, cell: float = 0.0) -> tuple[Array, Array]:
    """Corners (F, 3, 3) [m] of a shape's triangles in base axes, and their colours (F, 3), NaN if unknown.

    Args:
        shape: of numbers.
        upright: as of ``shape_points``.
        cell: edge of the cubes [m] within each of which vertices of a mesh become one; 0 for all of them.

    Raises:
        InputError: its mesh cannot be read.
        MissingDependencyError: trimesh is absent.
    """
    if shape.kind == "mesh":
        mesh, own = load_mesh(shape.file), _vertices(shape, upright)
        faces, kept = _coarse(own, mesh.faces, cell)
        colours = mesh.colours[kept]
    else:
        own = _own_points(shape, upright)
        faces = hull_faces(own)
        colours = np.full(faces.shape, np.nan)
    if shape.colour:
        colours = np.broadcast_to(shape.colour, faces.shape)
    T = as_array(shape.pose)
    return (own @ T[:3, :3].T + T[:3, 3])[faces], colours


def _coarse(points: Array, faces: Faces, cell: float) -> tuple[Faces, Faces]:
    """Faces between one vertex of every cube that holds any, each once, and which faces they were.

    Faces of which two corners lie in one cube are left out.
    """
    if cell <= 0:
        return faces, np.arange(len(faces))
    cubes = np.floor(points / cell).astype(np.int64)
    _, first, cube = np.unique(_keys(cubes - cubes.min(axis=0)), return_index=True, return_inverse=True)
    merged = cube[faces]
    ordered = np.sort(merged, axis=1)
    whole = np.flatnonzero((np.diff(ordered) > 0).all(axis=1))
    _, once = np.unique(_keys(ordered[whole]), return_index=True)
    return first[merged[whole[once]]], whole[once]


def _keys(rows: Faces) -> Faces:
    """One number for each row of three that are not negative."""
    most = rows.max(axis=0, initial=0) + 1
    return np.asarray((rows[:, 0] * most[1] + rows[:, 1]) * most[2] + rows[:, 2])


def box_points(box: Box) -> Array:
    """The corners (8, 3) [m] of a box, in base axes."""
    return as_array(box.center) + 0.5 * _SIGNS * as_array(box.size)


def _vertices(shape: Shape, upright: bool) -> Array:
    """Of a mesh, in the shape's frame."""
    mesh = load_mesh(shape.file)
    return (mesh.vertices @ mesh.turn.T if upright else mesh.vertices) * np.array(shape.size, dtype=float)


def _own_points(shape: Shape, upright: bool) -> Array:
    """In the shape's frame."""
    size = np.array(shape.size, dtype=float)
    if shape.kind == "mesh":
        mesh = load_mesh(shape.file)
        return (mesh.corners @ mesh.turn.T if upright else mesh.corners) * size
    if shape.kind == "box":
        return 0.5 * _SIGNS * size
    radius, half = size[0], size[-1] / 2
    if shape.kind == "cylinder":
        return np.concatenate([_ring(radius, end, _FINE) for end in (-half, half)])
    if shape.kind == "sphere":
        return _sphere(radius)
    return np.concatenate([_sphere(radius) + np.array([0, 0, end]) for end in (-half, half)])


def _ring(radius: float, z: float, step: float = _STEP) -> Array:
    angles = np.arange(0, 2 * math.pi - step / 2, step)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(len(angles), z)])


def _sphere(radius: float) -> Array:
    latitudes = np.arange(-math.pi / 2, math.pi / 2 + _STEP / 2, _STEP)
    rings = [_ring(radius * math.cos(a), radius * math.sin(a)) for a in latitudes[1:-1]]
    return np.concatenate([*rings, [(0, 0, -radius), (0, 0, radius)]])


@dataclass(frozen=True, eq=False)
class LinkPoints:
    """Points (N, 3) [m] of every link that has any, in base axes, and remarks on what could not be read."""

    points: Mapping[str, Array]
    remarks: tuple[str, ...]


def link_points(robot: RobotRecord, role: ShapeRole | None = None) -> LinkPoints:
    """Points of the boxes and shapes of all links; meshes that cannot be read are remarks.

    Args:
        robot: of numbers.
        role: of the shapes; None for all of them. Boxes are those of contact: with ``visual`` they stand in
            where a link has nothing else to show.
    """
    upright, unread = honours_up(robot), dict[str, list[str]]()
    points: dict[str, Array] = {}
    for link in robot.links:
        clouds, seen = [], set[object]()
        for shape in link.shapes:
            key = (shape.file, *shape.size, *leaves(shape.pose))
            if role in (None, shape.role) and key not in seen:
                seen.add(key)
                try:
                    clouds.append(shape_points(shape, upright))
                except (InputError, MissingDependencyError) as wrong:
                    unread.setdefault(str(wrong), []).append(link.name)
        if role != "visual" or not clouds:
            clouds += map(box_points, link.boxes)
        if clouds:
            points[link.name] = np.concatenate(clouds)
    remarks = [f"{text} (of {', '.join(dict.fromkeys(names))})" for text, names in unread.items()]
    return LinkPoints(points, tuple(remarks))


def honours_up(robot: RobotRecord) -> bool:
    """Whether meshes with another axis up than z are meant to be turned.

    COLLADA files say which axis is up; RViz and Pinocchio ignore it, PyBullet and Blender honour it, and the
    files of a robot suit either. So the robot decides: the reading in which more of its joints' axes cross,
    and more of its centres of mass lie within, the boxes around its meshes; as the files say, if both suit.
    The smallest files are asked first, and no more of them than can change what comes out.
    """
    meshes = [(link, shape) for link in robot.links for shape in link.shapes if _is_turned(shape)]
    lines = {link.name: _lines(robot, link) for link, _ in meshes}
    votes, open_votes = 0, sum(len(lines[link.name]) for link, _ in meshes)
    for link, shape in sorted(meshes, key=lambda pair: Path(pair[1].file).stat().st_size):
        if votes >= open_votes or votes < -open_votes:
            break
        open_votes -= len(lines[link.name])
        try:
            votes += _suits(lines[link.name], shape, True) - _suits(lines[link.name], shape, False)
        except (InputError, MissingDependencyError):
            continue
    return votes >= 0


def _is_turned(shape: Shape) -> bool:
    """Whether a shape is a mesh whose file calls another axis than z up."""
    try:
        return shape.file.lower().endswith(".dae") and upward_axis(shape.file) != "Z"
    except InputError:
        return False


def _lines(robot: RobotRecord, link: Link) -> list[tuple[Array, Array]]:
    """A point and a direction of the axes of a link's joints; its CoM, without direction."""
    com = [(as_array(link.com), np.zeros(3))] if link.mass else []
    return com + [
        (as_array(joint.screw.s0), as_array(joint.screw.s))
        for joint in robot.tree
        if link.name in (joint.parent, joint.child) and joint.type == "revolute"
    ]


def _suits(lines: Sequence[tuple[Array, Array]], shape: Shape, upright: bool) -> int:
    """How many lines meet the box around a mesh."""
    T, own = as_array(shape.pose), _vertices(shape, upright)
    low, high = own.min(axis=0), own.max(axis=0)
    near = _NEAR * np.linalg.norm(high - low)
    R, p = T[:3, :3], T[:3, 3]
    return sum(_meets((at - p) @ R, s @ R, low - near, high + near) for at, s in lines)


def _meets(point: Array, direction: Array, low: Array, high: Array) -> bool:
    """Whether the line through a point crosses a box, or the point without direction lies in it, by slabs."""
    along = np.where(np.abs(direction) < _LEVEL, _LEVEL, direction)
    ends = np.sort(np.array([low - point, high - point]) / along, axis=0)
    nearest, farthest = ends[0].max(), ends[1].min()
    return bool(nearest <= farthest and (direction.any() or nearest <= 0.0 <= farthest))
