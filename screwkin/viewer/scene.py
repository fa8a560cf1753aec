"""What a robot looks like, as triangles by link: for the browser viewer and for pages that play a motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import IDENTITY, as_array, unstack
from screwkin.dynamics.terrain import FLAT, Terrain
from screwkin.kinematics.positions import link_displacements
from screwkin.model.robot import Robot
from screwkin.model.state import reference_base, reference_posture
from screwkin.model.urdf import link_colours
from screwkin.sim.solids import Part, solids_of, with_blocks

STANDING = -1
"""Index of what no link carries: the blocks on the floor."""
FINE, COARSE = 1 / 400, 1 / 60
"""Edge of the cubes that meshes are coarsened to, in sizes of the robot: on a screen, and in a page."""
_STICK = 0.012  # thickness of a link without shapes or boxes, in sizes of the robot
_SIDES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Piece:
    """Triangles of one colour on one link.

    Attributes:
        link: index of the link that carries it, or ``STANDING``.
        vertices: (V, 3) [m] in the zero pose, in base axes; so a link's displacement carries them.
        faces: (F, 3) indices of vertices, in turn about the normal that points out.
        colour: red, green, blue in [0, 255].
    """

    link: int
    vertices: Array
    faces: NDArray[np.int64]
    colour: tuple[int, int, int]


def size_of(robot: Robot) -> float:
    """How large a robot is [m]: the diagonal of the box around its joints, tips and centres of mass."""
    points = [as_array(joint.screw.s0) for joint in robot.tree]
    points += [as_array(limb.frame.p) for limb in robot.limbs]
    points += [as_array(link.com) for link in robot.links if link.mass]
    extent = np.ptp(np.array(points, dtype=float).reshape(-1, 3), axis=0) if points else np.zeros(3)
    return float(np.linalg.norm(extent)) or 1.0


def pieces_of(robot: Robot, fineness: float = FINE, terrain: Terrain = FLAT) -> list[Piece]:
    """All that is seen of a robot: shapes, else boxes, else sticks from joint to joint.

    What cannot be read is a warning (``RobotRemark``).

    Args:
        robot: of numbers.
        fineness: edge of the cubes that meshes are coarsened to, in sizes of the robot.
        terrain: with blocks that are shown too.
    """
    solids = with_blocks(solids_of(robot, fineness * size_of(robot)), terrain)
    seen = {int(link) for part in (solids.boxes, solids.triangles) for link in part.links}
    pieces = [*_pieces(solids.boxes, _SIDES), *_pieces(solids.triangles, np.arange(3)[None])]
    pieces = [_on_plane(piece, terrain) if piece.link == STANDING else piece for piece in pieces]
    paint, thick = link_colours(robot), _STICK * size_of(robot)
    for i, link in enumerate(robot.links):
        if i not in seen:
            red, green, blue = _bytes(np.array(paint[link.name][:3])).tolist()
            pieces += [
                Piece(i, _stick(start, end, thick), _SIDES, (red, green, blue))
                for start, end in lines_of(robot, link.name)
            ]
    return pieces


def lines_of(robot: Robot, name: str) -> list[Array]:
    """Ends (2, 3) [m] of the lines from a link's joint to the joints, closures and tips that it carries.

    In the zero pose, in base axes; of the base link from its first joint.
    """
    ends = [as_array(joint.screw.s0) for joint in robot.tree if joint.parent == name]
    ends += [as_array(limb.frame.p) for limb in robot.limbs if limb.link == name]
    for closure in robot.closures:
        ends += [as_array(closure.frame_a.p)] if closure.link_a == name else []
        ends += [as_array(closure.frame_b.p)] if closure.link_b == name else []
    if name in robot.joint_above:
        start = as_array(robot.tree[robot.joint_above[name]].screw.s0)
    elif ends:
        start = ends[0]
    return [np.stack([start, end]).astype(float) for end in ends if np.linalg.norm(end - start) > 1e-6]


def displacements(robot: Robot, T_world_base: Array, q: Array) -> Array:
    """What carries every link's pieces from the zero pose into the world, (..., L, 4, 4).

    Args:
        robot: of numbers.
        T_world_base: (..., 4, 4).
        q: (..., n) [rad or m].
    """
    carried = link_displacements(robot, unstack(np.asarray(q, dtype=float)))
    batch = np.shape(q)[:-1]
    stacked = np.stack([as_array(D @ IDENTITY, batch) for D in carried], axis=-3)
    return np.asarray(np.asarray(T_world_base, dtype=float)[..., None, :, :] @ stacked)


def standing(robot: Robot) -> tuple[Array, Array]:
    """T_world_base (4, 4) and q (n,) at which a robot is shown first: ``home``, else the first posture."""
    return as_array(reference_base(robot)).astype(float), np.array(reference_posture(robot), dtype=float)


def _pieces(part: Part, faces: NDArray[np.int64]) -> Iterator[Piece]:
    """The pieces of a part, joined where link and colour are the same; equal vertices are one."""
    colours = _bytes(part.colours)
    keys = np.column_stack([part.links, colours])
    for key in np.unique(keys, axis=0) if len(keys) else ():
        corners = part.corners[(keys == key).all(axis=1)]
        every = corners.reshape(-1, 3)
        within = (faces[None] + corners.shape[1] * np.arange(len(corners))[:, None, None]).reshape(-1, 3)
        vertices, index = np.unique(every, axis=0, return_inverse=True)
        link, red, green, blue = map(int, key)
        yield Piece(link, vertices, index.reshape(-1)[within], (red, green, blue))


def _on_plane(piece: Piece, terrain: Terrain) -> Piece:
    """The piece in world axes, from those of the terrain's plane."""
    T = terrain.T_world_plane
    return replace(piece, vertices=piece.vertices @ T[:3, :3].T + T[:3, 3])


def _bytes(colours: Array) -> NDArray[np.int64]:
    return np.rint(255 * np.clip(colours, 0.0, 1.0)).astype(np.int64)


def _stick(start: Array, end: Array, thick: float) -> Array:
    """Corners (8, 3) of a thin bar between two points."""
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across *= thick / 2 / np.linalg.norm(across)
    other = np.cross(along, across)
    return np.array([p + i * across + j * other for p in (start, end) for i in (-1, 1) for j in (-1, 1)])
