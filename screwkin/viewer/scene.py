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
from screwkin.sim.solids import Part, robot_size, solids_of, with_blocks
from screwkin.viewer.strokes import BOX_FACES, joined

STANDING = -1
"""Index of what no link carries: the blocks on the floor."""
FINE, COARSE = 1 / 400, 1 / 60
"""Edge of the cubes that meshes are coarsened to, in sizes of the robot: on a screen, and in a page."""


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


def pieces_of(robot: Robot, fineness: float = FINE, terrain: Terrain = FLAT) -> list[Piece]:
    """All that is seen of a robot: shapes, else boxes, else sticks from joint to joint.

    What cannot be read is a warning (``RobotRemark``).

    Args:
        robot: of numbers.
        fineness: edge of the cubes that meshes are coarsened to, in sizes of the robot.
        terrain: with blocks that are shown too.
    """
    solids = with_blocks(solids_of(robot, fineness * robot_size(robot)), terrain)
    pieces = [*_pieces(solids.boxes, BOX_FACES), *_pieces(solids.triangles, np.arange(3)[None])]
    return [_on_plane(piece, terrain) if piece.link == STANDING else piece for piece in pieces]


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


def first_pose(robot: Robot) -> tuple[Array, Array]:
    """T_world_base (4, 4) and q (n,) at which a robot is shown first: ``home``, else the first posture."""
    return as_array(reference_base(robot)).astype(float), np.array(reference_posture(robot), dtype=float)


def _pieces(part: Part, faces: NDArray[np.int64]) -> Iterator[Piece]:
    """The pieces of a part, joined where link and colour are the same; equal vertices are one."""
    colours = _bytes(part.colours)
    keys = np.column_stack([part.links, colours])
    for key in np.unique(keys, axis=0) if len(keys) else ():
        every, within = joined(part.corners[(keys == key).all(axis=1)], faces)
        vertices, index = np.unique(every, axis=0, return_inverse=True)
        link, red, green, blue = map(int, key)
        yield Piece(link, vertices, index.reshape(-1)[within], (red, green, blue))


def _on_plane(piece: Piece, terrain: Terrain) -> Piece:
    """The piece in world axes, from those of the terrain's plane."""
    T = terrain.T_world_plane
    return replace(piece, vertices=piece.vertices @ T[:3, :3].T + T[:3, 3])


def _bytes(colours: Array) -> NDArray[np.int64]:
    return np.rint(255 * np.clip(colours, 0.0, 1.0)).astype(np.int64)
