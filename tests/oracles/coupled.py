"""Pinocchio's word on robots with coupled joints: its mimic joints, or free joints and the chain rule."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

import screwkin as sk
from screwkin.model.robot import Robot
from tests.model.urdf_texts import random_urdf


def coupled_tree(rng: np.random.Generator, links: int = 9) -> str:
    """A random tree in which joints follow joints of their kind on the way from the root.

    Pinocchio's mimic joints can follow no others: neither joints of another kind nor of other branches.
    """
    root = ElementTree.fromstring(random_urdf(rng, links).replace("continuous", "revolute"))
    above = {joint.find("child").get("link"): joint for joint in root.findall("joint")}
    for joint in root.findall("joint"):
        leaders, link = [], joint.find("parent").get("link")
        while link in above:
            if above[link].get("type") == joint.get("type") and above[link].find("mimic") is None:
                leaders.append(above[link].get("name"))
            link = above[link].find("parent").get("link")
        if leaders and joint.get("type") != "fixed":
            couple(joint, rng.choice(leaders), rng)
    return ElementTree.tostring(root, encoding="unicode")


def tangled_tree(rng: np.random.Generator, links: int = 9) -> str:
    """A random tree in which joints follow joints of any kind and branch, and those that follow others."""
    root = ElementTree.fromstring(random_urdf(rng, links))
    moving = [joint for joint in root.findall("joint") if joint.get("type") != "fixed"]
    rng.shuffle(moving)
    for k, joint in enumerate(moving[1:], 1):
        if k % 3:
            couple(joint, rng.choice([one.get("name") for one in moving[:k]]), rng)
    return ElementTree.tostring(root, encoding="unicode")


def couple(joint: ElementTree.Element, leader: str, rng: np.random.Generator) -> None:
    ratio, offset = rng.choice([-1.0, 1.0, *rng.uniform(-2, 2, 3)]), rng.choice([0.0, *rng.uniform(-1, 1, 2)])
    ElementTree.SubElement(
        joint, "mimic", joint=leader, multiplier=repr(float(ratio)), offset=repr(float(offset))
    )


@dataclass(frozen=True, eq=False)
class Motion:
    """A random motion of a robot: base pose, positions, rates and accelerations, and of the base."""

    T: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    base: np.ndarray
    base_rate: np.ndarray

    @property
    def state(self) -> sk.State:
        return sk.State(self.T, self.q)


class Oracle:
    """A robot's URDF in Pinocchio, its coupled joints its own (``mimic``) or those of the chain rule."""

    def __init__(self, text: str, robot: Robot, mimic: bool, root: str = "") -> None:
        """``root`` names the file's own floating joint, if it has one."""
        bare = re.sub(r"<\?xml[^<>]*\?>", "", text).strip()
        floating = robot.base == "floating" and not root
        free = [pin.JointModelFreeFlyer()] if floating else []
        self.model = pin.buildModelFromXML(bare, *free, mimic=mimic)
        self.data, self.robot = self.model.createData(), robot
        self.root = root or ("root_joint" if floating else "")
        joints = robot.joints if mimic else robot.tree
        self.at = [self.joint(joint.name).idx_v for joint in joints]
        self.names = [joint.name for joint in joints]
        n, m = len(robot.joints), len(robot.coupled)
        G = np.zeros((n + m, n))
        G[range(n), range(n)] = 1
        for k, joint in enumerate(robot.coupled, n):
            G[k, robot.joint_names.index(joint.leader)] = joint.ratio
        self.G = G[: len(joints)]
        self.offset = np.array([0.0] * n + [joint.offset for joint in robot.coupled])[: len(joints)]

    def joint(self, name: str) -> Any:
        return self.model.joints[self.model.getJointId(name)]

    def motion(self, rng: np.random.Generator) -> Motion:
        q, qd, qdd = rng.uniform(-1, 1, (3, len(self.robot.joints)))
        if self.robot.base == "fixed":
            return Motion(np.eye(4), q, qd, qdd, np.zeros(6), np.zeros(6))
        quat = rng.normal(size=4)
        T = pin.XYZQUATToSE3(np.r_[rng.uniform(-1, 1, 3), quat / np.linalg.norm(quat)]).homogeneous
        return Motion(T, q, qd, qdd, *rng.uniform(-1, 1, (2, 6)))

    def answers(self, m: Motion) -> Mapping[str, np.ndarray]:
        """What Pinocchio says of a motion, in this library's order and axes."""
        model, data, G = self.model, self.data, self.G
        Q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for name, x in zip(self.names, G @ m.q + self.offset, strict=True):
            one = self.joint(name)
            Q[one.idx_q : one.idx_q + one.nq] = [x] if one.nq == 1 else [np.cos(x), np.sin(x)]
        v[self.at], a[self.at] = G @ m.qd, G @ m.qdd
        base = []
        if self.root:
            one, R = self.joint(self.root), m.T[:3, :3]
            Q[one.idx_q : one.idx_q + 7] = pin.SE3ToXYZQUAT(pin.SE3(m.T))
            base = [*range(one.idx_v, one.idx_v + 6)]
            v[base] = np.r_[R.T @ m.base[3:], R.T @ m.base[:3]]
            spin = R.T @ (m.base_rate[3:] - np.cross(m.base[:3], m.base[3:]))
            a[base] = np.r_[spin, R.T @ m.base_rate[:3]]
        pin.computeJointJacobians(model, data, Q)
        pin.updateFramePlacements(model, data)
        frames = [model.getFrameId(name, pin.FrameType.BODY) for name in self.robot.link_names]
        last = frames[self.robot.link_names.index(self.robot.tree[-1].child)]
        J = pin.getFrameJacobian(model, data, last, pin.LOCAL_WORLD_ALIGNED)[:, self.at] @ G
        poses = np.array([data.oMf[f].homogeneous for f in frames])
        M = np.triu(pin.crba(model, data, Q))
        M = M + np.triu(M, 1).T
        tau = pin.rnea(model, data, Q, v, a)
        result = {
            "poses": poses,
            "jacobian": np.vstack([J[3:], J[:3]]),
            "mass": G.T @ M[np.ix_(self.at, self.at)] @ G,
            "efforts": G.T @ tau[self.at],
        }
        if base and self.robot.mass:
            f, moment = R @ tau[base[:3]], R @ tau[base[3:]]
            h = pin.computeCentroidalMomentum(model, data, Q, v)
            result |= {
                "com": pin.centerOfMass(model, data, Q),
                "com_jacobian": pin.jacobianCenterOfMass(model, data, Q)[:, self.at] @ G,
                "momentum": np.r_[h.angular, h.linear],
                "ground": np.r_[moment + np.cross(m.T[:3, 3], f), f],
            }
        return result

    def ours(self, m: Motion) -> Mapping[str, np.ndarray]:
        """What this library says of it."""
        robot, s = self.robot, m.state
        result = {
            "poses": sk.link_poses(robot, s),
            "jacobian": sk.jacobian(robot, s, robot.tree[-1].child)[:, 6:],
            "mass": sk.mass_matrix(robot, s)[6:, 6:],
            "efforts": sk.inverse_dynamics(robot, s, m.qd, m.qdd, m.base, m.base_rate)[6:],
        }
        if self.root and robot.mass:
            result |= {
                "com": sk.center_of_mass(robot, s),
                "com_jacobian": sk.com_jacobian(robot, s)[:, 6:],
                "momentum": sk.momentum(robot, s, m.qd, m.base),
                "ground": sk.ground_wrench(robot, s, m.qd, m.qdd, m.base, m.base_rate),
            }
        return result

    def check(self, rng: np.random.Generator) -> None:
        """Every quantity agrees to 1e-9 of its size."""
        motion = self.motion(rng)
        ours, theirs = self.ours(motion), self.answers(motion)
        for what, value in theirs.items():
            scale = max(1.0, float(np.abs(value).max(initial=0)))
            np.testing.assert_allclose(ours[what], value, rtol=0, atol=1e-9 * scale, err_msg=what)
