"""A motion of joints and base from elsewhere as a trajectory: rates, balance, a record of the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import screwkin as sk
from screwkin.algebra.arrays import Array
from screwkin.files import text_sha256
from screwkin.model.robot import Robot, robot_text
from screwkin.trajectory import Trajectory

RATE = 100.0
"""Samples of the trajectory per second [Hz]."""


def trajectory_of(robot: Robot, time: Array, q: Array, T_world_base: Array, contact: Array) -> Trajectory:
    """The trajectory through samples, by cubic splines.

    Args:
        robot: n joints; its legs in table order are the feet.
        time: of the samples (S,) [s].
        q: joint positions (S, n) [rad].
        T_world_base: poses (S, 4, 4).
        contact: of the feet (S, feet) bool, held between samples.
    """
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation, RotationSpline

    t = np.arange(time[0], time[-1], 1.0 / RATE)
    joints, place = CubicSpline(time, q), CubicSpline(time, T_world_base[:, :3, 3])
    turn = RotationSpline(time, Rotation.from_matrix(T_world_base[:, :3, :3]))
    T = np.tile(np.eye(4), (len(t), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = turn(t).as_matrix(), place(t)
    spin = [np.einsum("tij,tj->ti", T[:, :3, :3], turn(t, k)) for k in (1, 2)]  # turn: rates in body axes
    tips = sk.tip_poses(robot, sk.State(T, joints(t)))
    feet = tuple(limb.tip for limb in robot.limbs if limb.kind == "leg")
    table = robot_text(robot)
    motion = Trajectory(
        time=t,
        joint_names=robot.joint_names,
        q=joints(t),
        qd=joints(t, 1),
        qdd=joints(t, 2),
        T_world_base=T,
        base_twist=np.hstack([spin[0], place(t, 1)]),
        base_acceleration=np.hstack([spin[1], place(t, 2)]),
        T_world_tip=dict(zip(robot.tip_names, np.moveaxis(np.asarray(tips), 1, 0), strict=True)),
        contact=np.asarray(contact)[np.searchsorted(time, t, side="right") - 1],
        feet=feet,
        com=np.zeros((len(t), 3)),
        zmp=np.zeros((len(t), 2)),
        margin=np.zeros(len(t)),
        meta={"robot": {"name": robot.name, "table": table, "sha256": text_sha256(table), "path": ""}},
    )
    balance = sk.zmp(robot, motion)
    return replace(motion, com=balance.com, zmp=balance.zmp, margin=balance.margin)
