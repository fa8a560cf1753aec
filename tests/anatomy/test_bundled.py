"""The bundled robots stripped of limbs, soles and postures, and described otherwise: the same anatomy."""

from dataclasses import replace

import numpy as np
import pytest

from screwkin.algebra.se3 import as_array
from screwkin.anatomy.humanoid import anatomy
from screwkin.dynamics.support import convex_hull, sole_corners
from screwkin.kinematics.body import frame_pose
from screwkin.model.library import robot_names
from screwkin.model.state import home
from screwkin.model.table import load_robot
from tests.laws.descriptions import mirrored, reordered, slid

NAMES = [name for name in robot_names() if load_robot(name).limbs and not load_robot(name).closures]
"""Trees: a model whose loops are known has a table, in which its limbs stand."""
TIP, AREA = 1e-9, 0.05
"""How far a foot's frame may be from the table's [m], and its area [share]."""


def stripped(robot):
    return replace(robot, limbs=(), soles=(), postures=(), waist=None, text="")


def area(corners):
    hull = convex_hull(corners)
    x, y = hull.T
    return 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.fixture(scope="module", params=NAMES)
def pair(request):
    """A bundled robot, and what is read off it without its limbs."""
    robot = load_robot(request.param)
    return robot, anatomy(stripped(robot))


def test_a_robot_without_limbs_gives_them_back(pair):
    robot, seen = pair
    assert {limb.name: limb.link for limb in seen.robot.limbs} == {
        limb.name: limb.link for limb in robot.limbs
    }
    for limb in robot.limbs:
        if limb.kind == "leg":
            np.testing.assert_allclose(
                as_array(seen.robot.limb(limb.name).frame), as_array(limb.frame), atol=TIP
            )


def test_a_robot_without_soles_gives_them_back(pair):
    robot, seen = pair
    for sole in robot.soles:
        mine, theirs = (sole_corners(r, r.limb(sole.limb).tip)[:, :2] for r in (seen.robot, robot))
        assert area(mine) == pytest.approx(area(theirs), rel=AREA)
        np.testing.assert_allclose(mine.mean(axis=0), theirs.mean(axis=0), atol=3e-3)


def test_it_stands_as_high_as_by_its_own_table(pair):
    robot, seen = pair
    heights = [one.posture("home").base_height for one in (seen.robot, robot)]
    assert heights[0] == pytest.approx(heights[1], rel=0.08)


def test_its_image_with_other_rows_and_points_of_axes_has_the_image_of_its_anatomy(pair):
    robot, seen = pair
    image, names = mirrored(stripped(robot))
    rng = np.random.default_rng(4)
    shifts = {name: rng.uniform(-0.3, 0.3) for name in image.joint_names}
    joints, links = rng.permutation(len(image.joints)), rng.permutation(len(image.links))
    other = anatomy(reordered(slid(image, shifts), list(joints), list(links), [])).robot
    assert {limb.name: limb.link for limb in other.limbs} == {  # the image's names are swapped as well
        limb.name: limb.link for limb in seen.robot.limbs
    }
    for limb in other.limbs:
        if limb.kind == "leg":
            np.testing.assert_allclose(
                as_array(limb.frame), as_array(seen.robot.limb(limb.name).frame), atol=1e-6
            )
    a, b = (dict(zip(r.joint_names, r.posture("home").q, strict=True)) for r in (seen.robot, other))
    for name, (there, sign) in names.items():
        assert b[there] == pytest.approx(sign * a[name], abs=1e-5)


def test_home_is_symmetric(pair):
    _, seen = pair
    state = home(seen.robot)
    left, right = (frame_pose(seen.robot, state, foot) for foot in ("left_foot", "right_foot"))
    np.testing.assert_allclose(left[:3, 3] * (1, -1, 1), right[:3, 3], atol=1e-6)
    np.testing.assert_allclose(left[:3, :3], np.eye(3), atol=1e-8)


def test_arms_rest_as_in_the_given_posture_that_stands_lowest():
    robot = load_robot(
        next(name for name in NAMES if any(limb.kind == "arm" for limb in load_robot(name).limbs))
    )
    seen = anatomy(robot).robot
    arms = [i for limb in robot.limbs if limb.kind == "arm" for i in robot.path_to(limb.link)]
    theirs, mine = (np.array(one.posture("home").q)[arms] for one in (robot, seen))
    assert np.abs(theirs).max() > 0.1
    np.testing.assert_allclose(mine, theirs, atol=1e-12)
