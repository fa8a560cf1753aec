"""Robots with legs of any axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import screwkin as sk
from screwkin.algebra.se3 import pose_from_array


def with_leg(leg, seed):
    """A bundled robot whose left leg has other screws, and limits at random."""
    robot, rng = sk.load_robot("poppy12"), np.random.default_rng(seed)
    path = robot.path_to(robot.limb("left_leg").link)
    screws = dict(zip(path, leg.chain().screws, strict=True))
    low, high = -rng.uniform(1.0, 4.0, 12), rng.uniform(1.0, 4.0, 12)
    joints = tuple(
        replace(joint, screw=screws[i], lower=low[i], upper=high[i]) if i in screws else joint
        for i, joint in enumerate(robot.joints)
    )
    frame = pose_from_array(leg.tip)
    limbs = tuple(replace(m, frame=frame) if m.name == "left_leg" else m for m in robot.limbs)
    return replace(robot, joints=joints, limbs=limbs, postures=())
