"""Robots and random states that the oracles are asked about."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Robot
from screwkin.model.urdf import urdf_frames
from tests.kinematics.machines import random_tree

STATES = 100
TOLERANCE = 1e-10
"""Both sides round at 1e-16 of numbers up to a few hundred, through chains of up to seven joints."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sample:
    """Random states with rates and accelerations, (K, ...)."""

    state: sk.State
    qd: Array
    qdd: Array
    base_twist: Array
    base_acceleration: Array


def without_helical(robot: Robot) -> Robot:
    """URDF has no helical joints: they lose their pitch."""
    joints = [
        replace(joint, type="revolute", screw=replace(joint.screw, pitch=0))
        if joint.type == "helical"
        else joint
        for joint in robot.joints
    ]
    return replace(robot, joints=tuple(joints))


def asked(name: str) -> Robot:
    """A bundled robot, or ``tree-SEED``: a random tree whose link frames lie off the joints' axes."""
    seed = name.removeprefix("tree-")
    robot = without_helical(random_tree(int(seed))) if seed != name else sk.load_robot(name)
    return robot.with_inertia_floor()


def random_sample(robot: Robot, seed: int = 5) -> Sample:
    rng = np.random.default_rng(seed)
    n = len(robot.joints)
    T = np.tile(np.eye(4), (STATES, 1, 1))
    T[:, :3, :3] = Rotation.random(STATES, random_state=seed).as_matrix()
    T[:, :3, 3] = rng.uniform(-1, 1, (STATES, 3))
    q, qd, qdd = rng.uniform(-2.5, 2.5, (3, STATES, n))
    twist, acceleration = rng.uniform(-2, 2, (2, STATES, 6))
    return Sample(sk.State(T, q), qd, qdd, twist, acceleration)


def poses_in_urdf_frames(robot: Robot, state: sk.State) -> Array:
    """Our link poses (K, L, 4, 4), carried over to the frames that the URDF declares."""
    frames = urdf_frames(robot)
    carried = [as_array(link.frame.inverse @ frames[link.name]) for link in robot.links]
    return np.asarray(sk.link_poses(robot, state) @ np.array(carried, dtype=float))


def assert_agree(ours: object, theirs: object) -> None:
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    assert ours.shape == theirs.shape
    scale = max(1.0, float(np.abs(theirs).max()))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=TOLERANCE * scale)
