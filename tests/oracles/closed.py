"""A robot with loops as Pinocchio's model, joint by joint, with its closures as rigid constraints."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.algebra.se3 import Pose, as_array
from screwkin.model.robot import Inertia, Joint, Link, Robot

pin: Any = __import__("pinocchio")


def depth_first(robot: Robot) -> list[Joint]:
    """Every joint right before all that it carries: Pinocchio takes a subtree for a stretch of indices.

    In any other order its mass matrix, and with it its constraint dynamics, is wrong without a word.
    """
    below = [joint for joint in robot.tree if joint.parent == robot.base_link]
    order = []
    while below:
        order.append(joint := below.pop(0))
        below = [other for other in robot.tree if other.parent == joint.child] + below
    return order


def constrained(robot: Robot) -> tuple[Any, Any, list[int]]:
    """Model, constraints and for every joint its index in the velocity; frames are parallel to the base."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    carrier, origin = {robot.base_link: root}, {robot.base_link: np.zeros(3)}
    for joint in depth_first(robot):
        axis, place = np.array([*joint.screw.s], float), np.array([*joint.screw.s0], float)
        kind = {
            "revolute": lambda a=axis: pin.JointModelRevoluteUnaligned(a),
            "prismatic": lambda a=axis: pin.JointModelPrismaticUnaligned(a),
            "helical": lambda a=axis, h=joint.screw.pitch: pin.JointModelHelicalUnaligned(a, h),
        }[joint.type]()
        at = pin.SE3(np.eye(3), place - origin[joint.parent])
        carrier[joint.child] = model.addJoint(carrier[joint.parent], kind, at, joint.name)
        origin[joint.child] = place
    for link in robot.links:
        model.appendBodyToJoint(carrier[link.name], _inertia(link), pin.SE3(np.eye(3), -origin[link.name]))
    constraints = pin.StdVec_RigidConstraintModel()
    constraints.extend(
        pin.RigidConstraintModel(
            pin.ContactType.CONTACT_6D,
            model,
            carrier[c.link_a],
            _placement(c.frame_a, origin[c.link_a]),
            carrier[c.link_b],
            _placement(c.frame_b, origin[c.link_b]),
            pin.ReferenceFrame.LOCAL,
        )
        for c in robot.closures
    )
    places = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]
    return model, constraints, places


def _inertia(link: Link) -> Any:
    i: Inertia = link.inertia
    tensor = np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]], float)
    return pin.Inertia(float(link.mass), np.array([*link.com], float), tensor)


def _placement(frame: Pose, origin: Any) -> Any:
    T = np.array(as_array(frame), float)
    return pin.SE3(T[:3, :3], T[:3, 3] - origin)
