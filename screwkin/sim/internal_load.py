"""What two feet press against each other: a load that rigid servos leave open, and that no motion needs.

Two legs and the floor close a loop. What is held in it follows from the stiffness of servos and from errors
of position; rigid servos have none, and bring up all of their torque against an error of micrometres. The
wrench of the floor as a whole follows from the motion alone. So torques are asked for here as if each foot
carried its share of that wrench, as ``screwkin.gait.feed_forward`` plans it.
"""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array, Booleans, stretches
from screwkin.gait.loads import way_to_first
from screwkin.kinematics.body import frame_pose, jacobian
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.trajectory import Trajectory

FEET = 2
"""As many feet are told apart by where the ZMP lies between them."""
LOADED = 0.02
"""Least share of the weight on a foot that carries."""
STILL = 1e-4, 1e-3
"""How far [m, rad] commands may move one standing foot against the other, which presses them by intent."""


def legs_of(robot: Robot) -> tuple[str, ...]:
    """Tips of the legs, in table order."""
    return tuple(limb.tip for limb in robot.limbs if limb.kind == "leg")


def on_both(wrenches: Array) -> Booleans:
    """Whether both feet carry; ground wrenches (M, 2, 6) [m; f] on either."""
    up = wrenches[:, :, 5]
    return np.asarray(up.min(axis=1) > LOADED * np.maximum(up.sum(axis=1), 0.0))


def without_internal_load(robot: Robot, state: State, torque: Array, wrenches: Array) -> Array:
    """Torques (M, n) with which joints carry the same load while the feet do not press against each other.

    Each foot gets its share of the ground wrench, by the way of the ZMP from foot to foot, moved to its own
    centre of pressure. No wrench on one foot that the other one answers changes the result.

    Args:
        robot: a tree of n joints with two legs.
        state: M samples.
        torque: (M, n) of the joints [N m, N for prismatic ones].
        wrenches: (M, 2, 6) [m; f] of the floor on the feet of its legs, in table order, about the world
            origin [N m, N].
    """
    legs, whole = legs_of(robot), wrenches.sum(axis=1)
    places = [frame_pose(robot, state, leg)[:, :3, 3] for leg in legs]
    zmp = np.stack([-whole[:, 1], whole[:, 0]], axis=1) / whole[:, 5:]
    first = way_to_first(zmp, *(place[:, :2] for place in places))
    result = torque
    for leg, place, other, share, wrench in zip(
        legs, places, places[::-1], (first, 1.0 - first), np.moveaxis(wrenches, 1, 0), strict=True
    ):
        moment, force = whole[:, :3], whole[:, 3:]
        moment = moment + np.cross((1.0 - share)[:, None] * (place - other), force)
        spared = wrench - share[:, None] * np.concatenate([moment, force], axis=1)
        spared[:, :3] -= np.cross(place, spared[:, 3:])
        result = result + np.einsum("mij,mi->mj", jacobian(robot, state, leg)[:, :, 6:], spared)
    return result


def feet_held(robot: Robot, trajectory: Trajectory) -> Booleans:
    """Samples (T,) through whose double support the commands keep one foot still against the other."""
    both: Booleans = np.asarray(trajectory.contact.all(axis=1))
    state = State(np.eye(4), trajectory.q)
    a, b = (frame_pose(robot, state, leg) for leg in legs_of(robot))
    between, held = np.linalg.solve(a, b), np.array(both)
    for start, end in stretches(both):
        change = np.linalg.solve(between[start], between[start:end]) - np.eye(4)
        moved, turned = np.abs(change[:, :3, 3]).max(), np.abs(change[:, :3, :3]).max()
        held[start:end] = moved <= STILL[0] and turned <= STILL[1]
    return held
