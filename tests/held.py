"""Bioloids whose tips closures hold: both feet on the floor, two hands on one object; and a squat."""

from __future__ import annotations

from functools import cache

import numpy as np

import screwkin as sk
from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import twist_from_array
from screwkin.dynamics.on_floor import ground_margin, ground_reaction, soles_on_floor
from screwkin.files import text_sha256
from screwkin.mechanism.joint_motion import joint_motion
from screwkin.model.robot import Robot, robot_text

FEET_TEXT = """
[[closure]]
name = "right_sole"
link_a = "right_foot_link"
frame_a = { xyz = [0, "-hip_y", "-thigh - calf - ankle_height"] }
link_b = "floor"
frame_b = { xyz = [0, "-hip_y", 0] }
"""
HANDS_TEXT = """
[[closure]]
name = "object"
link_a = "right_hand_link"
frame_a = { xyz = [0, 0, "shoulder_z - upper_arm - forearm"] }
link_b = "left_hand_link"
frame_b = { xyz = [0, 0, "shoulder_z - upper_arm - forearm"] }
"""


def with_closures(name: str, closures: str) -> Robot:
    """A bundled robot and further closures; those of the right leg are mirrored."""
    return sk.robot_from_text(sk.load_robot(name).text + closures)


@cache
def on_both_feet() -> Robot:
    return with_closures("bioloid", FEET_TEXT)


@cache
def holding() -> Robot:
    """Its hands must meet the closure at home as the table of the complete Bioloid has them."""
    return with_closures("bioloid24", HANDS_TEXT)


def squat(robot: Robot, depth: float = 0.02, duration: float = 1.0, rate: float = 100.0) -> sk.Trajectory:
    """The base of a robot on both feet sinks and rises again, its hands with it."""
    home, t = sk.home(robot), np.linspace(0, duration, round(duration * rate) + 1)
    s = t / duration
    z, dz, ddz = (-depth * p for p in _bump(s))
    T = np.tile(home.T_world_base, (len(t), 1, 1))
    T[:, 2, 3] += z
    twist, acceleration = np.zeros((2, len(t), 6))
    twist[:, 5], acceleration[:, 5] = dz / duration, ddz / duration**2
    mechanism = sk.closed_mechanism(robot)
    targets = {"base": T}
    for limb in robot.limbs:
        place = np.tile(sk.frame_pose(robot, home, limb.tip), (len(t), 1, 1))
        if limb.kind == "arm":
            place[:, 2, 3] += z
            targets[limb.tip] = place[:, :3, 3]
    solved = sk.solve_pose(robot, targets)
    assert solved.ok
    q, moved = solved.state.q, ("waist", *(limb.tip for limb in robot.limbs if limb.kind == "arm"))
    motion = joint_motion(
        mechanism,
        T,
        q,
        {name: twist_from_array(twist) for name in moved},
        {name: twist_from_array(acceleration) for name in moved},
    )
    return _trajectory(robot, t, T, twist, acceleration, q, motion.qd, motion.qdd)


def _bump(s: Array) -> tuple[Array, Array, Array]:
    """A smooth way from 0 to 1 and back over s in [0, 1], with two derivatives."""
    x = 2 * np.pi * s
    return (1 - np.cos(x)) / 2, np.pi * np.sin(x), 2 * np.pi**2 * np.cos(x)


def _trajectory(
    robot: Robot, t: Array, T: Array, twist: Array, acceleration: Array, q: Array, qd: Array, qdd: Array
) -> sk.Trajectory:
    zmp, com, wrench, _ = ground_reaction(robot, T, q, qd, qdd, twist, acceleration)
    state = sk.State(T, q)
    poses = {tip: sk.frame_pose(robot, state, tip) for tip in robot.tip_names}
    feet = tuple(limb.tip for limb in robot.limbs if limb.kind == "leg")
    contact = np.ones((len(t), len(feet)), dtype=bool)
    table = robot_text(robot)
    named = {"name": robot.name, "table": table, "sha256": text_sha256(table), "path": ""}
    return sk.Trajectory(
        time=t,
        joint_names=robot.joint_names,
        q=q,
        qd=qd,
        qdd=qdd,
        T_world_base=T,
        base_twist=twist,
        base_acceleration=acceleration,
        T_world_tip=poses,
        contact=contact,
        feet=feet,
        com=com,
        zmp=zmp,
        margin=ground_margin(zmp, com, wrench, soles_on_floor(robot, feet, poses), contact),
        meta={"robot": named},
    )
