"""The legs of a stabilised walk: their joints are the planner's, and never jump."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import pose_from_array
from screwkin.errors import InputError
from screwkin.ik.closed import closed_form
from screwkin.ik.family import Formulas
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot, robot_text
from screwkin.model.table import robot_from_text
from screwkin.stabiliser import body
from screwkin.stabiliser.body import Leg, body_of

STEP = 0.3
"""Most that a joint turns from one sample to the next [rad]."""


def apart(offset: float, tilt: float = 0.0) -> Robot:
    """A robot whose hip axes miss each other by an offset [m], pitch axes tilted sideways [rad]."""
    table = robot_text(sk.load_robot("bioloid"))
    at = table.index("s0 =", table.index('name = "right_hip_pitch"'))
    robot = robot_from_text(table[:at] + table[at:].replace("[0,", f"[{offset},", 1), name="apart")
    return tilted(robot, tilt)


def tilted(robot: Robot, by: float) -> Robot:
    """Its pitch axes turned about the vertical, alike in both legs."""
    R = np.array([[np.cos(by), -np.sin(by), 0], [np.sin(by), np.cos(by), 0], [0, 0, 1]])
    joints = []
    for joint in robot.joints:
        if "pitch" in joint.name or "knee" in joint.name:
            s = type(joint.screw.s)(*(R @ [joint.screw.s.x, joint.screw.s.y, joint.screw.s.z]).tolist())
            joint = replace(joint, screw=replace(joint.screw, s=s))
        joints.append(joint)
    return replace(robot, joints=tuple(joints), text="")


@pytest.mark.parametrize(("offset", "tilt"), [(0.008, 0.0), (0.008, 1e-5), (1e-4, 1e-5), (0.008, 1e-3)])
def test_joints_of_a_walk_are_the_planners_though_branches_swap_numbers(offset: float, tilt: float) -> None:
    """Hips whose axes do not meet, or nearly: yaws half a turn apart change places among the branches."""
    robot = apart(offset, tilt)
    walked = sk.walk(robot, sk.load_gait("walk").replace(stride=0.1, rate=50), steps=3)
    right, left = walked.feet
    walker = body_of(robot, right, left, 0.8)
    assert all(leg.near for leg in walker.legs)
    base = pose_from_array(walked.T_world_base)
    feet = [pose_from_array(walked.T_world_tip[foot]) for foot in (right, left)]
    rest = [np.zeros(walked.samples)] * len(robot.joints)
    q = np.stack(walker.posture(base @ walker.T_waist_base.inverse, feet, rest), axis=1)
    own = [i for leg in walker.legs for i in leg.joints]
    np.testing.assert_allclose(q[:, own], walked.q[:, own], atol=1e-6)
    assert np.abs(np.diff(q, axis=0)).max() < STEP


def test_a_leg_that_would_jump_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A form without all ways, as one of another family may be, leaves nothing to choose by."""

    def bare(chain: SerialChain) -> object:
        form = closed_form(chain)
        return replace(form, formulas=Formulas(form.formulas.formula, form.formulas.arrays))

    monkeypatch.setattr(body, "closed_form", bare)
    robot = apart(0.008)
    q = list(robot.posture("home").q)
    T_base_tip = pose_in_base(robot, link_displacements(robot, q), "right_foot")
    with pytest.raises(InputError, match="right_leg swaps its branches"):
        Leg.of(SerialChain.of(robot, "right_foot"), T_base_tip, q)
