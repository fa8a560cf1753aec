"""Random robots with limbs, and targets that their own positions inside the limits fulfil."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import screwkin as sk
from screwkin.algebra.screws import Screw
from screwkin.model.robot import Joint, Limb
from tests.kinematics.machines import body, machine, point, pose, unit

LIMBS = ((6, 6), (3, 3), (7, 3), (6, 4), (5, 6))
"""Numbers of joints of two limbs; every third robot has a joint below both."""


def random_robot(seed: int) -> sk.Robot:
    """Two limbs of revolute joints with any axes and limits."""
    rng = np.random.default_rng(seed)
    links, joints = [body(rng, "base")], []
    root = "base"

    def grow(name: str, parent: str) -> None:
        low, high = -rng.uniform(0.8, 2.8), rng.uniform(0.8, 2.8)
        screw = Screw(unit(rng), point(rng))
        joints.append(Joint(name, parent, f"{name}_link", "revolute", screw, low, high, 5.0, 5.0))
        links.append(body(rng, f"{name}_link"))

    if seed % 3 == 2:
        grow("waist", root)
        root = "waist_link"
    limbs = []
    for side, count in zip(("left", "right"), LIMBS[seed % len(LIMBS)], strict=True):
        parent = root
        for k in range(count):
            grow(f"{side}_{k}", parent)
            parent = f"{side}_{k}_link"
        chain = ("px", "py", "pz", "rx", "ry", "rz")
        limbs.append(Limb(f"{side}_arm", "arm", parent, f"{side}_hand", pose(rng), chain))
    home = [rng.uniform(0.5 * j.lower, 0.5 * j.upper) for j in joints]
    return machine(links, joints, "floating", tuple(limbs), home=home)


def inside(robot: sk.Robot, count: int, seed: int = 0, spread: float | None = None) -> np.ndarray:
    """Joint positions (count, n) drawn evenly within the limits, or about home by a normal distribution."""
    rng = np.random.default_rng(seed)
    lower, upper = (np.array([getattr(j, side) for j in robot.joints]) for side in ("lower", "upper"))
    if spread is None:
        return rng.uniform(lower, upper, (count, len(lower)))
    return np.clip(sk.home(robot).q + spread * rng.normal(size=(count, len(lower))), lower, upper)


def targets_at(robot: sk.Robot, q: np.ndarray, T: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """What positions fulfil: poses of tips of limbs with six joints or more, positions of others."""
    state = sk.State(np.eye(4) if T is None else T, q)
    targets = {}
    for limb in robot.limbs:
        tip = sk.frame_pose(robot, state, limb.tip)
        own = len(robot.path_to(limb.link)) >= 6
        targets[limb.tip] = tip if own else tip[..., :3, 3]
    return targets


def at(targets: dict[str, np.ndarray], samples: object) -> dict[str, np.ndarray]:
    """Some of the samples."""
    return {name: target[samples] for name, target in targets.items()}


def slid(robot: sk.Robot, seed: int, size: float = 10.0) -> sk.Robot:
    """The robot with other points named on the same axes."""
    rng = np.random.default_rng(seed)
    joints = []
    for joint in robot.joints:
        s, s0 = joint.screw.s, joint.screw.s0
        joints.append(
            replace(joint, screw=Screw(s, s0 + s * float(rng.uniform(-size, size)), joint.screw.pitch))
        )
    return replace(robot, joints=tuple(joints))
