"""MuJoCo by its Python interface, one call per sample."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.peers.pinocchio_python import as_slice, seen_from_base, zmp
from benchmarks.workloads import Dynamic, Motion
from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Robot
from screwkin.model.urdf import urdf_frames, urdf_from_robot

Array = Any
NAME = "MuJoCo, Python"


class Body:
    """A robot as MuJoCo reads it from URDF, on a free joint."""

    def __init__(self, robot: Robot) -> None:
        import mujoco

        self.mujoco = mujoco
        spec = mujoco.MjSpec.from_string(urdf_from_robot(robot.with_inertia_floor()))
        spec.worldbody.first_body().add_freejoint()
        self.model = spec.compile()
        self.model.opt.gravity[:] = [0.0, 0.0, -9.81]
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joint_names]
        self.q = [joint.qposadr[0] for joint in joints]
        self.v = [joint.dofadr[0] for joint in joints]
        frames = urdf_frames(robot)
        self.tips = []
        for limb in robot.limbs:
            place = as_array(frames[limb.link].inverse @ limb.frame).astype(float)
            columns = as_slice([self.v[i] for i in robot.path_to(limb.link)])
            self.tips.append((limb, self.model.body(limb.link).id, place, columns))

    def configuration(self, T: Array, q: Array) -> Array:
        """(B, nq)."""
        out = np.empty((len(q), self.model.nq))
        out[:, :3] = T[:, :3, 3]
        out[:, 3:7] = Rotation.from_matrix(T[:, :3, :3]).as_quat(scalar_first=True)
        out[:, self.q] = q
        return out

    def velocity(self, T: Array, twist: Array, qd: Array) -> Array:
        """(B, nv): v in world axes, omega in base axes, joint rates; accelerations alike."""
        out = np.empty((len(qd), self.model.nv))
        out[:, :3] = twist[:, 3:]
        out[:, 3:6] = (T[:, :3, :3].swapaxes(1, 2) @ twist[:, :3, None])[..., 0]
        out[:, self.v] = qd
        return out


def rates(robot: Robot, given: Motion) -> Contestants:
    """W1: kinematics, the tips' Jacobians, and one small solve per limb."""
    body = Body(robot)
    mujoco, model, data = body.mujoco, body.model, body.data
    q = body.configuration(given.T_world_base, given.q)
    v, W, omega = seen_from_base(given)
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))

    def run() -> Result:
        poses, out = np.zeros((len(q), len(body.tips), 4, 4)), np.empty((len(q), model.nv))
        poses[..., 3, 3] = 1
        for k in range(len(q)):
            data.qpos[:] = q[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            for i, (limb, link, place, columns) in enumerate(body.tips):
                R = data.xmat[link].reshape(3, 3)
                p = data.xpos[link] + R @ place[:3, 3]
                poses[k, i, :3, :3], poses[k, i, :3, 3] = R @ place[:3, :3], p
                mujoco.mj_jac(model, data, linear, angular, p, link)
                name = limb.tip
                right = v[name][k] - W[name][k] @ p
                if name in omega:
                    A = np.vstack([angular[:, columns], linear[:, columns]])
                    out[k, columns] = np.linalg.solve(A, np.concatenate([omega[name][k], right]))
                else:
                    out[k, columns] = np.linalg.solve(linear[:, columns], right)
        return {"poses": poses, "rates": out[:, body.v]}

    return {NAME: Contestant(run)}


def balance(robot: Robot, given: Dynamic) -> Contestants:
    """W4: inverse dynamics, and the subtree's centre and momentum."""
    body = Body(robot)
    mujoco, model, data = body.mujoco, body.model, body.data
    T = given.T_world_base
    q = body.configuration(T, given.q)
    v, a = body.velocity(T, given.twist, given.qd), body.velocity(T, given.acceleration, given.qdd)
    mass = model.body_subtreemass[0]

    def run() -> Result:
        com, momentum, wrench = (np.empty((len(q), size)) for size in (3, 6, 6))
        for k in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
            mujoco.mj_inverse(model, data)
            mujoco.mj_subtreeVel(model, data)
            com[k] = data.subtree_com[0]
            momentum[k, :3], momentum[k, 3:] = data.subtree_angmom[0], mass * data.subtree_linvel[0]
            wrench[k, 3:], wrench[k, :3] = data.qfrc_inverse[:3], data.qfrc_inverse[3:6]
        moment = (T[:, :3, :3] @ wrench[:, :3, None])[..., 0]
        wrench[:, :3] = moment + np.cross(T[:, :3, 3], wrench[:, 3:])
        return {"com": com, "momentum": momentum, "zmp": zmp(wrench)}

    return {NAME: Contestant(run)}
