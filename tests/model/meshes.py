"""Mesh files for tests: one tetrahedron in every format, its corners on the axes at 1, 2 and 3."""

from __future__ import annotations

from pathlib import Path

import numpy as np

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def write_stl(path: Path, corners: np.ndarray = CORNERS) -> Path:
    facets = [
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x} {y} {z}\n" for x, y, z in corners[face])
        + " endloop\nendfacet\n"
        for face in FACES
    ]
    return _write(path, "solid t\n" + "".join(facets) + "endsolid t\n")


def write_obj(path: Path, corners: np.ndarray = CORNERS) -> Path:
    points = [f"v {x} {y} {z}" for x, y, z in corners]
    return _write(path, "\n".join([*points, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES)]) + "\n")


def write_dae(path: Path, corners: np.ndarray = CORNERS, up: str = "Z_UP", unit: float = 1.0) -> Path:
    numbers = " ".join(map(str, corners.ravel()))
    indices = " ".join(map(str, FACES.ravel()))
    text = f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>
  <unit name="u" meter="{unit}"/><up_axis>{up}</up_axis></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="{corners.size}">{numbers}</float_array><technique_common>
   <accessor source="#a" count="{len(corners)}" stride="3">
    <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
  </technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="{len(FACES)}"><input semantic="VERTEX" source="#v" offset="0"/>
   <p>{indices}</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
 </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""
    return _write(path, text)


def _write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path
