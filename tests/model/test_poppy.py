"""The bundled twelve-joint biped: the paper's numbers, and its DH table beside its screws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from screwkin.algebra.se3 import as_array
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import (
    chain_jacobian,
    link_displacements,
    pose_in_base,
    successive_displacement,
)
from screwkin.model.dh import DHTable, screws_from_dh
from screwkin.model.dh_csv import load_dh
from screwkin.model.library import data_folder, robot_names
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.servo.profiles import load_profile
from tests.model.chains import fk_by_matrices, limb_table, lines

LEG = ("hip_roll", "hip_yaw", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
SIDES = ("left", "right")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("poppy12")


@pytest.fixture(scope="module", params=[0, 1], ids=SIDES)
def leg(request: pytest.FixtureRequest) -> DHTable:
    """A leg of the paper's table, as the file holds it."""
    return load_dh(data_folder("robots") / "dh" / "poppy12.csv")[request.param]


def screws_of(robot: Robot, limb: str) -> list:
    return [robot.joints[i].screw for i in robot.path_to(robot.limb(limb).link)]


def test_joints_limbs_and_tips_have_the_promised_names_and_order(robot):
    assert robot.joint_names == tuple(f"{side}_{joint}" for side in SIDES for joint in LEG)
    assert [(limb.name, limb.kind) for limb in robot.limbs] == [("left_leg", "leg"), ("right_leg", "leg")]
    assert robot.tip_names == ("left_foot", "right_foot")
    assert (robot.base, robot.base_link) == ("floating", "pelvis")
    assert "poppy12" in robot_names()
    assert not any("dh" in name for name in robot_names())


def test_screws_of_the_left_leg_are_those_that_the_paper_table_means(robot):
    axes = [[1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]]
    points = [[0, 19, 0], [0, 71, -47], [0, 71, -47], [0, 48, -228], [0, 48, -406], [0, 48, -406]]
    for screw, s, s0 in zip(screws_of(robot, "left_leg"), axes, points, strict=True):
        np.testing.assert_array_equal(as_array(screw.s), s)
        np.testing.assert_allclose(as_array(screw.s0), np.array(s0) / 1000, atol=1e-15)
    sole = as_array(robot.limb("left_leg").frame)
    np.testing.assert_allclose(sole[:3, 3], [0, 0.048, -0.437], atol=1e-15)
    np.testing.assert_array_equal(sole[:3, :3], np.eye(3))


def test_the_right_leg_is_the_left_one_mirrored(robot):
    for left, right in zip(screws_of(robot, "left_leg"), screws_of(robot, "right_leg"), strict=True):
        np.testing.assert_array_equal(as_array(right.s), as_array(left.s))
        np.testing.assert_array_equal(as_array(right.s0), as_array(left.s0) * [1, -1, 1])


def test_limits_are_table_1_with_the_hip_pitch_turned_and_the_right_leg_mirrored(robot):
    left = [(-25, 45), (-40, 60), (-100, 60), (-6, 112), (-35, 30), (-35, 35)]
    right = [(-45, 25), (-60, 40), (-100, 60), (-6, 112), (-35, 30), (-35, 35)]
    found = [(math.degrees(joint.lower), math.degrees(joint.upper)) for joint in robot.joints]
    np.testing.assert_allclose(found, left + right, atol=1e-12)
    assert {joint.effort for joint in robot.joints} == {load_profile("SR-518").stall_torque}
    assert all(math.isinf(joint.velocity) for joint in robot.joints)
    assert robot.servos["stiffness"] == 60.0


def test_masses_are_table_2(robot):
    masses = {link.name: link.mass for link in robot.links if link.mass}
    assert robot.mass == pytest.approx(1.21, abs=1e-12)
    assert masses.pop("pelvis") == pytest.approx(0.278, abs=1e-12)
    parts = {"thigh": 0.226, "shin": 0.124, "foot_link": 0.116}
    assert masses == {f"{side}_{part}": mass for side in SIDES for part, mass in parts.items()}


def test_feet_have_the_size_of_table_3_and_bear_below_the_ankles_on_a_face_inside_it(robot):
    """The face is as wide as Poppy's own foot, 50 mm; the contact box of the simulation has the same."""
    for side, sole, y in zip(SIDES, robot.soles, (0.048, -0.048), strict=True):
        boxes = robot.link(f"{side}_foot_link").boxes
        sizes = np.array([as_array(box.size) for box in boxes])
        np.testing.assert_allclose(sizes.max(axis=0)[:2], [0.129, 0.063], atol=1e-15)
        corners = np.array([as_array(corner) for corner in sole.corners])
        np.testing.assert_allclose(np.ptp(corners, axis=0), [0.116, 0.050, 0], atol=1e-15)
        np.testing.assert_allclose(corners.mean(axis=0), [0, y, -0.437], atol=1e-15)
        bottoms = np.array([as_array(box.center)[2] - as_array(box.size)[2] / 2 for box in boxes])
        np.testing.assert_allclose(sizes[bottoms.argmin(), :2], [0.116, 0.050], atol=1e-15)


