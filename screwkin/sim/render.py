"""Pictures of a robot on a tiled floor, drawn by NumPy and Pillow alone.

No display, no graphics card, no simulator: the same function draws what a simulator saw and what a trajectory
plans. Faces are filled front to back by depth, the shadow is every face carried along the light onto the
floor, and everything is drawn at twice the size and then reduced, which smooths the edges.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import IDENTITY, as_array, unstack
from screwkin.dynamics.support import convex_hull
from screwkin.dynamics.terrain import FLAT, Terrain
from screwkin.kinematics.positions import link_displacements
from screwkin.model.robot import Robot
from screwkin.sim.camera import Camera, Picture, View, following, view_of
from screwkin.sim.solids import Part, Solids, solids_of, with_blocks
from screwkin.sim.triangles import draw_triangles

FINER = 2
"""How many times larger pictures are drawn than they become."""
LAMP = 1.4
"""Brightness of the lamp: a face turned to it by 45 deg is fully lit."""
SHADE = 0.30
"""How much the shadow darkens the floor."""
REACH = 12.0
"""How far the floor is drawn, in distances of the camera; it fades into the sky on the way."""

_CELL = 1 / 200  # of the camera's distance: what meshes are coarsened to, two pixels
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def pictures(
    robot: Robot, time: Array, T_world_base: Array, q: Array, camera: Camera, terrain: Terrain = FLAT
) -> list[Picture]:
    """Pictures (height, width, 3) of K states, the camera gliding along.

    Links show their shapes; without any that can be read their boxes, and without these sticks from joint to
    joint. On a slope the camera is tilted with the floor.

    Args:
        robot: of numbers.
        time: (K,) [s], increasing.
        T_world_base: (K, 4, 4).
        q: (K, n).
        camera: see ``Camera``.
        terrain: what the robot stands on.
    """
    if not terrain.flat:
        T_world_base = np.linalg.inv(terrain.T_world_plane) @ T_world_base
    carried = link_displacements(robot, unstack(np.asarray(q, dtype=float)))
    displacements = T_world_base[:, None] @ np.moveaxis(as_array([D @ IDENTITY for D in carried]), -3, -3)
    targets = following(time, T_world_base)
    away = camera.distance * float(T_world_base[0, 2, 3])
    solids = with_blocks(solids_of(robot, _CELL * away), terrain)
    still = np.eye(4)[None]  # what carries the blocks, behind the last link
    return [
        _picture(camera, target, away, solids, np.concatenate([Ts, still]))
        for target, Ts in zip(targets, displacements, strict=True)
    ]


def _picture(camera: Camera, target: Array, away: float, solids: Solids, Ts_world_link: Array) -> Picture:
    from PIL import Image

    view = view_of(camera, target, away, FINER)
    boxes, triangles = (_placed(part, Ts_world_link) for part in (solids.boxes, solids.triangles))
    outlines = [*boxes[:, _FACES].reshape(-1, 4, 3), *_hulls(triangles, solids.triangles.links, camera)]
    canvas = _floor(camera, view, target, away, outlines)
    light = np.array(camera.light) / np.linalg.norm(camera.light)
    nearness = np.zeros(canvas.shape[:2])
    for corners, colour in zip(boxes, solids.boxes.colours, strict=True):
        _draw_box(canvas, nearness, view, corners, colour, light, camera.ambient)
    shades = solids.triangles.colours * _lit(triangles, view.eye, light, camera.ambient)[:, None]
    draw_triangles(canvas, nearness, view, triangles, shades)
    image = Image.fromarray(np.rint(255 * np.clip(canvas, 0.0, 1.0)).astype(np.uint8))
    return np.asarray(image.resize((camera.width, camera.height), Image.Resampling.BOX))


def _placed(part: Part, Ts_world_link: Array) -> Array:
    """The corners of a part's pieces in the world."""
    T = Ts_world_link[part.links]
    return part.corners @ T[:, :3, :3].transpose(0, 2, 1) + T[:, None, :3, 3]


def _hulls(triangles: Array, links: NDArray[np.int64], camera: Camera) -> list[Array]:
    """Corners (k, 3) on the floor of the hull of every link's shadow."""
    cast = triangles - triangles[..., 2:] / camera.light[2] * np.array(camera.light)
    hulls = [convex_hull(cast[links == link, :, :2].reshape(-1, 2)) for link in np.unique(links)]
    return [np.column_stack([hull, np.zeros(len(hull))]) for hull in hulls]


