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
