"""What the links of a URDF file look like and occupy, in and out: boxes for contact, and all other shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from screwkin.algebra.se3 import Pose, as_array, leaves, vector_from_array
from screwkin.model.mesh_files import find_mesh, short_path
from screwkin.model.records import Box, Shape, ShapeRole
from screwkin.model.urdf_xml import Element, Reader

_WHOLE = 1e-9  # how far a turned box may be from the base axes
_NOT_FOUND = "mesh files not found, so neither seen nor measured"
_NO_SIZE = "shapes left out, of an unknown kind or without an extent"
_KEYS: Mapping[str, Mapping[str, int]] = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
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
        for element in link.findall(role):
            here = pose @ self.reader.origin(f"<link> {name!r}", element)
            geometry = element.find("geometry")
            for solid in () if geometry is None else geometry:
                kind, size, file = str(solid.tag), _size(solid), solid.get("filename", "").strip()
                if not size or (kind == "mesh" and not file):
                    self.reader.note(_NO_SIZE, f"{kind} of {name}")
                    continue
                if kind == "mesh":
                    file = self._found(file)
                yield Shape(role, solid.tag, here, size, file, self._colour(element.find("material")))

    def _found(self, uri: str) -> str:
        """The path of a mesh, or its URI with a remark."""
        path = find_mesh(uri, self.folder)
        if path is None:
            self.reader.note(_NOT_FOUND, uri)
        return uri if path is None else str(path)

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
    """Red, green and blue of a material; none where it has a texture or no colour."""
    colour = None if material.find("texture") is not None else material.find("color")
    text = "" if colour is None else colour.get("rgba", "")
    return tuple(min(1.0, max(0.0, number)) for number in _numbers(" ".join(text.split()[:3]), 3))


def _size(solid: Element) -> tuple[float, ...]:
    """Lengths of a solid, factors of a mesh; none where they are missing, malformed or no extent."""
    if solid.tag == "mesh":
        scale = _numbers(solid.get("scale", "1 1 1"), 3)
        return () if 0 in scale else scale
    keys = _KEYS.get(str(solid.tag), {})
    read = [_numbers(solid.get(key, ""), count) for key, count in keys.items()]
    size = tuple(number for numbers in read for number in numbers)
    return size if all(read) and min(size, default=0) > 0 else ()


def _numbers(text: str, count: int) -> tuple[float, ...]:
    """So many finite numbers, or none: pictures are never refused."""
    try:
        numbers = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    return numbers if len(numbers) == count and all(map(math.isfinite, numbers)) else ()


def add_geometry(element: ElementTree.Element, shape: Shape, folder: Path | None) -> None:
    """Write what a shape is into its element, ``visual`` or ``collision``.

    Args:
        element: of the shape.
        shape: of numbers.
        folder: of the file that is written; None to name meshes by their whole paths.
    """
    size = [repr(float(number)) for number in shape.size]
    if shape.kind == "mesh":
        given = {
            "filename": short_path(shape.file, folder) if folder else shape.file,
            "scale": " ".join(size),
        }
    elif shape.kind == "box":
        given = {"size": " ".join(size)}
    else:
        given = dict(zip(_KEYS[shape.kind], size, strict=True))
    ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), shape.kind, given)
    if shape.colour:
        rgb = [repr(float(c)) for c in shape.colour]
        material = ElementTree.SubElement(element, "material", name="_".join(["rgb", *rgb]))
        ElementTree.SubElement(material, "color", rgba=" ".join([*rgb, "1.0"]))


def _is_straight(shape: Shape) -> bool:
    """Whether it is a box along the base axes."""
    if shape.kind != "box":
        return False
    turned = np.abs(as_array(shape.pose.R))
    return bool(np.abs(turned - np.round(turned)).max() <= _WHOLE)


def _box(shape: Shape) -> Box:
    size = np.round(np.abs(as_array(shape.pose.R))) @ np.array(shape.size, dtype=float)
    return Box(shape.pose.p, vector_from_array(size))
