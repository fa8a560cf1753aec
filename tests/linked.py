"""Bioloids with linkages in their legs: the bundled ones, cases of users, and knees by any four-bar."""

from __future__ import annotations

import re
from functools import cache

import numpy as np

import screwkin as sk
from screwkin.algebra.arrays import Array
from screwkin.model.library import find_robot
from screwkin.model.robot import Robot
from screwkin.model.table import parse_robot

BUNDLED = ("linkages/knee-parallelogram", "linkages/parallel-ankles", "linkages/tarsus-legs")
KNEES = find_robot("linkages/knee-parallelogram").read_text(encoding="utf-8")

FLAT_AT_90 = KNEES.replace('bar_angle = "-60*deg"', 'bar_angle = "0*deg"')
"""The parallelogram that lies flat at a knee of 90 degrees."""


@cache
def flat_at_90() -> Robot:
    return parse_robot(FLAT_AT_90)


@cache
def short_bars() -> Robot:
    """The same on bars of 20 mm, and with forearms in line with the upper arms."""
    return parse_robot(
        FLAT_AT_90.replace("bar = 0.03", "bar = 0.02").replace("arm_out = 0.02", "arm_out = 0")
    )


def four_bar_knee(top: tuple[float, float], end: tuple[float, float]) -> Robot:
    """A Bioloid whose reference posture is straight, with pins at x, z from hip pitch and knee axis [m]."""
    text = re.sub(
        r"(?s)\[\[posture\]\].*?(?=# ---- Servos)",
        '[[posture]]\nname = "home"\nbase_height = 0.18\n\n',
        KNEES,
    )
    x, z = (f'"{c:.17g}"' for c in top)
    text = re.sub(r"bar_x = .*\nbar_z = .*\n", f"bar_x = {x}\nbar_z = {z}\n", text)
    low = f'"{end[0]:.17g}", "-hip_y", "{end[1]:.17g} - thigh"'
    return parse_robot(text.replace('"bar_x", "-hip_y", "bar_z - thigh"', low))


def gaps(robot: Robot, q: Array) -> Array:
    """How far apart (..., closures) the frames of closures are, by the poses of links."""
    poses = sk.link_poses(robot, sk.State(np.eye(4), q))
    zero = sk.link_poses(robot, sk.State(np.eye(4), np.zeros(len(robot.joints))))
    apart = []
    for closure in robot.closures:
        a, b = (
            poses[..., robot.link_names.index(link), :, :]
            @ np.linalg.inv(zero[robot.link_names.index(link)])
            @ _matrix(frame)
            for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        )
        apart.append(np.abs(a - b).max(axis=(-2, -1)))
    return np.stack(apart, axis=-1)


def _matrix(pose: object) -> Array:
    from screwkin.algebra.se3 import as_array

    return as_array(pose).astype(float)


LEAVES = (("shin", 15.0, 0.005), ("achilles", 1e4, 2.0))
"""Cassie's two leaf springs on legs of 1.9 kg: stiffness and damping of each, N m/rad and N/m."""

GAIT_OF_LEAVES = {"lift": 0.015, "stride": 0.1, "waist_height": 0.165}
"""What the default gait is changed to for ``linkages/tarsus-legs``, with leaves or without."""


@cache
def leaf_legs() -> Robot:
    """``linkages/tarsus-legs`` with a leaf amid each shin, and one along each achilles rod."""
    text = find_robot("linkages/tarsus-legs").read_text(encoding="utf-8")
    row = """[[link]]
name = "right_{name}_end"
mass = {mass}
com = {com}
inertia = {{ box = [0.01, 0.01, "shin/2"] }}

[[joint]]
name = "right_{name}_leaf"
parent = "right_{name}"
child = "right_{name}_end"
type = "{type}"
s = {s}
s0 = {s0}
passive = true
stiffness = {k}
damping = {d}

[[joint]]
name = "right_heel\""""
    shin = {"mass": 0.02, "com": '[0, "-hip_y", "-thigh - shin"]', "type": "revolute", "s": [0, 1, 0]}
    rod = {"mass": 0.004, "com": '["heel_x", "-hip_y", "-thigh - shin + heel_z"]', "type": "prismatic"}
    for (name, k, d), what, place in (
        (LEAVES[0], shin, '[0, "-hip_y", "-thigh - shin/2"]'),
        (LEAVES[1], {**rod, "s": [0, 0, 1]}, '["heel_x", "-hip_y", "-thigh"]'),
    ):
        new = row.format(name=name, k=k, d=d, s0=place, **what)
        text = text.replace('[[joint]]\nname = "right_heel"', new, 1)
    text = text.replace(
        'parent = "right_shin"\nchild = "right_tarsus"', 'parent = "right_shin_end"\nchild = "right_tarsus"'
    )
    text = text.replace(
        'parent = "right_achilles"\nchild = "right_heel_eye"',
        'parent = "right_achilles_end_link"\nchild = "right_heel_eye"',
    )
    return parse_robot(text.replace("right_achilles_end_link", "right_achilles_end"))
