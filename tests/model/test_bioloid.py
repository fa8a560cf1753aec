"""The bundled humanoids: the paper's numbers, the promised names, a home posture that stands on its soles."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

from screwkin.algebra.se3 import as_array, leaves
from screwkin.model.robot import Posture, Robot
from screwkin.model.table import load_robot
from tests.model.tables import displacements, matrix_of

LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "elbow")
WRIST = ("wrist_yaw", "wrist_roll", "wrist_pitch")
UPPER_ARM, FOREARM, THIGH, CALF, ANKLE = 0.06931, 0.05178, 0.0773829, 0.0780929, 0.030779


@pytest.fixture(params=["bioloid", "bioloid24"])
def robot(request: pytest.FixtureRequest) -> Robot:
    return load_robot(request.param)


def at(robot: Robot, posture: Posture) -> dict[str, np.ndarray]:
    return displacements(robot, dict(zip(robot.joint_names, posture.q, strict=True)))


def named(sides: tuple[str, ...], parts: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{side}_{part}" for side in sides for part in parts)


def test_joints_limbs_and_tips_have_the_promised_names_and_order():
    sides = ("right", "left")
    assert load_robot("bioloid").joint_names == named(sides, LEG) + named(sides, ARM)
    assert load_robot("bioloid24").joint_names == named(sides, LEG) + named(sides, ARM + WRIST)
    for name in ("bioloid", "bioloid24"):
        robot = load_robot(name)
        assert [limb.name for limb in robot.limbs] == ["right_leg", "left_leg", "right_arm", "left_arm"]
        assert [limb.kind for limb in robot.limbs] == ["leg", "leg", "arm", "arm"]
        assert robot.tip_names == ("right_foot", "left_foot", "right_hand", "left_hand")
        assert not set(robot.tip_names) & set(robot.link_names)
        assert [sole.limb for sole in robot.soles] == ["right_leg", "left_leg"]
        assert (robot.base, robot.base_link) == ("floating", "torso")


def test_masses_are_the_papers(robot):
    assert robot.mass == pytest.approx(1.7, abs=1e-12)
    masses = {"torso": 0.6748}
    for side in ("right", "left"):
        parts = {
            "upper_arm": 0.06664,
            "forearm": 0.06215,
            "thigh": 0.15586,
            "calf": 0.19589,
            "foot_link": 0.03206,
        }
        masses |= {f"{side}_{part}": mass for part, mass in parts.items()}
    assert {link.name: link.mass for link in robot.links if link.mass} == masses


def test_centres_of_mass_lie_at_mid_length(robot):
    com = {link.name: as_array(link.com) for link in robot.links}
    np.testing.assert_array_equal(com["torso"], [-0.014563, 0, 0.086397])
    for side, sign in (("right", -1), ("left", 1)):
        hip, shoulder = np.array([0, sign * 0.042165, 0]), np.array([0, sign * 0.064646, 0.121451])
        expected = {
            "thigh": hip - [0, 0, THIGH / 2],
            "calf": hip - [0, 0, THIGH + CALF / 2],
            "foot_link": hip - [0, 0, THIGH + CALF + ANKLE / 2],
            "upper_arm": shoulder - [0, 0, UPPER_ARM / 2],
            "forearm": shoulder - [0, 0, UPPER_ARM + FOREARM / 2],
        }
        for part, point in expected.items():
            np.testing.assert_allclose(com[f"{side}_{part}"], point, atol=1e-15)


def test_leg_screws_are_the_papers_in_the_middle_of_the_calf():
    """Printed there about mid-calf: s0z = L1 + L2/2 for the hip, L2/2 for the knee, -L2/2 for the ankle."""
    robot = load_robot("bioloid")
    middle = np.array([0, 0.042165, -(THIGH + CALF / 2)])
    heights = dict(zip(LEG, [0.11642935] * 3 + [0.03904645] + [-0.03904645] * 2, strict=True))
    axes = dict(zip(LEG, ["z", "x", "y", "y", "y", "x"], strict=True))
    for part in LEG:
        screw = robot.joint(f"left_{part}").screw
        np.testing.assert_allclose(as_array(screw.s0) - middle, [0, 0, heights[part]], atol=1e-8)
        np.testing.assert_array_equal(as_array(screw.s), np.eye(3)["xyz".index(axes[part])])


def test_every_massive_link_has_the_inertia_of_a_box(robot):
    for link in robot.links:
        moments = np.linalg.eigvalsh(matrix_of(link.inertia))
        assert (moments > 0).all() == (link.mass > 0)
    torso = robot.link("torso").inertia
    np.testing.assert_allclose(
        [torso.xx, torso.yy, torso.zz],
        [0.6748 / 12 * (b**2 + c**2) for b, c in ((0.10, 0.14), (0.06, 0.14), (0.06, 0.10))],
    )


def test_limits_are_those_of_the_servos(robot):
    for joint in robot.joints:
        assert (joint.lower, joint.upper) == pytest.approx((-math.radians(150), math.radians(150)))
        assert (joint.velocity, joint.effort) == (6.0, 1.5)


@pytest.mark.parametrize("posture", ["home", "zero"])
def test_the_soles_lie_flat_on_the_floor_below_the_hips(robot, posture):
    told = robot.posture(posture)
    D = at(robot, told)
    for sole, sign in zip(robot.soles, (-1, 1), strict=True):
        T = D[robot.limb(sole.limb).link]
        corners = as_array(sole.corners) @ T[:3, :3].T + T[:3, 3] + [0, 0, told.base_height]
        np.testing.assert_allclose(corners[:, 2], 0, atol=1e-12)
        np.testing.assert_allclose(corners.mean(axis=0), [0, sign * 0.042165, 0], atol=1e-12)
        np.testing.assert_allclose(np.ptp(corners, axis=0), [0.104, 0.066, 0], atol=1e-12)


def test_at_home_the_waist_is_at_170_mm_with_bent_knees(robot):
    home = robot.posture("home")
    q = dict(zip(robot.joint_names, home.q, strict=True))
    assert home.base_height == 0.170
    for side in ("right", "left"):
        assert math.degrees(q[f"{side}_knee"]) > 25
        assert q[f"{side}_hip_pitch"] < 0
        assert q[f"{side}_hip_pitch"] + q[f"{side}_knee"] + q[f"{side}_ankle_pitch"] == pytest.approx(
            0, abs=1e-15
        )


def test_at_home_knees_point_forwards_and_elbows_backwards(robot):
    D = at(robot, robot.posture("home"))
    for side in ("right", "left"):
        knee = D[f"{side}_thigh"] @ [*leaves(robot.joint(f"{side}_knee").screw.s0), 1]
        elbow = D[f"{side}_upper_arm"] @ [*leaves(robot.joint(f"{side}_elbow").screw.s0), 1]
        assert knee[0] > 0.02
        assert elbow[0] < -0.02


def test_at_home_the_hands_hang_113_mm_below_the_shoulders(robot):
    D = at(robot, robot.posture("home"))
    for side, sign in (("right", -1), ("left", 1)):
        limb = robot.limb(f"{side}_arm")
        hand = (D[limb.link] @ as_array(limb.frame))[:3, 3]
        np.testing.assert_allclose(hand, [0, sign * 0.064646, 0.121451 - 0.113], atol=1e-12)


def test_tips_are_on_the_sole_and_at_the_end_of_the_forearm_parallel_to_the_base(robot):
    for limb in robot.limbs:
        T = as_array(limb.frame)
        np.testing.assert_array_equal(T[:3, :3], np.eye(3))
        hip_or_shoulder = 0 if limb.kind == "leg" else 0.121451
        length = THIGH + CALF + ANKLE if limb.kind == "leg" else UPPER_ARM + FOREARM
        assert T[2, 3] == pytest.approx(hip_or_shoulder - length, abs=1e-15)


def test_the_wrists_axes_meet_in_the_hand_point():
    robot = load_robot("bioloid24")
    for side in ("right", "left"):
        hand = as_array(robot.limb(f"{side}_arm").frame.p)
        axes = [robot.joint(f"{side}_{part}").screw for part in WRIST]
        for screw, axis in zip(axes, "zxy", strict=True):
            np.testing.assert_array_equal(as_array(screw.s0), hand)
            np.testing.assert_array_equal(as_array(screw.s), np.eye(3)["xyz".index(axis)])


def test_both_tables_agree_wherever_both_speak():
    small, large = load_robot("bioloid"), load_robot("bioloid24")
    for joint in small.joints:
        assert repr(joint) == repr(large.joint(joint.name))
    for link in small.links:
        assert repr(link) == repr(large.link(link.name))
    assert repr(small.soles) == repr(large.soles)
    assert dict(small.parameters) == dict(large.parameters)


def every_number(robot: Robot) -> list[object]:
    records = [
        *((link.mass, *leaves(link.com), *leaves(link.inertia), *leaves(link.frame)) for link in robot.links),
        *([leaf for box in link.boxes for leaf in leaves(box)] for link in robot.links),
        *(leaves(joint.screw) for joint in robot.joints),
        *((joint.lower, joint.upper, joint.velocity, joint.effort) for joint in robot.joints),
        *(leaves(limb.frame) for limb in robot.limbs),
        *([leaf for corner in sole.corners for leaf in leaves(corner)] for sole in robot.soles),
        *((posture.base_height, *posture.q) for posture in robot.postures),
    ]
    return [x for record in records for x in record]


def test_the_symbolic_twin_at_the_parameters_values_is_the_numeric_robot(robot):
    twin = load_robot(robot.path, symbolic=True)
    values = {sympy.Symbol(name, real=True): value for name, value in robot.parameters.items()}
    numeric, symbolic = every_number(robot), every_number(twin)
    assert sum(isinstance(x, sympy.Expr) for x in symbolic) > 100
    at_values = [float(x.subs(values)) if isinstance(x, sympy.Expr) else x for x in symbolic]
    np.testing.assert_allclose(np.array(at_values, float), np.array(numeric, float), rtol=0, atol=1e-15)


def test_the_symbolic_twin_keeps_structure_and_its_parameters_by_name():
    twin = load_robot("bioloid", symbolic=True)
    thigh, calf, hip_y = sympy.symbols("thigh calf hip_y", real=True)
    ankle = twin.joint("left_ankle_roll").screw
    assert leaves(ankle) == [1, 0, 0, 0, hip_y, -thigh - calf, 0]
    assert [type(x) for x in leaves(ankle.s)] == [int, int, int]
    assert twin.parameters["thigh"] == thigh
    waist, ankle_height = sympy.symbols("waist_height ankle_height", real=True)
    assert twin.parameters["hip_to_ankle"] == waist - ankle_height
