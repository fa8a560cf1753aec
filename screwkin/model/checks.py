"""What must hold within one row of a robot table: inertias, limits, pitches, soles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, get_args

import numpy as np

from screwkin.algebra.se3 import leaves
from screwkin.errors import Fault
from screwkin.model.link_spring import MATERIAL, stiffness_faults
from screwkin.model.records import Joint, ShapeKind, Sole
from screwkin.model.rows import Rows
from screwkin.model.schema import InertiaRow, JointRow, LinkRow, ShapeRow, SoleRow, SpringRow

_COMPONENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
_FLAT = 1e-6  # m: far below what a floor is flat to


def row_faults(rows: Rows) -> Iterator[Fault]:
    """Faults within single rows whose keys and values are sound by themselves."""
    for table, check in _CHECKS.items():
        for where, row in rows.good(table):
            for key, found, fix in check(row):
                yield Fault(where, key, found, fix)


def _link(link: LinkRow) -> Iterator[tuple[str, str, str]]:
    if link.mass > 0 and link.com is None:
        yield "com", "is missing", "Write com = [x, y, z] in m, or mass = 0"
    if link.inertia is not None:
        yield from _inertia(link.inertia)
    elif link.mass > 0:
        yield (
            "inertia",
            "is missing",
            "Write { box = [lx, ly, lz] } or { xx, yy, zz, xy, xz, yz }, or mass = 0",
        )
    for i, shape in enumerate(link.shapes):
        yield from _shape(f"shapes[{i}]", shape)
    if link.spring is not None:
        yield from _spring(link.spring)


def _spring(spring: SpringRow) -> Iterator[tuple[str, str, str]]:
    given = [key for key in (*MATERIAL, "J", "about") if key in spring.model_fields_set]
    missing = [key for key in MATERIAL if key not in given]
    along = np.array(leaves(spring.end)) - np.array(leaves(spring.root))
    if spring.stiffness and given:
        yield "spring", f"has stiffness and {', '.join(given)}", "Write either a matrix or a beam"
    elif spring.stiffness:
        yield from (("spring.stiffness", found, fix) for found, fix in stiffness_faults(spring.stiffness))
    elif missing:
        yield "spring", f"{', '.join(missing)} missing", "Write stiffness, or E, G, A and I of a beam"
    elif not along.any():
        yield "spring.end", "is the root too", "Write the two ends of a beam"
    elif len(spring.I) == 2 and spring.I[0] != spring.I[1] and spring.about is None:
        yield "spring.about", "is missing", "Write the direction of the axis of the first moment"
    elif spring.about is not None and not np.cross(along, np.array(leaves(spring.about))).any():
        yield "spring.about", "lies along the beam, or is zero", "Write a direction across it"


def _shape(key: str, shape: ShapeRow) -> Iterator[tuple[str, str, str]]:
    given = [kind for kind in get_args(ShapeKind) if getattr(shape, kind) is not None]
    if len(given) != 1:
        found = f"is {' and '.join(given)} at once" if given else "is nothing"
        yield key, found, f"Write one of {', '.join(get_args(ShapeKind))}"
    elif "scale" in shape.model_fields_set and shape.mesh is None:
        yield f"{key}.scale", f"stands on a {given[0]}", "Leave it out: only a mesh has one"
    elif shape.mesh == "":
        yield f"{key}.mesh", "is empty", "Write the path of a file"


def _inertia(inertia: InertiaRow) -> Iterator[tuple[str, str, str]]:
    given = [name for name in _COMPONENTS if name in inertia.model_fields_set]
    fix = "Write either { box = [lx, ly, lz] }, or { xx, yy, zz } and, where not 0, xy, xz, yz"
    if (inertia.box is not None) == bool(given):
        yield "inertia", "is both a box and components" if given else "is empty", fix
        return
    if inertia.box is not None:
        return
    absent = [name for name in _COMPONENTS[:3] if name not in given]
    if absent:
        yield "inertia", f"{', '.join(absent)} missing", fix


def _joint(joint: JointRow) -> Iterator[tuple[str, str, str]]:
    if joint.type == "helical" and not joint.pitch:
        yield "pitch", "is missing or 0", "Write the finite advance in m/rad, or make the joint revolute"
    if joint.type != "helical" and joint.pitch:
        yield "pitch", f"{joint.pitch:g} on a {joint.type} joint", 'Leave it out, or write type = "helical"'
    if joint.lower > joint.upper:
        yield "lower", f"{joint.lower:g} is above upper {joint.upper:g}", "Swap the limits"
    if joint.mimic is not None and not math.isfinite(joint.mimic.ratio):
        yield "mimic.ratio", f"is {joint.mimic.ratio:g}", "Write a finite number"
    if joint.mimic is not None and not math.isfinite(joint.mimic.offset):
        yield "mimic.offset", f"is {joint.mimic.offset:g}", "Write a finite number"
    yield from spring_faults(joint, joint.mimic is not None)


def spring_faults(joint: JointRow | Joint, follows: bool) -> Iterator[tuple[str, str, str]]:
    """Key, what is wrong and what is right, for a joint's spring and damper."""
    for key in ("stiffness", "damping"):
        value = getattr(joint, key)
        if not 0 <= value < math.inf:
            yield key, f"is {value:g}", "Write a finite number of at least 0"
        elif value and (follows or not joint.passive):
            what, fix = (
                ("follows another one", "Give it to the joint that leads")
                if follows
                else ("has a motor", "Write passive = true; a motor's own stands under [servos]")
            )
            yield key, f"is {value:g} at a joint that {what}", fix
    if not math.isfinite(joint.rest):
        yield "rest", f"is {joint.rest:g}", "Write a finite number"
    elif joint.rest and not joint.stiffness:
        yield "rest", f"is {joint.rest:g} without a spring", "Write its stiffness too, or leave it out"


def sole_faults(sole: SoleRow | Sole) -> Iterator[tuple[str, str, str]]:
    """Key, what is wrong and what is right, for a sole that is no convex flat polygon."""
    if len(sole.corners) < 3:
        yield "corners", f"{len(sole.corners)} given", "Write three or more corners"
        return
    corners = np.array([[float(c) for c in corner] for corner in sole.corners])
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.roll(edges, -1, axis=0)
    bends = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    ahead = edges[:, 0] * after[:, 0] + edges[:, 1] * after[:, 1]
    turns = np.arctan2(bends, ahead).sum() / (2 * math.pi)
    if (bends < 0).all() and round(turns) == -1:
        yield "corners", "run clockwise seen from above", "Reverse their order"
    elif (bends <= 0).any() or round(turns) != 1:
        fix = "Write the corners of a convex polygon once each, counter-clockwise seen from above"
        yield "corners", "are not convex", fix
    elif np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[2] > _FLAT:
        yield "corners", "do not lie in one plane", "A sole is flat: give its corners in one plane"


_CHECKS: Mapping[str, Callable[[Any], Iterator[tuple[str, str, str]]]] = {
    "link": _link,
    "joint": _joint,
    "sole": sole_faults,
}
