"""Loops of an MJCF model as closures: welds as they are, connected points by three passive joints."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import UNTURNED, ZERO, Pose, Vector, as_array, pose_from_array
from screwkin.model.mjcf_springs import turned_joints
from screwkin.model.records import FLOOR, Closure, Inertia, Joint, Link, Posture
from screwkin.model.robot import Robot
from screwkin.model.urdf_xml import plain_name

_CONNECT, _WELD = 0, 1  # mjtEq
_SITE = 6  # mjtObj
_FREE = 0  # mjtJoint
_AXES = (Vector(1, 0, 0), Vector(0, 1, 0), Vector(0, 0, 1))
_OPEN = 1e-6
"""Gap [m, rad] beyond which a keyframe is no posture of the closed mechanism."""


@dataclass(frozen=True)
class _End:
    """A place on a body: the body's number, and its frame there (4, 4)."""

    body: int
    frame: Array


@dataclass(frozen=True)
class _Loop:
    """An equality of two places; ``turns``: only their points coincide."""

    name: str
    ends: tuple[_End, _End]
    turns: bool


def is_loop(model: Any, e: int) -> bool:
    """Whether an equality of a model closes a loop, and does from the start on."""
    return int(model.eq_type[e]) in (_CONNECT, _WELD) and bool(model.eq_active0[e])


def with_loops(
    mujoco: Any,
    model: Any,
    robot: Robot,
    place: Callable[[int], tuple[str, Pose] | None],
    note: Callable[[str, str], None],
) -> Robot:
    """The robot with a closure for every weld and every connection of two points.

    Joints without an actuator are then ``passive``, where the model has actuators. A keyframe that leaves
    a loop open is no posture.

    Args:
        mujoco: the module.
        model: compiled.
        robot: its tree, whose postures are keyframes of the model.
        place: link and zero pose, in base axes, of a body by its number; None of bodies that are left out.
        note: takes a remark and what it is about.
    """
    base: Array = _bodies(mujoco, model)[1][base_body(model, robot)]
    closures, joints, loops = list[Closure](), list[Joint](), list[_Loop]()
    for loop in _loops(model):
        ends = [place(end.body) for end in loop.ends]
        if ends[0] is None or ends[1] is None or ends[0][0] == ends[1][0]:
            note("loops left out, on a body of their own", loop.name)
            continue
        (a, home_a), (b, home_b) = ends[0], ends[1]
        frames = [
            pose_from_array(as_array(home).astype(float) @ end.frame)
            for home, end in zip((home_a, home_b), loop.ends, strict=True)
        ]
        if loop.turns:
            upright = pose_from_array(_turned(base)).R
            frames = [
                Pose(upright if link == FLOOR else UNTURNED, frame.p)
                for link, frame in zip((a, b), frames, strict=True)
            ]
            if a == FLOOR:
                (a, b), frames = (b, a), frames[::-1]
                loop = replace(loop, ends=loop.ends[::-1])
            joints += _ball(loop.name, a, frames[0].p)
            a = joints[-1].child
        loops.append(loop)
        closures.append(Closure(loop.name, a, frames[0], b, frames[1]))
    if not closures:
        return robot
    still = Inertia(0.0, 0.0, 0.0)
    links = [Link(j.child, 0.0, ZERO, still, Pose(UNTURNED, j.screw.s0)) for j in joints]
    return replace(
        robot,
        links=(*robot.links, *links),
        joints=(*_driven(model, robot.joints), *joints),
        closures=tuple(closures),
        postures=tuple(_closed_postures(mujoco, model, robot.postures, loops, base, note)),
    )


def _loops(model: Any) -> Iterator[_Loop]:
    for e in range(model.neq):
        if not is_loop(model, e):
            continue
        turns, data = int(model.eq_type[e]) == _CONNECT, model.eq_data[e]
        ids = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
        if int(model.eq_objtype[e]) == _SITE:
            sites = [
                _End(int(model.site_bodyid[s]), _placed(model.site_pos[s], model.site_quat[s])) for s in ids
            ]
            ends = sites[0], sites[1]
        elif turns:
            ends = _End(ids[0], _placed(data[:3])), _End(ids[1], _placed(data[3:6]))
        else:
            ends = _End(ids[0], _placed(data[3:6], data[6:10])), _End(ids[1], np.eye(4))
        yield _Loop(model.equality(e).name or f"loop_{e}", ends, turns)


