"""Meshes from files, by trimesh: STL, OBJ, COLLADA and others."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property, lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, MissingDependencyError, needed_for
from screwkin.files import MOST_SHAPES, read_file

LARGEST_MESH = 2**26
"""Bytes of a mesh; public robots' have some million."""
KINDS = ("stl", "obj", "dae", "ply", "off", "glb")
"""Suffixes of the formats that are read; archives are not."""
_UPRIGHT = {
    "X": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),
    "Y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "Z": np.eye(3),
}


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of a file, in its own axes and in its unit; COLLADA's in [m].

    Attributes:
        vertices: (V, 3).
        faces: (F, 3) indices of vertices.
        colours: (F, 3) red, green, blue in [0, 1]; NaN where the file says none.
        turn: (3, 3) from the file's axes to z up: unity but for COLLADA that says otherwise.
    """

    vertices: Array
    faces: NDArray[np.int64]
    colours: Array
    turn: Array

    @cached_property
    def corners(self) -> Array:
        """Vertices (N, 3) of the convex hull; all of them where they lie in a plane."""
        from scipy.spatial import ConvexHull, QhullError

        try:
            return np.asarray(self.vertices[ConvexHull(self.vertices).vertices])
        except (QhullError, ValueError):
            return np.unique(self.vertices, axis=0)


def hull_faces(points: Array) -> NDArray[np.int64]:
    """Triangles (F, 3), as indices of points (N, 3), of the convex hull of points that lie in no plane."""
    from scipy.spatial import ConvexHull

    return np.asarray(ConvexHull(points).simplices, dtype=np.int64)


def load_mesh(file: str | Path) -> Mesh:
    """The mesh of a file; read anew only where the file has changed.

    Raises:
        InputError: it cannot be read, or holds no triangles.
        MissingDependencyError: trimesh is absent, or what it needs for COLLADA.
    """
    try:
        about = Path(file).stat()
    except (OSError, ValueError) as wrong:
        raise InputError(f"mesh {file}: cannot be read ({wrong})") from None
    return _read(str(file), about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=512)
def _read(file: str, changed: int, size: int) -> Mesh:
    """The arguments beside the file say which state of it is meant."""
    with needed_for("Reading meshes"):
        import trimesh
    kind = Path(file).suffix.lower().lstrip(".")
    if kind not in KINDS:
        raise InputError(f"mesh {file}: cannot be read (.{kind}; convert it to one of {', '.join(KINDS)})")
    if kind == "dae":
        with needed_for("Reading COLLADA"):
            import collada  # noqa: F401
    try:
        data = read_file(file, LARGEST_MESH)
        if kind == "obj" and (parts := data.count(b"usemtl")) > MOST_SHAPES:
            raise InputError(f"{parts:,} changes of material, at most {MOST_SHAPES:,} are read")
        scene: Any = trimesh.load_scene(BytesIO(data), file_type=kind, process=False)
        vertices, faces, colours = _parts_of(scene)
    except MissingDependencyError:
        raise
    except Exception as wrong:  # damaged files raise whatever their reader stumbles over
        raise InputError(f"mesh {file}: cannot be read ({type(wrong).__name__}: {wrong})") from None
    if not len(faces) or not np.isfinite(vertices).all():
        raise InputError(f"mesh {file}: holds no triangles of finite numbers")
    turn = _UPRIGHT["Z"]
    if kind == "dae":
        unit, up = _asset(data)
        vertices, turn = vertices * unit, _UPRIGHT[up]
    for array in (vertices, faces, colours):
        array.flags.writeable = False
    return Mesh(vertices, faces, colours, turn)


def upward_axis(file: str | Path) -> str:
    """Which axis a COLLADA file calls up: X, Y, or Z; its triangles are not read.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return _asset(read_file(file, LARGEST_MESH))[1]
    except (OSError, ValueError) as wrong:
        raise InputError(f"mesh {file}: cannot be read ({wrong})") from None


def _parts_of(scene: Any) -> tuple[Array, NDArray[np.int64], Array]:
    """Vertices, faces and colours of all parts of a scene, each in its place."""
    vertices, faces, colours, count = (
        [np.zeros((0, 3))],
        [np.zeros((0, 3), dtype=np.int64)],
        [np.zeros((0, 3))],
        0,
    )
    for node in scene.graph.nodes_geometry:
        T, name = scene.graph[node]
        part = scene.geometry[name]
        if not hasattr(part, "faces"):
            continue
        vertices.append(part.vertices @ T[:3, :3].T + T[:3, 3])
        faces.append(part.faces + count)
        colours.append(np.broadcast_to(_colour_of(part), (len(part.faces), 3)))
        count += len(part.vertices)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(colours)


def _colour_of(part: Any) -> Array:
    """Red, green and blue of a part's material; NaN where its file says none."""
    material = getattr(part.visual, "material", None)
    if material is None:
        return np.full(3, np.nan)
    return np.array(material.main_color[:3], dtype=float) / 255


def _asset(data: bytes) -> tuple[float, str]:
    """Unit [m] and upward axis of a COLLADA file, which trimesh leaves to its caller."""
    head = data.partition(b"</asset>")[0]
    up = re.search(rb"<up_axis>\s*([XYZ])_UP", head)
    unit = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([0-9.eE+-]+)[\"']", head)
    return float(unit[1]) if unit else 1.0, up[1].decode() if up else "Y"
