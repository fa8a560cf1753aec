"""Springs of an MJCF model's joints as those of passive joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from screwkin.model.records import Joint
from screwkin.model.robot import Robot


def turned_joints(model: Any) -> set[str]:
    """Names of the joints that a model's actuators turn."""
    return {
        model.joint(int(model.actuator_trnid[a][0])).name
        for a in range(model.nu)
        if model.actuator_trntype[a] == 0
    }


def with_model_springs(model: Any, robot: Robot, note: Callable[[str, str], None]) -> Robot:
    """The robot whose joints without an actuator have the springs that the model gives them.

    Where a model has no actuators, every joint is taken for one with a motor.

    Args:
        model: compiled.
        robot: its tree.
        note: takes a remark and what it is about: springs beside motors, and of coupled joints.
    """
    turned = turned_joints(model)
    own = {joint.name for joint in robot.joints}
    sprung: dict[str, Joint] = {}
    for j in range(model.njnt):
        name, stiffness = model.joint(j).name, float(model.jnt_stiffness[j])
        if not stiffness or name not in {joint.name for joint in robot.tree}:
            continue
        if name in turned or not turned or name not in own:
            note("springs beside a motor or of a coupled joint, left out", name)
            continue
        rest = float(model.qpos_spring[model.jnt_qposadr[j]])
        damping = float(model.dof_damping[model.jnt_dofadr[j]])
        joint = robot.joints[robot.joint_names.index(name)]
        sprung[name] = replace(joint, passive=True, stiffness=stiffness, rest=rest, damping=damping)
    joints = tuple(sprung.get(joint.name, joint) for joint in robot.joints)
    return replace(robot, joints=joints) if sprung else robot
