"""Loads on links: forces and wrenches anywhere, and the links' own weights."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.screws import Wrench
from screwkin.algebra.se3 import ZERO, Pose, Vector, cross, leaves
from screwkin.errors import ShapeError, UnknownNameError
from screwkin.kinematics.arrays import checked
from screwkin.kinematics.body import frame_pose
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Columns, Joints
from screwkin.kinematics.mass import GRAVITY
from screwkin.kinematics.positions import link_displacements
from screwkin.mechanism.actions import ActionSystem
from screwkin.model.robot import Robot
from screwkin.model.state import State


@formula
def link_weights(robot: Robot, T_world_base: Pose, q: Joints) -> Columns:
    """Weight of every link as a wrench, world axes, moments about the base origin.

    Args:
        robot: L links.
        state:

    Returns:
        (..., 6, L), columns [m; f] in ``robot.link_names`` order.
    """
    turned, columns = Pose(T_world_base.R, ZERO), []
    for link, D in zip(robot.links, link_displacements(robot, q), strict=True):
        force = Vector(0, 0, link.mass * -GRAVITY)
        columns.append(leaves(Wrench(cross(turned @ (D @ link.com), force), force)))
    return columns


def sorted_loads(robot: Robot, loads: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Loads on bodies, by the name of a link, tip or frame, and efforts of joints, by theirs.

    Raises:
        UnknownNameError: no such name. ShapeError: not one, three or six finite numbers.
    """
    bodily: dict[str, Array] = {}
    efforts: dict[str, Array] = {}
    for name, value in loads.items():
        if name in robot.joint_names and np.shape(value)[-1:] not in ((3,), (6,)):
            efforts[name] = checked(f"loads[{name!r}]", value)
            continue
        try:
            robot.frame(name)
        except UnknownNameError:
            raise UnknownNameError("link, tip, frame or joint", name, _places(robot)) from None
        size = (np.shape(value)[-1:] or (0,))[0]
        if size not in (3, 6):
            raise ShapeError(
                f"loads[{name!r}] has shape {np.shape(value)}; give a force of three numbers, or a wrench of "
                "six: [m about the world's origin; f]"
            )
        bodily[name] = checked(f"loads[{name!r}]", value, size)
    return bodily, efforts


def _places(robot: Robot) -> tuple[str, ...]:
    return (*robot.link_names, *robot.tip_names, *robot.joint_names)


def loads_on_links(
    robot: Robot, state: State, system: ActionSystem, bodily: Mapping[str, Array], weights: bool
) -> Array:
    """Wrenches (..., vertices, 6) of loads on the vertices of ``system.loaded``, about the base origin."""
    xp = numpy_of(state.q, state.T_world_base, *bodily.values())
    base = state.T_world_base[..., :3, 3]
    total: dict[str, Any] = {}

    def add(link: str, wrench: Any) -> None:
        vertex = system.vertex[link]
        total[vertex] = total[vertex] + wrench if vertex in total else wrench

    for name, value in bodily.items():
        link, _ = robot.frame(name)
        origin = base
        if value.shape[-1] == 3:
            arm = frame_pose(robot, state, name)[..., :3, 3] - base
            value, origin = xp.concatenate([xp.cross(arm, value), _like(xp, value, arm)], axis=-1), 0.0 * base
        add(link, _moved(xp, value, origin))
    if weights:
        W = link_weights(robot, state)
        for k, link in enumerate(robot.link_names):
            add(link, W[..., k])
    batch = np.broadcast_shapes((), *(np.shape(w)[:-1] for w in total.values()))
    none = xp.zeros((*batch, 6))
    if not system.loaded:
        return np.zeros((*batch, 0, 6))
    stacked: Array = xp.stack([none + total.get(v, 0.0) for v in system.loaded], axis=-2)
    return stacked


def _like(xp: Any, value: Any, other: Any) -> Any:
    return xp.broadcast_to(value, np.broadcast_shapes(value.shape, other.shape))


def _moved(xp: Any, wrench: Any, point: Any) -> Any:
    """The wrench with its moment about another point."""
    m = wrench[..., :3] - xp.cross(point, wrench[..., 3:])
    return xp.concatenate([m, _like(xp, wrench[..., 3:], m)], axis=-1)
