"""Limbs, soles, forward, up and home of bodies whose parts have no names worth the name."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from screwkin.algebra.se3 import as_array
from screwkin.anatomy.humanoid import anatomy
from screwkin.anatomy.limbs import AnatomyError
from screwkin.dynamics.support import sole_corners
from screwkin.errors import NoSolutionError
from screwkin.kinematics.body import center_of_mass, frame_pose
from screwkin.kinematics.limits import limits_of, within
from screwkin.model.state import home
from screwkin.model.table import robot_from_text
from screwkin.model.urdf_in import parse_urdf
from tests.anatomy.bodies import AHEAD, ARM, HIP_Y, LEG, QUARTER, SOLE, biped

UP = {
    "as usual": "0 0 0",
    "y up, facing backwards": f"{QUARTER} 0 {2 * QUARTER}",
    "askew": "0.3 0.5 1.0",
}


@cache
def found(rpy="0 0 0", xyz="0 0 0", **about):
    """What is read off a body of ``bodies.biped``, once for all tests."""
    return anatomy(parse_urdf(biped(**about).text(rpy, xyz)).robot)


def size_of_sole(robot, foot="left_foot"):
    return np.ptp(sole_corners(robot, foot), axis=0)[:2]


@pytest.mark.parametrize("rpy", UP.values(), ids=UP)
def test_a_body_is_the_same_however_its_base_frame_lies(rpy):
    robot = found(rpy, "0.1 0.2 0.3").robot
    assert [limb.name for limb in robot.limbs] == ["right_leg", "left_leg", "right_arm", "left_arm"]
    joints = {limb.name: len(robot.path_to(limb.link)) for limb in robot.limbs}
    assert joints == {"right_leg": 6, "left_leg": 6, "right_arm": 3, "left_arm": 3}
    np.testing.assert_allclose(size_of_sole(robot), (0.2, 0.1), atol=1e-6)
    left, right = (as_array(robot.limb(f"{side}_leg").frame) for side in ("left", "right"))
    np.testing.assert_allclose(left[:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(left[:3, 3] - right[:3, 3], (0, 2 * HIP_Y, 0), atol=1e-9)
    ahead = sole_corners(robot, "left_foot").mean(axis=0)
    np.testing.assert_allclose(ahead, (AHEAD, 0.01, 0), atol=1e-6)  # forward is where the soles reach


@pytest.mark.parametrize(("reach", "x"), [(-0.006, 1.0), (-0.02, -1.0)], ids=["hardly", "clearly"])
def test_the_base_frame_faces_ahead_unless_the_soles_clearly_reach_behind_the_ankles(reach, x):
    """3 % of a sole's length is within what designs scatter; x ahead is the convention of robots' files."""
    seen = found(ahead=reach)
    np.testing.assert_allclose(as_array(seen.turn)[0], (x, 0, 0), atol=1e-9)
    assert seen.forward.confidence < 0.8


@pytest.mark.parametrize("rpy", UP.values(), ids=UP)
def test_at_home_soles_are_level_on_one_floor_below_the_com(rpy):
    robot = found(rpy, "0.1 0.2 0.3").robot
    state = home(robot)
    middles = []
    for foot in ("left_foot", "right_foot"):
        T = frame_pose(robot, state, foot)
        np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-8)
        assert abs(T[2, 3]) < 1e-9
        corners = sole_corners(robot, foot) @ T[:3, :3].T + T[:3, 3]
        middles.append(corners.mean(axis=0))
    com = center_of_mass(robot, state)
    np.testing.assert_allclose(com[:2], np.mean(middles, axis=0)[:2], atol=1e-3)
    q = np.array(state.q)
    assert within(q, *limits_of(robot))
    assert abs(q[list(robot.path_to(robot.limb("left_leg").link))][3]) > 0.5  # knees are bent


def test_the_table_of_a_humanoid_reads_back_to_the_same_robot_with_its_reasons():
    robot = found().robot
    again = robot_from_text(robot.text)
    assert again.joint_names == robot.joint_names
    assert again.postures == robot.postures
    assert [as_array(limb.frame).tolist() for limb in again.limbs] == [
        as_array(limb.frame).tolist() for limb in robot.limbs
    ]
    assert "# left_leg: 6 joints" in robot.text
    assert "Confidence" in robot.text


@pytest.mark.parametrize(
    ("leg", "foot", "joints"),
    [(LEG[:5], "flat", 5), (LEG[1:5], "flat", 4), (LEG[1:4], "point", 3), (("hip_roll", *LEG), "flat", 7)],
    ids=["five joints", "four joints", "point feet", "seven joints"],
)
def test_legs_of_any_number_of_joints_are_legs(leg, foot, joints):
    seen = found(leg=leg, arm=(), foot=foot)
    assert [len(seen.robot.path_to(limb.link)) for limb in seen.robot.limbs] == [joints, joints]
    assert seen.soles[0].answer.startswith(foot)
    T = frame_pose(seen.robot, home(seen.robot), "left_foot")
    assert abs(T[2, 3]) < 1e-8
    if foot == "flat":
        np.testing.assert_allclose(T[:3, 2], (0, 0, 1), atol=1e-8)
    else:
        assert seen.soles[0].confidence < 0.6


def test_noise_of_a_mesh_does_not_tilt_a_sole():
    seen = found(tilt=0.009)  # half a degree, on one side
    for limb in seen.robot.limbs[:2]:
        np.testing.assert_array_equal(as_array(limb.frame)[:3, :3], np.eye(3))
    right, left = (sole_corners(seen.robot, foot) for foot in ("right_foot", "left_foot"))
    np.testing.assert_allclose(right[::-1] * (1, -1, 1), left, atol=1e-12)


def test_toes_belong_to_the_sole_and_not_to_the_leg():
    seen = found(toe=True)
    assert [len(seen.robot.path_to(limb.link)) for limb in seen.robot.limbs[:2]] == [6, 6]
    np.testing.assert_allclose(size_of_sole(seen.robot), (0.2, 0.1), atol=1e-6)
    assert "beyond the foot move" in seen.limbs[0].why


def test_waists_necks_and_fingers_are_no_part_of_limbs():
    seen = found(waist="yaw", neck=True, fingers=3)
    ways = {limb.name: len(seen.robot.path_to(limb.link)) for limb in seen.robot.limbs}
    assert ways == {"right_leg": 6, "left_leg": 6, "right_arm": 4, "left_arm": 4}
    assert "between it and the arms" in seen.waist.why


def test_knees_bend_the_way_that_their_limits_allow():
    bird, human = found(bends=(-2.0, -0.2)), found(bends=(0.2, 2.0))
    assert bird.home.answer.endswith("knees bent backwards")
    assert human.home.answer.endswith("knees bent forward")


REFUSED = {
    "a quadruped: four limbs": {"hips": (-0.2, 0.2), "arm": ()},
    "stands on frame, not on two legs": {"leg": ()},
    "no sole can be seen": {"foot": "none"},
    "no left and right": {"leg": (), "arm": (), "neck": True},
    "at least 3 joints": {"leg": LEG[:2], "arm": ()},
}


@pytest.mark.parametrize(("reason", "body"), REFUSED.items(), ids=REFUSED)
def test_what_does_not_stand_on_two_legs_is_refused_with_the_reason(reason, body):
    with pytest.raises(AnatomyError, match=reason):
        found(**body)


def test_a_body_without_feet_hung_between_arms_has_no_legs():
    """Arms that reach lower than the trunk are still arms: the trunk hangs between them."""
    with pytest.raises(AnatomyError, match=r"not on two legs|hangs between"):
        found(leg=(), arm=(*ARM, "wrist_pitch", "wrist_roll"))


@pytest.mark.parametrize("seed", range(12))
def test_a_body_whose_arms_point_up_stands_on_its_legs(seed):
    """Turned over it could stand on its hands, where these lie better below the CoM than the feet."""
    rng = np.random.default_rng(seed)
    about = {
        "arm": (*ARM, "wrist_pitch", "wrist_roll")[: rng.integers(3, 6)],
        "raised": True,
        "hand": rng.uniform(0.02, 0.09),
        "lean": rng.uniform(0.05, 0.2) * rng.choice([-1, 1]),
        "arm_mass": rng.uniform(0.1, 0.5),
        "neck": bool(rng.integers(2)),
        "waist": str(rng.choice(["", "yaw"])),
    }
    turn = Rotation.random(rng=rng).as_euler("xyz") if seed % 2 else (0, 0, rng.uniform(-np.pi, np.pi))
    body = biped(**about)
    robot = anatomy(parse_urdf(body.text(" ".join(map(str, turn)))).robot).robot
    feet = {robot.tree[robot.path_to(limb.link)[0]].child for limb in robot.limbs if limb.kind == "leg"}
    roots = {
        line.split('child link="')[1].split('"')[0] for line in body.joints if 'parent link="part0"' in line
    }
    assert feet <= roots
    assert {len(robot.path_to(limb.link)) for limb in robot.limbs[:2]} == {6}
    np.testing.assert_allclose(size_of_sole(robot), (0.2, 0.1), atol=1e-6)


def test_the_sole_lies_where_the_plate_is():
    robot = found().robot
    assert as_array(robot.limb("left_leg").frame)[2, 3] == pytest.approx(SOLE)


@pytest.mark.parametrize("most", [0.2, 0.4, 0.6])
def test_a_home_is_bent_as_far_as_limits_of_the_hips_let_it(most):
    """Thighs that swing forward by little: no straight leg, on which no gait could begin."""
    parsed = parse_urdf(biped().text()).robot
    names = anatomy(parsed).robot
    hips = {names.joints[names.path_to(limb.link)[2]].name for limb in names.limbs if limb.kind == "leg"}
    limited = tuple(
        replace(joint, lower=-most, upper=most) if joint.name in hips else joint for joint in parsed.joints
    )
    robot = anatomy(replace(parsed, joints=limited)).robot
    q = np.array(robot.posture("home").q, dtype=float)
    low, high = limits_of(robot)
    assert within(q, low, high).all()
    knees = [robot.path_to(limb.link)[3] for limb in robot.limbs if limb.kind == "leg"]
    assert (np.abs(q[knees]) > 0.25).all()
    for foot in ("left_foot", "right_foot"):
        pose = frame_pose(robot, home(robot), foot)
        np.testing.assert_allclose(pose[2, :3], [0, 0, 1], atol=1e-8)
        assert abs(pose[2, 3] - frame_pose(robot, home(robot), "left_foot")[2, 3]) < 1e-8


def test_legs_with_fewer_joints_than_a_step_has_freedoms_are_refused_by_their_number():
    with pytest.raises(NoSolutionError, match=r"legs of 3 joints .* at least 4"):
        anatomy(parse_urdf(biped(leg=("hip_pitch", "hip_roll", "knee_pitch"), tilt=0.2).text()).robot)