def _lit(triangles: Array, eye: Array, light: Array, ambient: float) -> Array:
    """Brightness (F,) of triangles, whichever of their sides is seen."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    towards = np.sign(np.einsum("fi,fi->f", normals, eye - a))
    return np.asarray(ambient + (1.0 - ambient) * np.clip(LAMP * towards * (normals @ light), 0.0, 1.0))


def _draw_box(
    canvas: NDArray[np.float32],
    nearness: Array,
    view: View,
    corners: Array,
    colour: Array,
    light: Array,
    ambient: float,
) -> None:
    """Fill the faces of a box that can be seen; ``nearness`` is one over the depth of what is drawn there."""
    middle = corners.mean(axis=0)
    for face in _FACES:
        quad = corners[list(face)]
        normal = np.cross(quad[1] - quad[0], quad[2] - quad[0])
        normal *= np.sign(normal @ (quad[0] - middle)) / np.linalg.norm(normal)
        if normal @ (view.eye - quad[0]) <= 0.0:
            continue
        pixels, depth = view.project(quad)
        low = np.maximum(np.floor(pixels.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + 1, [view.width, view.height])
        if (low >= high).any() or depth.min() <= 0.0:
            continue
        window = np.s_[low[1] : high[1], low[0] : high[0]]
        x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
        # One over the depth is linear over the picture; equal faces of two boxes go to the one drawn first.
        plane = np.linalg.lstsq(np.column_stack([pixels, np.ones(4)]), 1.0 / depth, rcond=None)[0]
        near = plane[0] * x + plane[1] * y + plane[2]
        seen = _inside(pixels, x, y) & (near > 1.0001 * nearness[window])
        nearness[window][seen] = near[seen]
        lit = min(1.0, max(0.0, LAMP * float(normal @ light)))
        canvas[window][seen] = colour * (ambient + (1.0 - ambient) * lit)


def _inside(polygon: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Which points lie in a convex polygon, given in either sense of turning."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    side = [ex * (y - py) - ey * (x - px) for (px, py), (ex, ey) in zip(polygon, edges, strict=True)]
    return np.asarray((np.min(side, axis=0) >= 0.0) | (np.max(side, axis=0) <= 0.0))


def _floor(
    camera: Camera, view: View, target: Array, away: float, outlines: Sequence[Array]
) -> NDArray[np.float32]:
    """Sky and floor with the robot's shadow, (height, width, 3) in [0, 1].

    The camera does not roll, so all rays of a row meet the floor on one line: what depends on the row alone
    is computed once per row.
    """
    right, up, forward = view.axes
    rays = forward + np.outer((view.height / 2 - np.arange(view.height) - 0.5) / view.focal, up)
    sideways = (np.arange(view.width) + 0.5 - view.width / 2) / view.focal
    reach = view.eye[2] / np.maximum(-rays[:, 2], 1e-6)
    parity = np.zeros((view.height, view.width), dtype=np.int32)
    for axis in (0, 1):
        along = (view.eye[axis] + reach * rays[:, axis]) / camera.tile
        across = np.outer(reach * right[axis] / camera.tile, sideways)
        parity += np.floor(along[:, None] + across).astype(np.int32)
    middle = view.eye[:2] + reach[:, None] * rays[:, :2] - target[:2]
    gone = np.clip(np.linalg.norm(middle, axis=1) / (REACH * away), 0.0, 1.0)[:, None]
    even, odd = (np.array(colour) * (1.0 - gone) + gone * camera.sky for colour in camera.tile_colours)
    floor = np.where(
        (parity & 1)[..., None], odd[:, None].astype(np.float32), even[:, None].astype(np.float32)
    )
    floor *= (1.0 - SHADE * _shadow(camera, view, outlines))[..., None]
    return floor


def _shadow(camera: Camera, view: View, outlines: Sequence[Array]) -> NDArray[np.float32]:
    """Share (height, width) of the lamp's light that polygons (k, 3) block, softened at the shadow's edge."""
    from PIL import Image, ImageDraw, ImageFilter

    mask = Image.new("L", (view.width, view.height))
    draw = ImageDraw.Draw(mask)
    light = np.array(camera.light)
    for corners in outlines:
        pixels, depth = view.project(corners - corners[:, 2:] / light[2] * light)
        if depth.min() > 0.0:
            draw.polygon(pixels.ravel().tolist(), fill=255)
    soft = mask.filter(ImageFilter.GaussianBlur(1.5 * FINER))
    return np.asarray(soft, dtype=np.float32) / 255.0
