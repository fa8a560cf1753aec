"""Coupled joints in the engines: constraints that hold their positions to those of their leaders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from screwkin.model.robot import Robot
from screwkin.sim.drive import POSITION_GAIN, UNLIMITED

STIFFEST = 0.9999
"""Largest impedance of a constraint that MuJoCo takes: the share of it that is not regularised away."""
STIFF: Mapping[str, list[float]] = {
    "solref": [2e-3, 1.0],
    "solimp": [STIFFEST, STIFFEST, 1e-3, 0.5, 2.0],
}
"""How stiff MuJoCo's constraints of couplings and loops are: time constant [s] and damping, impedance."""


def couple_in_pybullet(
    p: Any, client: Mapping[str, int], body: int, robot: Robot, joints: Sequence[int]
) -> None:
    """A gear constraint for every coupled joint.

    Args:
        p: the module of the engine.
        client: the arguments that name its client.
        body: index of the robot.
        robot: of numbers.
        joints: the engine's indices of the joints of ``robot.tree``.
    """
    origin = [0.0, 0.0, 0.0]
    for joint, index in zip(robot.coupled, joints[len(robot.joints) :], strict=True):
        leader = joints[robot.joint_names.index(joint.leader)]
        gear = p.createConstraint(
            body, index, body, leader, p.JOINT_GEAR, [0.0, 0.0, 1.0], origin, origin, **client
        )
        p.changeConstraint(
            gear,
            gearRatio=-joint.ratio,
            relativePositionTarget=joint.offset,
            erp=POSITION_GAIN,
            maxForce=UNLIMITED,
            **client,
        )


def couple_in_mujoco(mj: Any, spec: Any, robot: Robot) -> None:
    """An equality constraint for every coupled joint.

    Args:
        mj: the module of the engine.
        spec: of a model that has all joints of the robot.
        robot: of numbers.
    """
    for joint in robot.coupled:
        equality = spec.add_equality(
            name=joint.name,
            type=mj.mjtEq.mjEQ_JOINT,
            objtype=mj.mjtObj.mjOBJ_JOINT,
            name1=joint.name,
            name2=joint.leader,
            **STIFF,
        )
        equality.data[:5] = [joint.offset, joint.ratio, 0.0, 0.0, 0.0]
