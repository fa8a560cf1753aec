"""Which way a body faces: where its soles and toes lie from the ankles, and how its knees bend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.anatomy.limbs import Standing
from screwkin.anatomy.skeleton import Skeleton
from screwkin.anatomy.soles import FootShape
from screwkin.anatomy.symmetry import TILT, Symmetry

CLEAR = 0.1
"""Part of a foot's length by which its middle lies ahead of the ankle in a foot that shows its direction."""
WEIGHTS = {"sole": 1.0, "toes": 1.0, "knees": 0.5, "base": 0.5}
"""What each sign counts: feet must reach ahead for a fall forward to be caught; knees may bend either way.

That x points ahead is the convention of robots' files (REP 103): it holds against soles that reach behind the
ankles by less than half of ``CLEAR``.
"""


@dataclass(frozen=True, eq=False)
class Forward:
    """The direction (3,) in which a body faces, how sure that is, and why."""

    direction: Array
    confidence: float
    why: str


def forward_of(
    skeleton: Skeleton, symmetry: Symmetry, stance: Standing, feet: tuple[FootShape, FootShape]
) -> Forward:
    """The horizontal direction within the plane of symmetry in which most signs point."""
    ahead = np.cross(symmetry.normal, stance.up)
    signs = {
        "sole": float(np.mean([_sole(foot, ahead) for foot in feet])),
        "toes": float(np.mean([_toes(skeleton, foot, ahead, stance.length) for foot in feet])),
        "knees": float(np.mean([_knee(skeleton, foot, symmetry.normal) for foot in feet])),
        "base": _base(ahead),
    }
    weighed = {name: WEIGHTS[name] * sign for name, sign in signs.items()}
    total = sum(weighed.values())
    sense = 1.0 if total >= 0 else -1.0
    texts = {
        "sole": "the soles reach further {} from the ankles",
        "toes": "the toes lie {} of the ankles",
        "knees": "the knees bend so that the shanks swing {}",
        "base": "the base frame's x axis points {}",
    }
    words = {
        "sole": ("ahead", "backwards"), "toes": ("ahead", "behind"), "knees": ("back", "ahead"),
        "base": ("ahead", "backwards"),
    }  # fmt: skip
    why = [
        texts[name].format(words[name][0 if value * sense > 0 else 1])
        for name, value in weighed.items()
        if abs(value) > 0.05
    ]
    known = sum(WEIGHTS[name] for name, sign in signs.items() if abs(sign) > 0.05)
    confidence = 0.5 + 0.5 * min(1.0, abs(total)) * (min(1.0, abs(total) / known) if known else 0.0)
    return Forward(
        sense * ahead, round(confidence, 2), "; ".join(why) or "nothing shows it: the base's x axis"
    )


def _sole(foot: FootShape, ahead: Array) -> float:
    length = foot.extent(ahead)
    return float(np.clip((foot.center - foot.ankle) @ ahead / (CLEAR * length), -1, 1)) if length else 0.0


def _toes(skeleton: Skeleton, foot: FootShape, ahead: Array, length: float) -> float:
    """Where the axes of toes lie: only of those that a foot carries, across its direction."""
    last = skeleton.robot.joint_above[foot.link]
    toes = [i for i in skeleton.next(last) if abs(skeleton.s[i] @ ahead) < 0.5]
    away = [float((skeleton.s0[i] - foot.ankle) @ ahead) / (CLEAR * length) for i in toes]
    return float(np.clip(np.mean(away), -1, 1)) if away else 0.0


def _knee(skeleton: Skeleton, foot: FootShape, normal: Array) -> float:
    """Which way the middle one of the axes across bends: its range to either side, thumb along the normal.

    A turn about the normal takes what hangs below backwards.
    """
    across = [i for i in foot.joints if abs(skeleton.s[i] @ normal) > 1 - 10 * TILT and skeleton.turns[i]]
    if len(across) < 2:
        return 0.0
    middle = skeleton.robot.tree[across[len(across) // 2]]
    lower, upper = (float(np.clip(x, -np.pi, np.pi)) for x in (middle.lower, middle.upper))
    sense = np.sign(float(skeleton.s[skeleton.robot.joint_above[middle.child]] @ normal))
    return float(sense * (upper + lower) / (upper - lower)) if upper > lower else 0.0


def _base(ahead: Array) -> float:
    return float(np.sign(ahead[0])) if abs(ahead[0]) > 1 - TILT else 0.0
