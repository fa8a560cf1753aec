"""How the inverse kinematics of every limb is solved, with how many branches, and how surely."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from screwkin.algebra.se3 import as_array
from screwkin.errors import InputError
from screwkin.ik.all_branches import by_relative, has_branches, of_six
from screwkin.ik.branches import certified_solutions
from screwkin.ik.closed import recognised
from screwkin.ik.elimination import BRANCHES
from screwkin.ik.limb import resting
from screwkin.ik.linked import completed_limb, linked_chain, with_linkages
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.ik.relative import relative
from screwkin.ik.starts import box, spread
from screwkin.ik.tied import limb_chain
from screwkin.kinematics.serial_chain import SerialChain, forward
from screwkin.mechanism.linkages import limb_linkages
from screwkin.model.robot import Robot

POSES = 32
"""Poses of a limb, spread evenly within its limits, by which the share solved is measured."""


@dataclass(frozen=True)
class IkClass:
    """Inverse kinematics of a limb.

    Attributes:
        limb: its name.
        target: ``"pose"``, or ``"position"`` of limbs of three joints and less.
        family: how it is solved, in words.
        branches: largest number of solutions that are found at once.
        solved: share of ``poses`` that its own joints reach, and that are solved within the limits from
            posture ``home``; NaN where it is not solved at all.
        poses: how many were tried.
    """

    limb: str
    target: str
    family: str
    branches: int
    solved: float
    poses: int

    def to_dict(self) -> dict[str, Any]:
        """The class as JSON data; ``solved`` is None where it is not known."""
        return asdict(self) | {"solved": self.solved if self.poses else None}


def ik_classes(robot: Robot) -> tuple[IkClass, ...]:
    """The class of every limb."""
    return tuple(_class_of(robot, limb.name) for limb in robot.limbs)


def _class_of(robot: Robot, limb: str) -> IkClass:
    try:
        chain, linked = limb_chain(robot, limb), bool(limb_linkages(robot, limb))
    except InputError as error:
        return IkClass(limb, "pose", str(error), 0, float("nan"), 0)
    position = len(chain.joints) <= 3
    family, branches = family_of(chain, position)
    low, high = box(chain)
    q = low + spread(len(chain.joints), POSES, 0) * (high - low)
    if linked:
        whole, gap = completed_limb(robot, chain, q)
        q = q[(gap == 0) & linked_chain(robot, chain).within(whole)]
    poses = len(q)
    tips = as_array(forward(chain.screws, chain.moved(q)[0], chain.tip)[0], (poses,))
    target = tips[:, :3, 3] if position else tips
    guess = np.tile(resting(robot, chain), (poses, 1))
    settings, form = IkSettings(), recognised(chain, position)
    if form is None:
        found = solve_limb(chain, target, "auto", guess, settings, (poses,))
    else:  # so few poses are not worth a program
        found = certified_solutions(form, target, guess, settings.tolerances)
    if linked:
        found = with_linkages(robot, found, guess)
    solved = float(found.in_limits.any(axis=1).mean()) if poses else float("nan")
    return IkClass(limb, "position" if position else "pose", family, branches, solved, poses)


def family_of(chain: SerialChain, position: bool = False) -> tuple[str, int]:
    """How a limb is solved, and with how many branches."""
    form = recognised(chain, position)
    if form is not None:
        some = np.zeros((1, 3)) if position else as_array(chain.tip, (1,))
        walked = ", from the tip" if form.backwards else ""
        return f"closed form: {form.family}{walked}", form.branches(some).shape[1]
    if not position and has_branches(chain):
        free = "" if of_six(chain) is chain else ", tip free"
        if not by_relative(chain):
            return f"no special geometry: elimination{free}", BRANCHES
        near = relative(of_six(chain))
        assert near is not None
        return f"{near.family}{free} but for rounding: the nearest closed form, polished", BRANCHES
    return "numeric: Newton's method, further starts", 1
