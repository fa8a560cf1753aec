"""How far a robot gets sideways over level soles, by the geometry of its legs alone.

While both soles stand flat, the twist of the base lies in the span of each leg's joint screws. A leg without
a roll axis at its ankle carries any force along its pitch axes through its hip without torque of a joint, so
that no such span holds a shift to the side: each hip stays above its own foot. What is left is to lean: the
base rolls about the line ahead between the hips, the legs stay, and what stands above the hips moves aside.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import Twist, X, as_array, dot, rotate, vector_from_array
from screwkin.gait.driven import arms_of, driven
from screwkin.gait.lengths import lengths_of
from screwkin.gait.stance import stance_of
from screwkin.kinematics.landmarks import limb_root, waist_frame
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import frame_jacobian, joint_screws, joint_twists, link_displacements
from screwkin.model.robot import Robot

INDEPENDENT = 0.02
"""Least singular value, of unit screws with lengths in legs, that counts: manufacture tilts axes by less."""
_ROLL = 0.7
"""Cosine to the line ahead, above which a joint rolls its leg."""


@dataclass(frozen=True)
class Sideways:
    """Motions of the waist at home while both soles stand flat.

    freedoms: of its six; shifts: whether a shift to the side is among them; lean: how far it can lean by
    limits of the hips [rad]; aside: how far the CoM then goes to the side [m]; edge: from the middle between
    the feet to the inner edge of a sole [m].
    """

    freedoms: int
    shifts: bool
    lean: float
    aside: float
    edge: float

    def __str__(self) -> str:
        """Why such a robot cannot bring its weight over one level sole; empty where it can."""
        if self.shifts or self.aside >= self.edge:
            return ""
        return (
            f"Over level soles its waist moves in {self.freedoms} of 6 ways, and not to the side: no ankle"
            f" rolls. The most that its hips let it lean, {np.degrees(self.lean):.1f} deg, brings the CoM"
            f" {1e3 * self.aside:.1f} mm aside, and the inner edges of the soles are {1e3 * self.edge:.1f} mm"
            f" from the middle. An ankle that rolls, or soles that reach"
            f" {1e3 * (self.edge - self.aside):.1f} mm further in, would let it stand on one foot"
        )


def sideways(robot: Robot) -> Sideways:
    """How far a robot gets sideways over level soles.

    Args:
        robot: with legs, soles and a ``home`` posture.

    Raises:
        InputError: it cannot walk: see ``stance_of``.
    """
    moving, stance, R = driven(robot, arms_of(robot)).moving, stance_of(robot), waist_frame(robot).R
    D = link_displacements(moving, list(moving.posture("home").q))
    twists = [at(waist_frame(robot).p, twist) for twist in joint_twists(moving, D)]
    tips = [limb.tip for limb in moving.limbs if limb.kind == "leg"]
    unit = np.repeat([1.0, lengths_of(robot)["leg"]], 3)
    barred = np.vstack([_barred(frame_jacobian(moving, twists, tip).values(), unit) for tip in tips])
    ways = 6 - int((np.linalg.svd(barred, compute_uv=False) > INDEPENDENT).sum()) if len(barred) else 6
    left = np.concatenate([np.zeros(3), as_array(R.y).astype(float)])
    lean, aside = _leant(robot, as_array(R).astype(float))
    inner = min(foot.side * float(y) for foot in stance.feet for _, y in foot.sole)
    shifts = bool(np.linalg.norm(barred @ left) <= INDEPENDENT)
    return Sideways(ways, shifts, lean, aside, stance.foot_y + inner)


def _barred(columns: Iterable[Twist], unit: Array) -> Array:
    """Orthonormal rows (k, 6) that span what is square to a leg's joint screws, lengths in legs."""
    screws = np.array([as_array(column).astype(float) / unit for column in columns])
    _, sigma, rows = np.linalg.svd(screws / np.linalg.norm(screws, axis=1)[:, None])
    return np.asarray(rows[int((sigma > INDEPENDENT).sum()) :])


def _leant(robot: Robot, R: Array) -> tuple[float, float]:
    """How far the base may roll about the line ahead between the hips while the legs stay; the CoM's way."""
    q, legs = np.array(robot.posture("home").q, dtype=float), [x for x in robot.limbs if x.kind == "leg"]
    screws = joint_screws(robot, link_displacements(robot, list(q)))
    hips, room = [], [np.pi / 2, np.pi / 2]
    for leg in legs:
        rolls = [(i, float(dot(screws[i].s, vector_from_array(R[:, 0])))) for i in robot.path_to(leg.link)]
        i, along = max(rolls, key=lambda one: abs(one[1]))
        if i >= len(q) or abs(along) < _ROLL:
            return 0.0, 0.0
        ends = [along * (float(end) - q[i]) for end in (robot.joints[i].lower, robot.joints[i].upper)]
        room = [min(room[0], -min(ends)), min(room[1], max(ends))]
        hips.append((i, along))
    middle = np.mean([as_array(limb_root(robot, leg.name)).astype(float) for leg in legs], axis=0)

    def across(angle: float) -> float:
        """Of the CoM from the middle, the base turned by an angle and the legs as before."""
        turned = q.copy()
        for i, along in hips:
            turned[i] -= np.sign(along) * angle
        com = as_array(mass_center(robot, link_displacements(robot, list(turned)))).astype(float)
        return float((as_array(rotate(X, angle)).astype(float) @ R.T @ (com - middle))[1])

    lean = max(0.0, min(room))
    return lean, min(abs(across(turn * lean) - across(0.0)) for turn in (-1, 1))
