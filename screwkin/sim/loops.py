"""Loops in the engines: constraints that hold the two frames of every closure together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, as_array, pose_from_array, vector_from_array
from screwkin.model.inertias import inertia_from_matrix, inertia_matrix, united
from screwkin.model.records import FLOOR, Link
from screwkin.model.robot import Robot
from screwkin.model.urdf import urdf_frames
from screwkin.sim.bodies import SimBody
from screwkin.sim.couplings import STIFF
from screwkin.sim.drive import UNLIMITED

ERP = 0.8
"""Share of a gap that PyBullet removes in one step: its setting of the world, a weld's own is not read."""
SHARED = 0.5
"""Share of a link's mass that the other side of a weld takes."""


def close_in_mujoco(mj: Any, spec: Any, robot: Robot, bodies: Mapping[str, tuple[Any, SimBody]]) -> None:
    """A weld of two sites for every closure.

    Args:
        mj: the module of the engine.
        spec: of a model that has all bodies of the robot.
        robot: of numbers.
        bodies: the engine's body and ours of every link at which a loop closes.
    """
    for closure in robot.closures:
        ends = ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        names = []
        for side, (link, frame) in zip("ab", ends, strict=True):
            element, T = spec.worldbody, as_array(frame).astype(float)
            if link != FLOOR:
                element, body = bodies[link]
                T = body.pose(frame)
            quat = np.zeros(4)
            mj.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).ravel())
            names.append(f"{closure.name} {side}")
            element.add_site(name=names[-1], pos=T[:3, 3], quat=quat)
        spec.add_equality(
            name=closure.name,
            type=mj.mjtEq.mjEQ_WELD,
            objtype=mj.mjtObj.mjOBJ_SITE,
            name1=names[0],
            name2=names[1],
            **STIFF,
        )


def with_shared_masses(robot: Robot) -> Robot:
    """The robot, at every weld a part of the heavier link given to the lighter one: the same when closed.

    A rod ends in an eye of no mass, welded to the link that it moves. Gauss-Seidel's method then converges so
    slowly that a rod near its dead point goes through it. Both sides of a weld are one body, however its mass
    is divided; where each has a fair part, some hundred iterations are enough. A leg's last link keeps all of
    its own: the floor presses on it.

    Args:
        robot: of numbers.
    """
    feet = {limb.link for limb in robot.limbs if limb.kind == "leg"}
    links = {link.name: link for link in robot.links}
    for closure in robot.closures:
        ends = ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        if FLOOR in (closure.link_a, closure.link_b):
            continue
        (light, here), (heavy, there) = sorted(ends, key=lambda end: float(links[end[0]].mass))
        if heavy not in feet and float(links[heavy].mass) > 0:
            across = as_array(here @ there.inverse).astype(float)
            links[light], links[heavy] = _shared(links[light], links[heavy], across)
    return replace(robot, links=tuple(links.values()))


def _shared(light: Link, heavy: Link, T: Array) -> tuple[Link, Link]:
    """Both links, a share of the heavier one's mass in the lighter; T (4, 4) takes points across the weld."""
    (m, c, inertia), (M, C, more) = (
        (float(link.mass), as_array(link.com).astype(float), inertia_matrix(link.inertia))
        for link in (light, heavy)
    )
    R = T[:3, :3]
    given = (SHARED * M, R @ C + T[:3, 3], SHARED * R @ more @ R.T)
    mass, com, total = united([(m, c, inertia), given])
    return (
        replace(light, mass=mass, com=vector_from_array(com), inertia=inertia_from_matrix(total)),
        replace(heavy, mass=M - given[0], inertia=inertia_from_matrix((1 - SHARED) * more)),
    )


def close_in_pybullet(
    p: Any, client: Mapping[str, int], body: int, robot: Robot, links: Sequence[str]
) -> None:
    """A fixed joint for every closure.

    Args:
        p: the module of the engine.
        client: the arguments that name its client.
        body: index of the robot.
        robot: of numbers.
        links: names of the engine's links, the base first.
    """
    if robot.closures:
        p.setPhysicsEngineParameter(erp=ERP, **client)
    frames = urdf_frames(robot)

    def end(link: str, frame: Pose) -> tuple[int, list[float], list[float]]:
        """The engine's index of a link; position and quaternion of a frame from its inertial frame.

        Of the floor: of the frame in the world.
        """
        if link == FLOOR:
            T = as_array(frame).astype(float)
            return -1, T[:3, 3].tolist(), quat_xyzw(T[:3, :3])
        index = links.index(link) - 1
        info = p.getDynamicsInfo(body, index, **client)
        inertial = np.eye(4)
        inertial[:3, :3] = np.reshape(p.getMatrixFromQuaternion(info[4]), (3, 3))
        inertial[:3, 3] = info[3]
        T = as_array(pose_from_array(inertial).inverse @ (frames[link].inverse @ frame)).astype(float)
        return index, T[:3, 3].tolist(), quat_xyzw(T[:3, :3])

    for closure in robot.closures:
        ends = ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        first, second = sorted(ends, key=lambda side: side[0] == FLOOR)  # the engine's world comes second
        (a, place_a, turn_a), (b, place_b, turn_b) = end(*first), end(*second)
        other = -1 if second[0] == FLOOR else body
        weld = p.createConstraint(
            body, a, other, b, p.JOINT_FIXED, [0.0] * 3, place_a, place_b, turn_a, turn_b, **client
        )
        p.changeConstraint(weld, maxForce=UNLIMITED, **client)


def quat_xyzw(R: Array) -> list[float]:
    """Quaternion (4,) of a rotation matrix (3, 3), as PyBullet orders it."""
    from scipy.spatial.transform import Rotation

    quat: list[float] = Rotation.from_matrix(R).as_quat().tolist()
    return quat
