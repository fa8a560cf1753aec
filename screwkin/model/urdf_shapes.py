"""What the links of a URDF file look like and occupy: boxes for contact, and all other shapes beside them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwkin.algebra.se3 import Pose, as_array, leaves, vector_from_array
from screwkin.model.mesh_files import find_mesh
from screwkin.model.records import Box, Shape, ShapeRole
from screwkin.model.urdf_xml import Element, Reader

_WHOLE = 1e-9  # how far a turned box may be from the base axes
_NOT_FOUND = "mesh files not found, so neither seen nor measured"
_FLAT = "shapes without extent, left out"
_KEYS: Mapping[str, tuple[tuple[str, int], ...]] = {
    "box": (("size", 3),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
    "sphere": (("radius", 1),),
}


@dataclass(frozen=True)
class ShapeReader:
    """Reads the shapes of a file.

    Attributes:
        reader: takes faults and remarks.
        folder: of the file, where the search for meshes begins.
        colours: of the materials that the file defines for all links, by name.
    """

    reader: Reader
    folder: Path
    colours: Mapping[str, tuple[float, ...]]

    def shapes(self, name: str, link: Element, pose: Pose) -> tuple[list[Box], list[Shape]]:
        """Boxes for contact, and shapes that are none of them, those for pictures first.

        Boxes are those of collision along the base axes, or those for pictures where a link has no collision.
        Pictures of the very boxes are left out.

        Args:
            name: of the link.
            link: its element.
            pose: of the link in the zero pose, in base axes.
        """
        visual = list(self._read(name, link, "visual", pose))
        collision = list(self._read(name, link, "collision", pose))
        solid = collision if link.find("collision") is not None else visual
        boxes = [_box(shape) for shape in solid if _is_straight(shape)]
        taken = [leaves(box) for box in boxes]
        seen = [leaves(_box(shape)) if _is_straight(shape) else None for shape in visual]
        rest = [] if seen == taken else visual
        return boxes, [*rest, *(shape for shape in collision if not _is_straight(shape))]

    def _read(self, name: str, link: Element, role: ShapeRole, pose: Pose) -> Iterator[Shape]:
        row = f"<link> {name!r}"
        for element in link.findall(role):
            here = pose @ self.reader.origin(row, element)
            geometry = element.find("geometry")
            for solid in () if geometry is None else geometry:
                colour = self._colour(element.find("material"))
                if solid.tag == "mesh":
                    yield from self._mesh(row, name, role, here, solid, colour)
                elif solid.tag in _KEYS:
                    yield from self._solid(row, name, role, here, solid, colour)
                else:
                    self.reader.note("shapes of an unknown kind, left out", f"{solid.tag} of {name}")

    def _solid(
        self, row: str, name: str, role: ShapeRole, pose: Pose, solid: Element, colour: tuple[float, ...]
    ) -> Iterator[Shape]:
        size: list[float] = []
        for key, count in _KEYS[solid.tag]:
            if solid.get(key) is None:
                self.reader.fault(row, key, f"is missing of a {solid.tag}", f"Write {key}=... in m")
                return
            size += self.reader.numbers(row, solid, key, (1.0,) * count)
        if min(size) <= 0:
            self.reader.note(_FLAT, f"{solid.tag} of {name}")
        else:
            yield Shape(role, solid.tag, pose, tuple(size), colour=colour)

    def _mesh(
        self, row: str, name: str, role: ShapeRole, pose: Pose, mesh: Element, colour: tuple[float, ...]
    ) -> Iterator[Shape]:
        uri, scale = mesh.get("filename", ""), self.reader.numbers(row, mesh, "scale", (1.0, 1.0, 1.0))
        if not uri.strip() or 0 in scale:
            self.reader.note(_FLAT, f"mesh of {name}")
            return
        path = find_mesh(uri, self.folder)
        if path is None:
            self.reader.note(_NOT_FOUND, uri)
        yield Shape(role, "mesh", pose, tuple(scale), uri if path is None else str(path), colour)

    def _colour(self, material: Element | None) -> tuple[float, ...]:
        """Of a material that says it, or of the file's of that name; none where neither does."""
        if material is None:
            return ()
        return _rgb(material) or self.colours.get(material.get("name", ""), ())


def shape_reader(reader: Reader, root: Element, folder: Path) -> ShapeReader:
    """The reader of a file's shapes, with the materials that it defines for all links."""
    colours = {material.get("name", ""): _rgb(material) for material in root.findall("material")}
    return ShapeReader(reader, folder, colours)


def _rgb(material: Element) -> tuple[float, ...]:
    """Red, green and blue of a material; none where it has no colour, for pictures are never refused."""
    colour = material.find("color")
    try:
        numbers = [float(word) for word in ("" if colour is None else colour.get("rgba", "")).split()[:3]]
    except ValueError:
        return ()
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        return ()
    return tuple(min(1.0, max(0.0, number)) for number in numbers)


def _is_straight(shape: Shape) -> bool:
    """Whether it is a box along the base axes."""
    if shape.kind != "box":
        return False
    turned = np.abs(as_array(shape.pose.R))
    return bool(np.abs(turned - np.round(turned)).max() <= _WHOLE)


def _box(shape: Shape) -> Box:
    size = np.round(np.abs(as_array(shape.pose.R))) @ np.array(shape.size, dtype=float)
    return Box(shape.pose.p, vector_from_array(size))
