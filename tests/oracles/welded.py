"""A robot with loops as MuJoCo's model, written apart from the package's own: frames parallel to the base."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from screwkin.algebra.se3 import as_array
from screwkin.model.robot import Robot


def welded(robot: Robot, R_world_base: Any) -> tuple[Any, Any, Any]:
    """The model, places of all joints among the rates, and those of the advances of helical ones.

    A helical joint is a hinge and a slide on one axis that an equality couples, a closure a weld.

    Args:
        robot: of numbers; its base stands at the world origin.
        R_world_base: (3, 3) of a base that is fixed.
    """
    mj = __import__("mujoco")
    spec = mj.MjSpec()
    spec.compiler.degree = False
    spec.option.jacobian = mj.mjtJacobian.mjJAC_DENSE
    spec.option.gravity = [0, 0, -9.81]
    quat = np.roll(Rotation.from_matrix(R_world_base).as_quat(), 1)
    floats = robot.base == "floating"
    body = spec.worldbody.add_body(name=robot.base_link, quat=[1, 0, 0, 0] if floats else quat)
    if floats:
        body.add_freejoint()
    bodies, origin = {robot.base_link: body}, {robot.base_link: np.zeros(3)}
    for joint in (robot.tree[i] for i in robot.traversal):
        place = np.array([*joint.screw.s0], float)
        body = bodies[joint.parent].add_body(name=joint.child, pos=place - origin[joint.parent])
        slides = {"revolute": [False], "prismatic": [True], "helical": [False, True]}[joint.type]
        for slide in slides:
            kind = mj.mjtJoint.mjJNT_SLIDE if slide else mj.mjtJoint.mjJNT_HINGE
            name = joint.name if slide is slides[0] else f"{joint.name} advance"
            first = slide is slides[0]
            body.add_joint(
                name=name,
                type=kind,
                axis=[float(x) for x in joint.screw.s],
                stiffness=joint.stiffness * first,
                springref=joint.rest * first,
                damping=joint.damping * first,
            )
        if joint.type == "helical":
            tie = spec.add_equality(
                type=mj.mjtEq.mjEQ_JOINT,
                objtype=mj.mjtObj.mjOBJ_JOINT,
                name1=f"{joint.name} advance",
                name2=joint.name,
            )
            tie.data[:5] = [0, float(joint.screw.pitch), 0, 0, 0]
        bodies[joint.child], origin[joint.child] = body, place
    for link in robot.links:
        i, body = link.inertia, bodies[link.name]
        body.explicitinertial, body.mass = True, float(link.mass)
        body.ipos = np.array([*link.com], float) - origin[link.name]
        body.fullinertia = [float(x) for x in (i.xx, i.yy, i.zz, i.xy, i.xz, i.yz)]
    for c in robot.closures:
        names = []
        for side, link, frame in (("a", c.link_a, c.frame_a), ("b", c.link_b, c.frame_b)):
            T = np.array(as_array(frame), float)
            names.append(f"{c.name} {side}")
            bodies[link].add_site(
                name=names[-1],
                pos=T[:3, 3] - origin[link],
                quat=np.roll(Rotation.from_matrix(T[:3, :3]).as_quat(), 1),
            )
        spec.add_equality(
            type=mj.mjtEq.mjEQ_WELD, objtype=mj.mjtObj.mjOBJ_SITE, name1=names[0], name2=names[1]
        )
    model = spec.compile()
    dofs = np.array([model.joint(name).dofadr[0] for name in robot.joint_names])
    helical = [joint.name for joint in robot.joints if joint.type == "helical"]
    advances = np.array([model.joint(f"{name} advance").dofadr[0] for name in helical], dtype=int)
    return model, dofs, advances
