"""What was read off a robot, in sentences, each with how sure it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.anatomy.facets import area_of
from screwkin.anatomy.footing import Footing
from screwkin.anatomy.forward import Forward
from screwkin.anatomy.groups import Group
from screwkin.anatomy.limbs import SPLAYED, TOPPLED, Pair, Standing
from screwkin.anatomy.outline import Outline
from screwkin.anatomy.postures import PARTS, Home
from screwkin.anatomy.record import Finding
from screwkin.anatomy.skeleton import Skeleton
from screwkin.anatomy.soles import FootShape
from screwkin.anatomy.symmetry import FINEST, PLACE, Symmetry
from screwkin.model.robot import Robot

SURE = {"flat": 0.95, "edge": 0.6, "point": 0.5}
"""How sure a sole is by its kind: meshes of flat feet are flat, points and edges may be gaps of a mesh."""
LOST_PER_DEGREE = 0.01
"""What a degree of tilt takes from that."""
GUESSED = 0.3
"""What is left of that where the inertia of a link stands for its surface."""
PARTLY = 0.5
"""What is left of that where some of a link's shapes cannot be read."""
COORDINATES = ("rx", "ry", "rz", "px", "py", "pz")


def of_symmetry(skeleton: Skeleton, symmetry: Symmetry) -> Finding:
    """The plane, by how many joints have partners and how well these fit."""
    count, all_ = int(symmetry.pairs.sum()), len(symmetry.partner)
    loose = symmetry.error / (FINEST + PLACE * skeleton.size)
    matched = float((symmetry.partner >= 0).mean())
    normal = ", ".join(f"{x:.3g}" for x in symmetry.normal + 0.0)
    return Finding(
        "symmetry",
        f"the plane across ({normal}), {1e3 * symmetry.offset + 0.0:.2f} mm from the base's origin",
        _rounded((0.4 + 0.6 * matched) * (1 - 0.5 * loose)),
        f"its reflection takes the lines of {count} of {all_} joints onto those of others, to"
        f" {1e3 * symmetry.error:.2f} mm",
    )


def of_forward(forward: Forward) -> Finding:
    """Which way is forward."""
    direction = ", ".join(f"{x:.3g}" for x in forward.direction + 0.0)
    return Finding("forward", f"({direction})", forward.confidence, forward.why)


def of_leg(robot: Robot, side: str, foot: FootShape, stance: Standing) -> Finding:
    """A leg, by how well the robot stands on it in its zero pose."""
    names = [robot.tree[i].name for i in foot.joints]
    sure = (1 - 0.4 * stance.splay / SPLAYED) * (1 - 0.3 * stance.lean / TOPPLED)
    why = (
        f"of the mirrored limbs this pair reaches lowest; it points {stance.splay:.0f} deg off the vertical,"
        f" and the CoM lies {stance.lean:.0f} deg off above its feet"
    )
    if foot.toes:
        why += f"; beyond the foot move {_listed(foot.toes)}"
    return Finding(
        f"{side}_leg", f"{len(names)} joints, {_listed(names)}, to {foot.link}", _rounded(sure), why
    )


def of_arm(robot: Robot, side: str, joints: Sequence[int], group: Group | None) -> Finding:
    """An arm: the other mirrored limb that reaches furthest."""
    names = [robot.tree[i].name for i in joints]
    end = robot.tree[joints[-1]].child
    why = "of the mirrored limbs that do not stand, this pair reaches furthest; it ends where "
    why += "its chain does" if group is None else f"the group {group.name} of the SRDF does"
    return Finding(f"{side}_arm", f"{len(names)} joints, {_listed(names)}, to {end}", 0.9, why)


def of_sole(side: str, at: Footing, parts: Sequence[str], outline: Outline) -> Finding:
    """A sole, by its kind, its tilt in the zero pose, and by whether left and right agree."""
    size = np.ptp(at.corners, axis=0)
    answer = f"{at.kind}, {1e3 * size[0]:.0f} x {1e3 * size[1]:.0f} mm, {len(at.corners)} corners"
    area = 1e4 * area_of(at.corners)
    why = f"the largest facet of the hull of {_listed(parts)} that looks down has {area:.1f} cm^2"
    sure = SURE[at.kind] - LOST_PER_DEGREE * at.tilt
    if at.tilt > 0:
        took = "taken as level" if at.level else "level at home"
        why += f", tilted by {at.tilt:.1f} deg in the zero pose ({took})"
    if at.differs > 1e-3:
        why += f"; left and right differ by {100 * at.differs:.0f} %"
        sure -= 0.3 * at.differs
    if guessed := [name for name in parts if name in outline.guessed]:
        why += f"; no surface of {_listed(guessed)} can be read: its inertia stands for it"
        sure *= GUESSED
    elif unread := [name for name in parts if name in outline.unread]:
        why += f"; meshes of {_listed(unread)} cannot be read, only its other shapes"
        sure *= PARTLY
    if at.kind != "flat":
        why += f"; it is no area to stand on but an {at.kind}" if at.kind == "edge" else "; it is a point"
    return Finding(f"{side}_leg", answer, _rounded(max(sure, 0.1)), why)


def of_waist(robot: Robot, legs: Sequence[FootShape], arms: Sequence[Sequence[int]]) -> Finding:
    """The frame that gaits steer, and the joints between legs and arms."""
    pelvis = robot.tree[legs[0].joints[0]].parent
    shared = set(robot.path_to(pelvis))
    chest = robot.tree[arms[0][0]].parent if arms and arms[0] else pelvis
    between = [robot.tree[i].name for i in sorted(set(robot.path_to(chest)) ^ shared)]
    answer = "midway between the hips, level"
    why = f"the legs hang on {pelvis}" + (", the base link" if pelvis == robot.base_link else "")
    why += (
        f"; between it and the arms: {_listed(between)}"
        if between
        else "; nothing moves between legs and arms"
    )
    return Finding("waist", answer, 1.0 if pelvis == robot.base_link else 0.7, why)


def of_home(home: Home, size: float) -> Finding:
    """The posture, by what it could not be."""
    sense = "forward" if home.forward else "backwards"
    answer = f"base {1e3 * home.posture.base_height:.0f} mm above the floor, knees bent {sense}"
    free = [name for i, name in enumerate(COORDINATES) if i not in home.imposed]
    why = (
        f"soles level, the CoM {1e3 * home.off:.1f} mm off above their middle; straight, the legs would be"
        f" {100 * (home.reach - 1):.0f} % longer"
    )
    if free and len(home.imposed) > 3:
        why += f"; the legs cannot give their feet every pose: {_listed(free)} are free"
    sure = 0.95 - min(0.5, 5 * home.off / size) - 0.1 * PARTS.index(home.imposed)
    return Finding("home", answer, _rounded(max(sure, 0.1)), why)


def of_rest(robot: Robot, rest: Sequence[Pair], outline_remarks: Sequence[str]) -> tuple[str, ...]:
    """Mirrored limbs that are neither legs nor arms, and meshes that could not be read."""
    others = [
        f"the limbs from {robot.tree[p.one].name} and {robot.tree[p.other].name} are neither legs nor"
        " arms: they rest at their posture"
        for p in rest
    ]
    return (*others, *outline_remarks)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)


def _rounded(x: float) -> float:
    return round(float(np.clip(x, 0, 1)), 2)
