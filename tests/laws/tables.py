"""The same robot described otherwise: points of axes, base frame, order of rows, needless joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import screwkin as sk
from screwkin.algebra.screws import Screw, carry
from screwkin.algebra.se3 import IDENTITY, Pose, Vector, pose_from_array
from screwkin.model.robot import Inertia, Joint, Link


def slid(robot: sk.Robot, rng: np.random.Generator, far: float = 10.0) -> sk.Robot:
    """The robot with the point of every axis anywhere on it, up to ``far`` metres away."""
    joints = [
        replace(j, screw=replace(j.screw, s0=j.screw.s0 + j.screw.s * float(rng.uniform(-far, far))))
        for j in robot.joints
    ]
    return replace(robot, joints=tuple(joints))


def based(robot: sk.Robot, T_old_new: Pose) -> sk.Robot:
    """The robot described in another base frame, given by its pose in the present one (kinematics only)."""
    back = T_old_new.inverse
    return replace(
        robot,
        joints=tuple(replace(j, screw=carry(back, j.screw)) for j in robot.joints),
        limbs=tuple(replace(limb, frame=back @ limb.frame) for limb in robot.limbs),
        closures=tuple(
            replace(c, frame_a=back @ c.frame_a, frame_b=back @ c.frame_b) for c in robot.closures
        ),
    )


def shuffled(robot: sk.Robot, rng: np.random.Generator) -> tuple[sk.Robot, np.ndarray]:
    """The robot with its rows in another order, and where every new joint stood before."""
    order = rng.permutation(len(robot.joints))
    postures = [replace(p, q=tuple(p.q[i] for i in order)) for p in robot.postures]
    joints, limbs = [robot.joints[i] for i in order], rng.permutation(len(robot.limbs))
    return replace(
        robot,
        joints=tuple(joints),
        postures=tuple(postures),
        limbs=tuple(robot.limbs[i] for i in limbs),
    ), order


def necked(robot: sk.Robot) -> sk.Robot:
    """The robot with one joint more, on its base, that no limb and no loop needs."""
    link = Link("head", 0.1, Vector(0, 0, 0.2), Inertia(1e-4, 1e-4, 1e-4), IDENTITY)
    screw = Screw(Vector(0, 0, 1), Vector(0.3, 0.1, 2.0))
    joint = Joint("neck", robot.base_link, "head", "revolute", screw, -1.5, 1.5, 5.0, 1.0)
    postures = [replace(p, q=(*p.q, 0.0)) for p in robot.postures]
    return replace(robot, links=(*robot.links, link), joints=(*robot.joints, joint), postures=tuple(postures))


def waisted(robot: sk.Robot) -> sk.Robot:
    """The robot with a vertical joint in its base, below all limbs but the legs."""
    pelvis = Link("pelvis", 0.2, Vector(0, 0, 0), Inertia(1e-4, 1e-4, 1e-4), IDENTITY)
    legs = {robot.path_to(limb.link)[0] for limb in robot.limbs if limb.kind == "leg"}
    joints = [replace(j, parent="pelvis") if i in legs else j for i, j in enumerate(robot.joints)]
    screw = Screw(Vector(0, 0, 1), Vector(0.01, 0.0, 0.0))
    yaw = Joint("waist_yaw", "pelvis", robot.base_link, "revolute", screw, -1.5, 1.5, 5.0, 1.0)
    postures = [replace(p, q=(*p.q, 0.0)) for p in robot.postures]
    return replace(
        robot,
        base_link="pelvis",
        links=(pelvis, *robot.links),
        joints=(*joints, yaw),
        postures=tuple(postures),
    )


def moved_base(T_world_base: np.ndarray, T_old_new: np.ndarray) -> np.ndarray:
    """Where the new base frame is."""
    return np.asarray(T_world_base @ T_old_new)


def somewhere(rng: np.random.Generator, far: float = 10.0) -> np.ndarray:
    """A pose (4, 4) anywhere within ``far`` metres."""
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T[:3, :3] *= np.linalg.det(T[:3, :3])
    T[:3, 3] = rng.uniform(-far, far, 3)
    return T


def as_pose(T: np.ndarray) -> Pose:
    return pose_from_array(T)
