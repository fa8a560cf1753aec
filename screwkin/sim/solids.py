"""What pictures show of a robot: the triangles of its shapes, and boxes or sticks of links without any."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.dynamics.terrain import Terrain
from screwkin.errors import InputError, MissingDependencyError, RobotRemark
from screwkin.model.records import Link
from screwkin.model.robot import Robot
from screwkin.model.shapes import box_points, honours_up, shape_triangles
from screwkin.model.urdf import link_colours

STONE = (0.62, 0.60, 0.56)
"""Colour of blocks on the floor."""
_STICK = 0.012  # thickness of a link without shapes or boxes, in sizes of the robot


@dataclass(frozen=True, eq=False)
class Part:
    """Pieces of one kind.

    Attributes:
        links: (F,) index of the link that carries each.
        corners: (F, 8 or 3, 3) [m] in the zero pose, in base axes.
        colours: (F, 3) in [0, 1].
    """

    links: NDArray[np.int64]
    corners: Array
    colours: Array


@dataclass(frozen=True, eq=False)
class Solids:
    """All that is seen of a robot."""

    boxes: Part
    triangles: Part


def robot_size(robot: Robot) -> float:
    """How large a robot is [m]: the diagonal of the box around its joints, tips and centres of mass."""
    points = [as_array(joint.screw.s0) for joint in robot.tree]
    points += [as_array(limb.frame.p) for limb in robot.limbs]
    points += [as_array(link.com) for link in robot.links if link.mass]
    extent = np.ptp(np.array(points, dtype=float).reshape(-1, 3), axis=0) if points else np.zeros(3)
    return float(np.linalg.norm(extent)) or 1.0


def lines_of(robot: Robot, name: str) -> list[Array]:
    """Ends (2, 3) [m] of the lines that stand for a link without shapes, in the zero pose, in base axes.

    From its joint to the joints, closures, tips and corners of soles that it carries, and around the soles;
    to its centre of mass where it carries nothing. Of the base from their middle, to its centre of mass, too.
    """
    link, is_base = robot.links[robot.link_names.index(name)], name not in robot.joint_above
    tips = {limb.name: as_array(limb.frame.p) for limb in robot.limbs if limb.link == name}
    soles = [np.array([as_array(p) for p in sole.corners]) for sole in robot.soles if sole.limb in tips]
    ends = [as_array(joint.screw.s0) for joint in robot.tree if joint.parent == name]
    ends += [*tips.values(), *(corner for corners in soles for corner in corners)]
    for closure in robot.closures:
        ends += [as_array(closure.frame_a.p)] if closure.link_a == name else []
        ends += [as_array(closure.frame_b.p)] if closure.link_b == name else []
    middle = np.mean(ends, axis=0) if ends else as_array(link.com)
    start = middle if is_base else as_array(robot.tree[robot.joint_above[name]].screw.s0)
    if link.mass and (is_base or not ends):
        ends.append(as_array(link.com))
    lines = [np.array([start, end]) for end in ends]
    lines += [edge for corners in soles for edge in np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)]
    return [line.astype(float) for line in lines if np.linalg.norm(line[1] - line[0]) > 1e-6]


def solids_of(robot: Robot, cell: float) -> Solids:
    """Every link's shapes for pictures, else those of collision, else boxes, else sticks (``lines_of``).

    What cannot be read is a warning (``RobotRemark``), one for all of it.

    Args:
        robot: of numbers.
        cell: edge of the cubes [m] that meshes are coarsened to.
    """
    paint, upright, unread = link_colours(robot), honours_up(robot), dict[str, None]()
    boxes: list[tuple[int, Array, Array]] = []
    triangles: list[tuple[int, Array, Array]] = []
    for i, link in enumerate(robot.links):
        own = np.array(paint[link.name][:3])
        shown = _triangles(link, upright, cell, unread)
        for corners, colours in shown:
            triangles.append((i, corners, np.where(np.isnan(colours), own, colours)))
        if not shown:
            solid = np.array([box_points(box) for box in link.boxes] or _sticks(robot, link.name))
            boxes.append((i, solid.reshape(-1, 8, 3), np.tile(own, (len(solid), 1))))
    if unread:
        first, *others = unread
        more = f", and {len(others)} more files" if others else ""
        warnings.warn(f"{robot.name}: not in pictures: {first}{more}", RobotRemark, stacklevel=3)
    return Solids(_part(boxes, 8), _part(triangles, 3))


def bar_corners(segments: Array, thickness: float) -> Array:
    """Corners (N, 8, 3) of bars of a square section, in the order of ``box_points``.

    Args:
        segments: (N, 2, 3) ends, apart from each other [m].
        thickness: of the bars [m].
    """
    start, end = np.asarray(segments, dtype=float).reshape(-1, 2, 3).swapaxes(0, 1)
    along = end - start
    least = np.eye(3)[np.argmin(np.abs(along), axis=-1)]
    across, other = np.cross(along, least), np.cross(along, np.cross(along, least))
    sides = [v * (thickness / 2) / np.linalg.norm(v, axis=-1, keepdims=True) for v in (across, other)]
    corners = [
        point + i * sides[0] + j * sides[1] for point in (start, end) for i in (-1, 1) for j in (-1, 1)
    ]
    return np.stack(corners, axis=1)


def _sticks(robot: Robot, name: str) -> Array:
    return bar_corners(np.array(lines_of(robot, name)), _STICK * robot_size(robot))


def with_blocks(solids: Solids, terrain: Terrain) -> Solids:
    """The solids with the blocks of a terrain among the boxes, in the plane's frame, as link -1."""
    if not terrain.blocks:
        return solids
    back = np.linalg.inv(terrain.T_world_plane)
    corners = np.array([(back @ pose @ _box(edges))[:3].T for pose, edges in terrain.boxes()])
    corners[..., 2] = corners[..., 2].clip(0.0)
    own = solids.boxes
    links = np.full(len(corners), -1)
    colours = np.tile(STONE, (len(corners), 1))
    joined = zip((own.links, own.corners, own.colours), (links, corners, colours), strict=True)
    return replace(solids, boxes=Part(*(np.concatenate(pair) for pair in joined)))


def _box(edges: Array) -> Array:
    """Corners (4, 8) of a box about the origin, homogeneous, in the order of ``box_points``."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) / 2
    return np.vstack([(signs * edges).T, np.ones(8)])


def _triangles(link: Link, upright: bool, cell: float, unread: dict[str, None]) -> list[tuple[Array, Array]]:
    for role in ("visual", "collision"):
        shown = []
        for shape in link.shapes:
            if shape.role == role:
                try:
                    shown.append(shape_triangles(shape, upright, cell))
                except (InputError, MissingDependencyError) as wrong:
                    unread[str(wrong)] = None
        if shown:
            return shown
    return []


def _part(pieces: list[tuple[int, Array, Array]], count: int) -> Part:
    """Pieces of so many corners as one part."""
    links = [np.full(len(corners), link) for link, corners, _ in pieces]
    none = np.zeros((0, 3))
    return Part(
        np.concatenate([np.zeros(0, dtype=np.int64), *links]),
        np.concatenate([np.zeros((0, count, 3)), *(corners for _, corners, _ in pieces)]),
        np.concatenate([none, *(colours for _, _, colours in pieces)]),
    )
