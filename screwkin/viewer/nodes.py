"""Nodes of a viser scene that are put up once and then moved: only what has changed is sent.

Every line is triangles (``strokes``), and nothing throws a shadow: both cost most of a picture where no
graphics card is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import pose_from_array, unit_quaternion
from screwkin.viewer.strokes import Triangles

Colour = tuple[int, int, int]


def put_mesh(scene: Any, name: str, shape: Triangles, colour: Colour, visible: bool = True) -> Any:
    """A node of triangles in one colour."""
    vertices, faces = shape
    return scene.add_mesh_simple(
        name,
        vertices,
        faces,
        color=colour,
        flat_shading=True,
        material="toon5",
        side="double",
        cast_shadow=False,
        receive_shadow=False,
        visible=visible,
    )


class Moved:
    """Nodes that are moved together, each sent only where it is elsewhere than before."""

    def __init__(self, handles: list[Any]) -> None:
        self._handles = handles
        self._sent = np.full((len(handles), 4, 4), np.nan)

    def to(self, Ts: Array) -> None:
        """Move every node to its pose (N, 4, 4)."""
        elsewhere = np.flatnonzero((Ts != self._sent).any(axis=(1, 2)))
        for k, wxyz in zip(elsewhere, quaternions(Ts[elsewhere]), strict=True):
            self._handles[k].position, self._handles[k].wxyz = Ts[k, :3, 3], wxyz
        self._sent = np.array(Ts)


class Redrawn:
    """One node whose triangles change now and then."""

    def __init__(self, scene: Any, name: str, colour: Colour) -> None:
        self._put = lambda shape: put_mesh(scene, name, shape, colour)
        self._handle: Any = None

    def as_(self, shape: Triangles | None, visible: bool = True) -> None:
        """Show these triangles; none, or not visible: nothing."""
        visible = visible and shape is not None and len(shape[0]) > 0
        if visible and shape is not None:
            if self._handle is None:
                self._handle = self._put(shape)
            self._handle.vertices = shape[0].astype(np.float32)
            self._handle.faces = shape[1].astype(np.uint32)
        if self._handle is not None:
            self._handle.visible = visible

    def remove(self) -> None:
        """Take the node out of the scene."""
        if self._handle is not None:
            self._handle.remove()
            self._handle = None


def quaternions(Ts: Array) -> Array:
    """Unit quaternions wxyz (N, 4) of poses (N, 4, 4)."""
    w, v = unit_quaternion(pose_from_array(Ts).R)
    return np.stack(np.broadcast_arrays(w, v.x, v.y, v.z), axis=-1)