def bent(height: float) -> list[float]:
    """Positions that hold the waist at a height above flat soles below the hips' planes."""
    reach = height - 0.047 - 0.031
    knee = math.acos((reach**2 - 0.181**2 - 0.178**2) / (2 * 0.181 * 0.178))
    hip = math.acos((reach**2 + 0.181**2 - 0.178**2) / (2 * reach * 0.181))
    return [0, 0, -hip, knee, hip - knee, 0] * 2


def test_the_centre_of_mass_lies_where_the_masses_put_it_not_in_the_waist(robot):
    """0.239 m above the sole when the waist is at 0.43 m, the height that the paper calls the CoM's."""
    displacements = link_displacements(robot, bent(0.43))
    assert as_array(pose_in_base(robot, displacements, "left_foot"))[2, 3] == pytest.approx(-0.43, abs=1e-12)
    assert 0.43 + mass_center(robot, displacements).z == pytest.approx(0.239, abs=5e-4)


def test_at_home_knees_are_bent_and_soles_are_flat_on_the_floor(robot):
    home = robot.posture("home")
    assert home.base_height == 0.41
    np.testing.assert_allclose(home.q, bent(0.41), atol=1e-12)
    displacements = link_displacements(robot, home.q)
    for tip, y in zip(robot.tip_names, (0.048, -0.048), strict=True):
        T = as_array(pose_in_base(robot, displacements, tip))
        np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-15)
        np.testing.assert_allclose(T[:3, 3], [0, y, -0.41], atol=1e-15)
    for joint, q in zip(robot.joints, home.q, strict=True):
        assert joint.lower < q < joint.upper
        assert q > math.radians(25) or "knee" not in joint.name


def test_the_papers_table_and_the_screws_agree_at_ten_thousand_postures(robot, leg):
    screws = screws_of(robot, leg.name)
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (10_000, 6))
    moved = as_array(successive_displacement(screws, list(q.T), A_ref_k=robot.limb(leg.name).frame))
    np.testing.assert_allclose(fk_by_matrices(leg, q), moved, rtol=0, atol=1e-12)


def test_the_papers_table_and_the_robot_name_the_same_joints_and_tips(robot, leg):
    limb = robot.limb(leg.name)
    assert leg.tip == limb.tip
    assert leg.joint_names == tuple(robot.joint_names[i] for i in robot.path_to(limb.link))
    back, tip = screws_from_dh(leg)
    np.testing.assert_allclose(lines(back), lines(screws_of(robot, leg.name)), rtol=0, atol=1e-15)
    np.testing.assert_allclose(as_array(tip), as_array(limb.frame), rtol=0, atol=1e-15)


def test_the_screw_jacobian_is_the_derivative_of_the_papers_table(robot, leg):
    rng, step = np.random.default_rng(2), 1e-5
    for q in rng.uniform(-2, 2, (100, 6)):
        columns = as_array(chain_jacobian(screws_of(robot, leg.name), q.tolist()))
        T = fk_by_matrices(leg, q)
        for i, column in enumerate(columns):
            e = step * np.eye(6)[i]
            # Fourth-order central difference: its error h^4/30 and its rounding eps/h both stay below 1e-10.
            near = fk_by_matrices(leg, q + e) - fk_by_matrices(leg, q - e)
            far = fk_by_matrices(leg, q + 2 * e) - fk_by_matrices(leg, q - 2 * e)
            spatial = ((8 * near - far) / (12 * step)) @ np.linalg.inv(T)
            rate = [spatial[2, 1], spatial[0, 2], spatial[1, 0], *spatial[:3, 3]]
            np.testing.assert_allclose(column, rate, rtol=0, atol=1e-9)


def test_the_derived_table_is_the_papers_up_to_where_its_origins_are_free(robot):
    """Along the parallel axes 3 to 5 the origins may slide: the paper slides by 23 mm at the knee."""
    derived = limb_table(robot, "left_leg")
    numbers = np.array([[row.alpha, row.a, row.d, row.offset] for row in derived.rows])
    right = math.pi / 2
    expected = [
        [right, 0.019, 0, 0],
        [right, 0.052, 0.047, right],
        [right, 0, 0, right],
        [0, 0.181, 0, 0],
        [0, 0.178, -0.023, 0],
    ]
    np.testing.assert_allclose(numbers[:5], expected, rtol=0, atol=1e-15)