def _placed(p: Array, quat_wxyz: Array | None = None) -> Array:
    T = np.eye(4)
    T[:3, 3] = p
    if quat_wxyz is not None:
        from scipy.spatial.transform import Rotation

        T[:3, :3] = Rotation.from_quat(np.roll(quat_wxyz, -1)).as_matrix()
    return T


def _ball(name: str, link: str, point: Vector) -> list[Joint]:
    """Three passive joints through a point, about the base's x, y and z in the zero pose."""
    joints: list[Joint] = []
    for axis, s in zip("xyz", _AXES, strict=True):
        child, inf = f"{name}_{axis}", np.inf
        parent = joints[-1].child if joints else link
        screw = Screw(s, point)
        joints.append(Joint(child, parent, child, "revolute", screw, -inf, inf, inf, inf, passive=True))
    return joints


def _driven(model: Any, joints: Sequence[Joint]) -> list[Joint]:
    """The joints, passive where the model's actuators turn others only."""
    turned = turned_joints(model)
    return [replace(joint, passive=bool(turned) and joint.name not in turned) for joint in joints]


def _bodies(mujoco: Any, model: Any, qpos: Array | None = None) -> tuple[Array, Array]:
    """Places (n, 3) and rotations (n, 3, 3) of all bodies; by default in the zero pose of tables."""
    data = mujoco.MjData(model)
    data.qpos[:] = np.where(_free_places(model), model.qpos0, 0.0) if qpos is None else qpos
    mujoco.mj_kinematics(model, data)
    return data.xpos.copy(), data.xmat.reshape(-1, 3, 3).copy()


def base_body(model: Any, robot: Robot) -> int:
    """The number of the body that a table's base link was made of; 0, the world's, of a fixed base."""
    names = {plain_name(model.body(b).name or f"body_{b}"): b for b in range(1, model.nbody)}
    return names[robot.base_link] if robot.base == "floating" else 0


def _turned(R: Array) -> Array:
    T = np.eye(4)
    T[:3, :3] = R
    return T


def _closed_postures(
    mujoco: Any,
    model: Any,
    postures: Sequence[Posture],
    loops: Sequence[_Loop],
    base: Array,
    note: Callable[[str, str], None],
) -> Iterator[Posture]:
    """Keyframes that close the loops, with the positions of the balls."""
    _, home = _bodies(mujoco, model)
    for posture in postures:
        p, R = _bodies(mujoco, model, model.key(posture.name).qpos)
        q: list[float] = []
        closed = True
        for loop in loops:
            a, b = (p[end.body] + R[end.body] @ end.frame[:3, 3] for end in loop.ends)
            closed &= bool(np.abs(a - b).max() < _OPEN)
            if loop.turns:
                turned = [R[end.body] @ home[end.body].T for end in loop.ends]
                q += _angles(base.T @ turned[0].T @ turned[1] @ base)
            else:
                a, b = (R[end.body] @ end.frame[:3, :3] for end in loop.ends)
                closed &= bool(np.abs(a - b).max() < _OPEN)
        if closed:
            yield replace(posture, q=(*posture.q, *q))
        else:
            note("keyframes that leave loops open, left out", posture.name)


def _free_places(model: Any) -> Array:
    """(nq,) bool: the places of free joints in qpos."""
    free = np.zeros(model.nq, dtype=bool)
    for j in range(model.njnt):
        if model.jnt_type[j] == _FREE:
            free[model.jnt_qposadr[j] : model.jnt_qposadr[j] + 7] = True
    return free


def _angles(R: Array) -> list[float]:
    """Angles a, b, c with R = Rx(a) Ry(b) Rz(c)."""
    b = np.arctan2(R[0, 2], np.hypot(R[0, 0], R[0, 1]))
    return [float(np.arctan2(-R[1, 2], R[2, 2])), float(b), float(np.arctan2(-R[0, 1], R[0, 0]))]
