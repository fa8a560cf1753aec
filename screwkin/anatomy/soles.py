"""Feet: which link of a leg stands, on which polygon, and where its ankle is.

The foot is the link that reaches the floor; the sole is the largest flat facet of its hull that looks down,
with everything that it carries (toes). Left and right are one shape reflected, where they differ by
no more than noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.anatomy.facets import (
    Facet,
    area_of,
    axes_across,
    centroid_of,
    facet_below,
    hull_of,
)
from screwkin.anatomy.limbs import AnatomyError, Standing, band_of
from screwkin.anatomy.outline import Outline
from screwkin.anatomy.skeleton import Skeleton
from screwkin.anatomy.symmetry import Symmetry

CARRIES = 0.25
"""Share of a sole that a link must have of its own to be the foot; else the foot is what it carries."""


@dataclass(frozen=True, eq=False)
class FootShape:
    """The foot of one leg in the zero pose, base axes.

    Attributes:
        joints: indices from the leg's root to the foot.
        link: the foot.
        facet: what it stands on.
        ankle: (3,) where its last axes meet [m].
        toes: links that the foot carries.
    """

    joints: tuple[int, ...]
    link: str
    facet: Facet
    ankle: Array
    toes: tuple[str, ...]

    @property
    def center(self) -> Array:
        """Centroid (3,) of the facet [m]."""
        plane = axes_across(self.facet.up)
        flat = self.facet.points @ plane
        return np.asarray(plane @ centroid_of(flat[hull_of(flat)]) + self.facet.up * self.facet.height)

    def turned(self, R: Array) -> FootShape:
        """The same foot in other axes."""
        facet = Facet(R @ self.facet.up, self.facet.height, self.facet.points @ R.T, self.facet.area)
        return FootShape(self.joints, self.link, facet, R @ self.ankle, self.toes)

    def extent(self, direction: Array) -> float:
        """Of the facet along a direction [m]."""
        return float(np.ptp(self.facet.points @ direction))


def feet_of(
    skeleton: Skeleton, symmetry: Symmetry, stance: Standing, outline: Outline
) -> tuple[FootShape, FootShape]:
    """The feet of both legs, first that on the normal's side of the plane of symmetry.

    Raises:
        AnatomyError: the links have no surface from which a sole could be seen.
    """
    first = _foot(skeleton, stance, outline, stance.legs.one)
    last = int(symmetry.partner[first.joints[-1]])
    second = _foot(skeleton, stance, outline, stance.legs.other)
    if (
        last >= 0
        and last != second.joints[-1]
        and stance.legs.other in skeleton.robot.path_to(skeleton.robot.tree[last].child)
    ):
        second = _standing(skeleton, stance, outline, stance.legs.other, last)
    return first, second


def _foot(skeleton: Skeleton, stance: Standing, outline: Outline, root: int) -> FootShape:
    """The foot of the leg that begins with a joint."""
    links = skeleton.links_beyond(root)
    with_points = [name for name in links if len(outline.of([name]))]
    if not with_points:
        raise AnatomyError(
            f"{skeleton.robot.name}: no link of the leg from {skeleton.robot.tree[root].name} has a shape"
            " that can be read, so that no sole can be seen; give its meshes, or write [[limb]] and [[sole]]"
        )
    lowest = min(with_points, key=lambda name: float((outline.of([name]) @ stance.up).min()))
    last = skeleton.robot.joint_above[lowest]
    foot = _standing(skeleton, stance, outline, root, last)
    while last != root:
        last = skeleton.robot.path_to(skeleton.robot.tree[last].parent)[-1]
        higher = _standing(skeleton, stance, outline, root, last)
        own = outline.of([higher.link])
        up = higher.facet.up
        near = own[own @ up <= higher.facet.height + band_of(stance)] @ axes_across(up)
        if len(near) < 3 or area_of(near[hull_of(near)]) < CARRIES * higher.facet.area:
            break
        foot = higher
    return foot


def _standing(skeleton: Skeleton, stance: Standing, outline: Outline, root: int, last: int) -> FootShape:
    """The foot if it begins with the link that a joint carries."""
    path = skeleton.robot.path_to(skeleton.robot.tree[last].child)
    joints = path[path.index(root) :]
    link, *toes = skeleton.links_beyond(last)
    facet = facet_below(outline.of([link, *toes]), stance.up, band_of(stance))
    middle = facet.points.mean(axis=0)
    return FootShape(joints, link, facet, _ankle(skeleton, joints, middle, stance.length), tuple(toes))


def _ankle(skeleton: Skeleton, joints: tuple[int, ...], middle: Array, length: float) -> Array:
    """Where the last axis is nearest to the last one before that is not parallel to it; else to the sole.

    An axis that is nearest to the last one far from the foot belongs to the hip, not to the ankle.
    """
    *before, last = joints
    s, s0 = skeleton.s[last], skeleton.s0[last]
    beside = s0 + s * float((middle - s0) @ s)
    for other in reversed(before):
        across_ = np.cross(s, skeleton.s[other])
        if skeleton.turns[other] and across_ @ across_ > 0.01:
            gap = skeleton.s0[other] - s0
            point = s0 + s * float(np.cross(gap, skeleton.s[other]) @ across_ / (across_ @ across_))
            if np.linalg.norm(point - beside) < length / 4:
                return np.asarray(point)
            break
    return np.asarray(beside)
