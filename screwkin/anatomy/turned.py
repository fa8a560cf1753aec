"""A robot described in another base frame: every record carried over, and nothing else changed."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

from screwkin.algebra.screws import Screw, carry
from screwkin.algebra.se3 import Pose, Vector, as_array, vector_from_array
from screwkin.model.inertias import inertia_from_matrix, inertia_matrix
from screwkin.model.records import Box, Inertia, RobotRecord, Shape

T = TypeVar("T")
R = TypeVar("R", bound=RobotRecord)


def with_base_at(robot: R, T_new_old: Pose) -> R:
    """The robot with its base frame elsewhere on the base link.

    Boxes have their edges along the base axes: where these turn by anything but right angles, boxes become
    shapes with poses of their own.

    Args:
        robot: of numbers.
        T_new_old: takes base coordinates to those of the new base frame.
    """
    tables = ("links", "joints", "coupled", "closures", "limbs", "soles", "frames", "waist")
    present = {f.name for f in fields(robot)} & set(tables)
    moved: dict[str, Any] = {name: _carried(getattr(robot, name), T_new_old) for name in present}
    if not _is_right_angled(T_new_old):
        pairs = zip(robot.links, moved["links"], strict=True)
        moved["links"] = tuple(
            replace(new, boxes=(), shapes=(*new.shapes, *(_shape(box, T_new_old) for box in old.boxes)))
            for old, new in pairs
        )
    return replace(robot, **moved, text="")


def _is_right_angled(pose: Pose) -> bool:
    turned = np.abs(as_array(pose.R).astype(float))
    return bool(np.abs(turned - np.round(turned)).max() < 1e-9)


def _shape(box: Box, T_new_old: Pose) -> Shape:
    return Shape("collision", "box", Pose(T_new_old.R, T_new_old @ box.center), tuple(box.size))


def _carried(value: T, pose: Pose) -> T:
    """A record in other axes: points move, axes and frames turn, sizes stay."""
    new: Any = value
    if isinstance(value, Vector | Pose):
        new = pose @ value
    elif isinstance(value, Screw):
        new = carry(pose, value)
    elif isinstance(value, Inertia):
        turned = as_array(pose.R).astype(float)
        new = inertia_from_matrix(turned @ inertia_matrix(value) @ turned.T)
    elif isinstance(value, Box):
        edges = np.abs(np.round(as_array(pose.R).astype(float))) @ as_array(value.size).astype(float)
        new = Box(pose @ value.center, vector_from_array(edges))
    elif isinstance(value, tuple):
        new = tuple(_carried(item, pose) for item in value)
    elif is_dataclass(value) and not isinstance(value, type):
        new = replace(value, **{f.name: _carried(getattr(value, f.name), pose) for f in fields(value)})
    return new
