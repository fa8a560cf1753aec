"""A robot from URDF against Pinocchio's reading of the same text."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin

import screwkin as sk

CLOSE = 1e-9


def model_of(text: str, floating: bool) -> pin.Model:
    """Pinocchio's model, coupled joints as such; of a free root, with a floating base."""
    bare = re.sub(r"<\?xml[^<>]*\?>", "", text).strip("\ufeff\0 \t\r\n")
    return pin.buildModelFromXML(bare, *([pin.JointModelFreeFlyer()] if floating else []), mimic=True)


def configuration(model: pin.Model, positions: dict[str, float]) -> np.ndarray:
    q = pin.neutral(model)
    for name, value in positions.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    return np.array(q)


def plain(name: str) -> str:
    """A name as a table writes it."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", name)
    if name == "floor":  # what robots stand on
        return "floor_"
    return name if name[:1].isalpha() or name[:1] == "_" else f"_{name}"


def assert_agrees(robot: sk.Robot, model: pin.Model, rng: np.random.Generator) -> None:
    """Poses of links, Jacobian, centre of mass, mass matrix and efforts, at random positions and rates."""
    floating, n = robot.base == "floating", len(robot.joints)
    assert model.nv == n + 6 * floating
    data = model.createData()
    q, qd, qdd = rng.uniform(-1, 1, (3, n))
    named = {plain(name): name for name in (*model.names, *(frame.name for frame in model.frames))}
    joints = [named[name] for name in robot.joint_names]
    wanted = configuration(model, dict(zip(joints, q, strict=True)))
    at = [model.joints[model.getJointId(name)].idx_v for name in joints]
    v, a = np.zeros((2, model.nv))
    v[at], a[at] = qd, qdd
    state = sk.State(np.eye(4), q)
    pin.framesForwardKinematics(model, data, wanted)
    pin.computeJointJacobians(model, data, wanted)
    frames = [model.getFrameId(named[link], pin.FrameType.BODY) for link in robot.link_names]
    theirs = [data.oMf[frame].homogeneous for frame in frames]
    _close(sk.link_poses(robot, state), theirs)
    if floating and robot.mass:
        _close(sk.center_of_mass(robot, state), pin.centerOfMass(model, data, wanted))
    if not n:
        return
    last = robot.joints[-1].child
    frame = model.getFrameId(named[last], pin.FrameType.BODY)
    J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)
    _close(sk.jacobian(robot, state, last)[:, -n:], np.vstack([J[3:], J[:3]])[:, at])
    M = np.triu(pin.crba(model, data, wanted))
    M = M + np.triu(M, 1).T
    order = [3, 4, 5, 0, 1, 2, *at] if floating else at
    _close(sk.mass_matrix(robot, state)[-len(order) :, -len(order) :], M[np.ix_(order, order)])
    _close(sk.inverse_dynamics(robot, state, qd, qdd)[-n:], pin.rnea(model, data, wanted, v, a)[at])


def _close(ours: np.ndarray, theirs: object) -> None:
    """Equal to rounding of the greatest number, for public models have masses of grams and of tonnes."""
    theirs = np.asarray(theirs)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=CLOSE * max(1.0, np.abs(theirs).max(initial=0)))
