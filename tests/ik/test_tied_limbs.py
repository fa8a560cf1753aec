"""Limbs of which a loop ties joints of the way to one another, as the achilles rod ties heel and knee."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.workspace import workspace
from screwkin.errors import InputError
from screwkin.ik.tied import TiedChain, limb_chain
from screwkin.kinematics.serial_chain import residual
from screwkin.kinematics.status import Status
from screwkin.mechanism.linkages import motor_joints
from screwkin.model.records import CoupledJoint
from screwkin.model.robot import Robot
from tests.linked import gaps

NAME = "linkages/tarsus-legs"


def uneven() -> Robot:
    """The same legs with achilles rods that are no parallelograms, put together with straight legs."""
    text = sk.load_robot(NAME).text.replace('"-thigh - shin + heel_z"', '"-thigh - 0.9*shin + heel_z"')
    head, _, tail = text.partition("# ---- Postures")
    servos = tail[tail.index("# ---- Servos") :]
    straight = '[[posture]]\nname = "home"\nbase_height = "thigh + shin + tarsus + ankle_height"\n\n'
    return sk.robot_from_text(head + straight + servos)


def geared(robot: Robot) -> Robot:
    """Without rods, the heels coupled to the knees: what parallelograms do."""
    following = {
        f"{side}_heel": CoupledJoint(
            **vars(robot.joint(f"{side}_heel")), leader=f"{side}_knee", ratio=-1.0, offset=0.0
        )
        for side in ("right", "left")
    }
    rods = [j for j in robot.joints if any(w in j.name for w in ("achilles", "toe_motor", "plantar"))]
    joints = tuple(j for j in robot.joints if j.name not in following and j not in rods)
    home = dict(zip(robot.joint_names, sk.home(robot).q.tolist(), strict=True))
    posture = replace(robot.posture("home"), q=tuple(home[j.name] for j in joints))
    links = tuple(link for link in robot.links if link.name not in {j.child for j in rods})
    parts = {"links": links, "joints": joints, "postures": (posture,), "closures": (), "servos": {}}
    return replace(robot, **parts, coupled=tuple(following.values()), text="")


def targets(robot: Robot, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    T = np.tile(sk.frame_pose(robot, sk.State(np.eye(4), sk.home(robot).q), "right_foot"), (count, 1, 1))
    T[:, :3, 3] += rng.uniform([-0.03, -0.02, 0.0], [0.03, 0.02, 0.02], (count, 3))
    return T


def test_motors_are_counted_and_the_mobility_is_that_of_six_to_a_leg() -> None:
    robot = sk.load_robot(NAME)
    assert len(robot.joints) == 30
    assert len(motor_joints(robot)) == 18
    assert {"right_knee", "right_toe_motor"} < set(motor_joints(robot))
    assert not {"right_heel", "right_ankle_pitch"} & set(motor_joints(robot))
    assert sk.closed_mechanism(robot).mobility == 24


def test_parallelograms_are_gears_of_minus_one() -> None:
    """Rods by Newton through the loops' Jacobian, gears by a constant ratio: the same leg."""
    robot = sk.load_robot(NAME)
    T, other = targets(robot, 20), geared(robot)
    rods, gears = sk.limb_ik(robot, "right_leg", T), sk.limb_ik(other, "right_leg", T)
    assert (rods.status == Status.CONVERGED).all()
    assert rods.joint_names[:6] == gears.joint_names
    np.testing.assert_allclose(rods.best[:, :6], gears.best, atol=1e-8)
    q = np.tile(sk.home(robot).q, (20, 1))
    q[:, [robot.joint_names.index(name) for name in rods.joint_names]] = rods.best
    np.testing.assert_allclose(sk.frame_pose(robot, sk.State(np.eye(4), q), "right_foot"), T, atol=1e-9)
    np.testing.assert_allclose(gaps(robot, q), 0, atol=1e-9)
    solved = sk.solve_pose(robot, {"base": np.eye(4), "right_foot": T})
    assert solved.ok
    np.testing.assert_allclose(solved.state.q, q, atol=1e-8)


def test_rods_of_any_length_are_followed() -> None:
    """Rates against central differences; poses of random motions are met again."""
    robot = uneven()
    chain = limb_chain(robot, "right_leg")
    assert isinstance(chain, TiedChain)
    rng, h = np.random.default_rng(3), 1e-6
    q = rng.uniform(-0.2, 0.2, (10, 6)) + np.array([0, 0, -0.3, 0.6, 0.3, 0])
    far = targets(robot, 10)
    far[:, :3, 3] = 0
    _, J = residual(chain, q, far[:, :3, 3])
    for k in range(6):
        (a, _), (b, _) = (residual(chain, q + s * h * np.eye(6)[k], far[:, :3, 3]) for s in (1, -1))
        np.testing.assert_allclose(J[..., k], (b - a) / (2 * h), atol=1e-8)
    T = sk.frame_pose(robot, sk.State(np.eye(4), sk.home(robot).q), "right_foot")
    T[2, 3] += 0.01
    legs = sk.limb_ik(robot, "right_leg", T, guess=q[0])
    assert legs.status == Status.CONVERGED
    whole = sk.home(robot).q.copy()
    whole[[robot.joint_names.index(name) for name in legs.joint_names]] = legs.best
    np.testing.assert_allclose(gaps(robot, whole), 0, atol=1e-9)
    np.testing.assert_allclose(sk.frame_pose(robot, sk.State(np.eye(4), whole), "right_foot"), T, atol=1e-9)
    knee, heel = (whole[robot.joint_names.index(f"right_{name}")] for name in ("knee", "heel"))
    assert abs(knee + heel) > 0.01


def test_a_limit_of_the_heel_is_one_of_the_leg() -> None:
    robot = sk.load_robot(NAME)
    T = targets(robot, 20)
    heel = sk.limb_ik(robot, "right_leg", T)
    at = np.abs(heel.best[:, heel.joint_names.index("right_heel")])
    limit = float(np.median(at))
    cut = robot.replace(limits={"right_heel": (-limit, limit)})
    status = sk.limb_ik(cut, "right_leg", T).status
    np.testing.assert_array_equal(status == Status.CONVERGED, at <= limit)
    assert set(status.tolist()) == {Status.CONVERGED, Status.OUT_OF_LIMITS}


def test_maps_and_free_rotations_of_tied_legs_are_refused() -> None:
    robot = sk.load_robot(NAME)
    with pytest.raises(
        InputError, match=r"\(right_achilles_loop\) that tie joints of right_leg to one another"
    ):
        workspace(robot, "right_leg")
    with pytest.raises(InputError, match="loops tie joints of right_leg; give whole poses"):
        sk.limb_ik(robot, "right_leg", targets(robot, 1), free=["rz"])
