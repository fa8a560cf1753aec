"""The legs' last links in PyBullet: where their tips are, and what the sensors above them feel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Limb, Robot
from screwkin.model.urdf import urdf_frames
from screwkin.sim.backend import moment_about_origin
from screwkin.sim.pybullet_look import Look, pose_of


class Feet:
    """The feet of a body, in the order of the robot's legs, and its base."""

    def __init__(
        self,
        p: Any,
        client: dict[str, int],
        body: int,
        joints: Sequence[int],
        robot: Robot,
        link_names: Sequence[str],
    ) -> None:
        """Read their frames, and switch on the sensors in the joints above them.

        Args:
            p: the module of the engine.
            client: the arguments that name its client.
            body: index of the body.
            joints: indices of its joints, as a ``Look`` has them.
            robot: whose legs they are.
            link_names: of base and links, by their index less one.
        """
        legs = [limb for limb in robot.limbs if limb.kind == "leg"]
        self.indices = [link_names.index(limb.link) - 1 for limb in legs]
        info = [p.getDynamicsInfo(body, index, **client) for index in (-1, *self.indices)]
        for index in self.indices:
            p.enableJointForceTorqueSensor(body, index, True, **client)
        self._links = np.array([0, *(joints.index(index) + 1 for index in self.indices)])
        self._mass = np.array([d[0] for d in info])[1:, None]
        T_link_inertial = np.array([pose_of(d[3], d[4]) for d in info])
        frames = urdf_frames(robot)
        T_link_tip = [as_array(frames[limb.link].inverse @ limb.frame) for limb in legs]
        self._T_inertial_own = np.linalg.inv(T_link_inertial) @ np.array([np.eye(4), *T_link_tip])
        axes = [_axis(robot, limb, R.T) for limb, R in zip(legs, T_link_inertial[1:, :3, :3], strict=True)]
        self._axes = np.array(axes).reshape(-1, 6)

    def poses(self, look: Look) -> Array:
        """World poses (1 + feet, 4, 4) of the base link and of the tips."""
        T = np.zeros((len(self._links), 4, 4))
        T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = look.axes[self._links], look.com[self._links], 1.0
        return np.asarray(T @ self._T_inertial_own)

    def wrenches(self, look: Look, gravity: Array) -> Array:
        """Ground wrenches [m; f] (feet, 6) about the world origin, by the sensors above feet at rest.

        PyBullet reports the reaction on the child in the child's inertial frame, about its CoM, without the
        share of the motor. The floor supplies what is needed beside that and the foot's weight.
        """
        links, wrenches = self._links[1:], np.zeros((len(self.indices), 6))
        if not len(links):
            return wrenches
        motor = look.motor[links - 1, None]
        felt = np.array([look.joints[row][2] for row in (links - 1).tolist()]) + motor * self._axes
        turned = look.axes[links] @ felt.reshape(-1, 2, 3).transpose(0, 2, 1)
        force = wrenches[:, 3:] = -self._mass * gravity - turned[:, :, 0]
        about = [moment_about_origin(at, f) for at, f in zip(look.com[links], force, strict=True)]
        wrenches[:, :3] = about - turned[:, :, 1]
        return wrenches


def _axis(robot: Robot, limb: Limb, R_inertial_link: Array) -> Array:
    """What the motor above a foot adds to a sensor's [f; m] (6,), per unit of it, in the inertial frame."""
    joint = robot.tree[robot.joint_above[limb.link]]
    axis = R_inertial_link @ as_array(urdf_frames(robot)[limb.link].inverse.R @ joint.screw.s)
    none = np.zeros(3)
    return np.concatenate([none, axis] if joint.type == "revolute" else [axis, none])
