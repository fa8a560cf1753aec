"""Feet as gaits set them down: frames on the sole, z along its normal, x forward."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, Rotation, Vector, as_array, cross, dot, norm
from screwkin.dynamics.support import sole_corners
from screwkin.errors import InputError
from screwkin.kinematics.positions import link_displacements
from screwkin.model.robot import Limb, Robot

LEVEL = float(np.cos(np.deg2rad(1.0)))
"""Cosine of the angle by which a foot's z axis may lean off its sole's normal."""
AHEAD = float(np.cos(np.deg2rad(45.0)))
"""Cosine of the angle by which a foot's x axis may turn away from the forward of ``[waist]`` at home."""
ON = 1e-6
"""Distance at which a foot's origin lies on its sole [m]."""


def upright(robot: Robot) -> Robot:
    """The robot with its feet's frames on their soles, z along the normal and x forward; itself if they are.

    A frame that is turned otherwise, or lies off the sole, is replaced by one that is not: its origin is the
    old one's foot on the sole. Forward is the x axis of ``[waist]``, without one that of the old frame.

    Args:
        robot: with a ``home`` posture.

    Raises:
        InputError: a frame that has to be replaced does not tell forward.
    """
    soled = {sole.limb for sole in robot.soles}
    frames = {limb.name: _standing(robot, limb) for limb in robot.limbs if limb.name in soled}
    if all(robot.limb(name).frame is frame for name, frame in frames.items()):
        return robot
    limbs = tuple(replace(limb, frame=frames.get(limb.name, limb.frame)) for limb in robot.limbs)
    return replace(robot, limbs=limbs)


def _standing(robot: Robot, limb: Limb) -> Pose:
    """The frame of a leg's tip on its sole, zero pose, base axes; the tip's own where it is one."""
    corners, frame = sole_corners(robot, limb.tip), limb.frame
    n = _normal(corners)
    n = n / np.linalg.norm(n)
    height = float(n @ corners.mean(axis=0))
    waist = robot.waist
    ahead = frame.R.x
    if waist is not None:
        D = link_displacements(robot, list(robot.posture("home").q))[robot.link_names.index(limb.link)]
        ahead = D.R.T @ waist.R.x
        turned = float(dot(ahead, frame.R.x)) < AHEAD
    else:
        turned = False
    if n[2] >= LEVEL and abs(height) <= ON and not turned:
        return frame
    z = frame.R @ Vector(*n.tolist())
    if n[2] >= LEVEL and not turned:
        return Pose(frame.R, frame.p + z * height)
    flat = ahead - z * dot(ahead, z)
    if float(norm(flat)) < AHEAD:
        lean = np.degrees(np.arccos(np.clip(n[2], -1, 1)))
        raise InputError(
            f"robot {robot.name}: the z axis of {limb.tip} leans by {lean:.3g} deg off its sole's normal, and"
            f" its x axis does not point forward; turn the frame of limb {limb.name} (x forward, z up), or"
            " write the frame that gaits steer as [waist]"
        )
    x = flat / norm(flat)
    return Pose(Rotation(*(_floats(v) for v in (x, cross(z, x), z))), _floats(frame.p + z * height))


def _normal(corners: Array) -> Array:
    """Normal (3,) of a polygon (k, 3) that runs counter-clockwise about it; twice its area long."""
    return np.asarray(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0))


def _floats(v: Vector) -> Vector:
    return Vector(*as_array(v).astype(float).tolist())
