"""Workspace maps against an earlier measurement, a disc, another solver, and what opening a limit does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Vector
from screwkin.analysis.map_arrays import workspace_arrays
from screwkin.analysis.workspace import WorkspaceMap, default_heights, workspace
from screwkin.errors import InputError, UnknownNameError
from screwkin.model.robot import Robot

BEFORE = {0.325: 705, 0.350: 753, 0.375: 722, 0.400: 734, 0.430: 191}
"""Height [m] to area [cm^2], measured by other code; the paper prints no areas.

Foot level, ankle 31 mm above the sole, limits of the paper's table 1.
"""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("poppy12")


@pytest.fixture(scope="module")
def maps(robot) -> dict[float, WorkspaceMap]:
    return {place.height: place for place in workspace(robot, "left_leg", list(BEFORE))}


@pytest.fixture(scope="module")
def coarse(robot) -> WorkspaceMap:
    return workspace(robot, "left_leg", [0.35], 0.01)[0]


def opened(robot: Robot, names, lower=-math.inf, upper=math.inf) -> Robot:
    """The robot with other limits on some joints; as they are called, none at all."""
    joints = tuple(
        replace(joint, lower=lower, upper=upper) if joint.name in names else joint for joint in robot.joints
    )
    return replace(robot, joints=joints)


def test_areas_are_those_measured_before_within_two_per_cent(maps):
    for height, area in BEFORE.items():
        assert 1e4 * maps[height].area == pytest.approx(area, rel=0.02)


def test_median_condition_numbers_are_those_measured_before(maps):
    for height, median in {0.325: 9.3, 0.350: 10.6, 0.375: 11.9, 0.430: 33.6}.items():
        assert maps[height].median_condition == pytest.approx(median, rel=0.01)
        inverse = maps[height].inverse_condition
        assert np.isnan(inverse[~maps[height].reachable]).all()
        assert 0 <= np.nanmin(inverse) < np.nanmax(inverse) <= 1


def test_joint_positions_of_the_map_put_the_level_foot_there(robot, maps):
    place = maps[0.35]
    i, j = (axis[::97] for axis in np.nonzero(place.reachable))
    q = np.zeros((len(i), 12))
    left = [robot.joint_names.index(name) for name in place.joint_names]
    q[:, left] = place.q[i, j]
    T = sk.frame_pose(robot, sk.State(np.eye(4), q), "left_foot")
    np.testing.assert_allclose(
        T[:, :3, 3], np.stack([place.x[i], place.y[j], 0 * i - 0.35], axis=1), atol=1e-12
    )
    np.testing.assert_allclose(T[:, :3, :3], np.broadcast_to(np.eye(3), (len(i), 3, 3)), atol=1e-12)
    lower, upper = (np.array([getattr(robot.joints[k], side) for k in left]) for side in ("lower", "upper"))
    assert (q[:, left] >= lower - 1e-9).all()
    assert (q[:, left] <= upper + 1e-9).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_bounded_solver_from_many_starts_reaches_the_same_points(robot, coarse, seed):
    """scipy's trust-region solver keeps the limits and knows no branches; points at an edge are left out."""
    rng = np.random.default_rng(seed)
    left = [robot.joint_names.index(name) for name in coarse.joint_names]
    bounds = [np.array([getattr(robot.joints[k], side) for k in left]) for side in ("lower", "upper")]

    def lack(x, p):
        q = np.zeros(12)
        q[left] = x
        T = sk.frame_pose(robot, sk.State(np.eye(4), q), "left_foot")
        return np.r_[Rotation.from_matrix(T[:3, :3]).as_rotvec(), (T[:3, 3] - p) / 0.359]

    near = np.stack([np.roll(coarse.reachable, s, a) for a in (0, 1) for s in (-1, 0, 1)])
    for wanted in (True, False):
        inner = near.all(axis=0) if wanted else ~near.any(axis=0)
        points = np.argwhere(inner)
        for i, j in points[rng.choice(len(points), 3, replace=False)]:
            p = np.array([coarse.x[i], coarse.y[j], -0.35])
            best = np.inf
            for _ in range(4):
                start = rng.uniform(*bounds)
                best = min(
                    best, float(np.linalg.norm(least_squares(lack, start, bounds=bounds, args=(p,)).fun))
                )
                if best < 1e-7:
                    break
            assert (best < 1e-6) == wanted, p


@pytest.mark.parametrize("height", [0.14, 0.17])
def test_without_limits_a_leg_with_a_spherical_hip_reaches_a_disc(height):
    """The ankle is anywhere within thigh and calf of the hip; nothing else holds it."""
    robot = sk.load_robot("bioloid")
    place = workspace(opened(robot, robot.joint_names), "left_leg", [height], 0.002)[0]
    thigh, calf, sole = 0.0773829, 0.0780929, 0.030779
    disc = math.pi * ((thigh + calf) ** 2 - (height - sole) ** 2)
    assert place.area == pytest.approx(disc, rel=0.01)
    assert place.length == pytest.approx(thigh + calf, abs=1e-12)
    centre = [np.mean(axis[np.nonzero(place.reachable)[k]]) for k, axis in enumerate((place.x, place.y))]
    assert centre == pytest.approx([0, 0.042165], abs=1e-3)
    assert not place.cuts


def test_the_hole_under_the_waist_is_cut_by_the_ankle_not_by_the_knee(robot, coarse):
    """The paper blames the knee; with the knee free the hole stays, with the ankle free it is gone."""
    i, j = np.abs(coarse.x).argmin(), np.abs(coarse.y).argmin()
    assert coarse.causes[coarse.cause[i, j]] == "left_ankle_pitch lower"
    for name, filled in (("left_knee", False), ("left_ankle_pitch", True)):
        free = workspace(opened(robot, [name]), "left_leg", [0.35], 0.01)[0]
        i, j = np.abs(free.x).argmin(), np.abs(free.y).argmin()
        assert free.reachable[i, j] == filled


def test_opening_all_limits_makes_everything_reachable_that_a_limit_cuts(robot, coarse):
    free = workspace(opened(robot, robot.joint_names), "left_leg", [0.35], 0.01)[0]
    assert free.area == pytest.approx(coarse.area + sum(coarse.cuts.values()), rel=1e-12)
    assert list(coarse.cuts.values()) == sorted(coarse.cuts.values(), reverse=True)


def test_the_condition_number_is_that_of_the_jacobian_at_the_sole_with_lengths_over_thigh_and_shin(
    robot, coarse
):
    left = [robot.joint_names.index(name) for name in coarse.joint_names]
    for i, j in np.argwhere(coarse.reachable)[::40]:
        q = np.zeros(12)
        q[left] = coarse.q[i, j]
        J = sk.jacobian(robot, sk.State(np.eye(4), q), "left_foot")[:, [6 + k for k in left]]
        scaled = np.diag([1, 1, 1, *[1 / 0.359] * 3]) @ J
        assert coarse.inverse_condition[i, j] == pytest.approx(1 / np.linalg.cond(scaled), rel=1e-9)


def test_the_other_leg_has_the_mirrored_map(robot, coarse):
    other = workspace(robot, "right_leg", [0.35], 0.01)[0]
    np.testing.assert_allclose(other.y, -coarse.y[::-1], atol=1e-15)
    assert (other.reachable == coarse.reachable[:, ::-1]).mean() > 0.999
    assert other.area == pytest.approx(coarse.area, rel=2e-3)


def test_a_leg_without_closed_form_is_mapped_by_newton(robot):
    """A knee axis askew by a millionth is not parallel to its neighbours, but moves nothing that shows."""
    tilt = Vector(1e-6, math.sqrt(1 - 1e-12), 0)
    joints = tuple(
        replace(j, screw=Screw(tilt, j.screw.s0)) if j.name == "left_knee" else j for j in robot.joints
    )
    straight = workspace(robot, "left_leg", [0.35], 0.02)[0]
    askew = workspace(replace(robot, joints=joints), "left_leg", [0.35], 0.02)[0]
    assert askew.area == pytest.approx(straight.area, rel=0.03)


def test_default_heights_of_the_papers_robot_are_the_papers(robot):
    assert default_heights(robot, "left_leg") == list(BEFORE)
    heights = default_heights(sk.load_robot("bioloid"), "left_leg")
    assert heights == sorted(heights)
    assert 0.12 < heights[0] < heights[-1] < 0.187


def test_arrays_of_several_heights_lie_on_one_grid(maps):
    arrays = workspace_arrays(list(maps.values()))
    step = 0.0025
    for k, place in enumerate(maps.values()):
        assert arrays["height"][k] == place.height
        assert (arrays["cause"][k] == 0).sum() * step**2 == pytest.approx(arrays["area"][k])
        i = round((place.x[5] - arrays["x"][0]) / step)
        j = round((place.y[7] - arrays["y"][0]) / step)
        assert arrays["cause"][k, i, j] == place.cause[5, 7]
        assert np.nanmax(arrays["inverse_condition"][k]) == np.nanmax(place.inverse_condition)
    assert arrays["causes"].dtype.kind == "U"


def test_out_of_reach_is_an_empty_map(robot):
    place = workspace(robot, "left_leg", [0.6], 0.01)[0]
    assert place.area == 0
    assert math.isnan(place.median_condition)
    assert not place.cuts


@pytest.mark.parametrize(
    ("heights", "resolution", "message"),
    [
        ([], 0.01, "make no map"),
        ([math.nan], 0.01, "make no map"),
        ([0.35, 0.35], 0.01, "twice"),
        ([0.35], 0.0, "resolution is 0.0"),
        ([0.35], -1.0, "positive"),
        ([0.35], math.nan, "positive"),
        ([0.35], 1e-5, "2 million points; take"),
    ],
)
def test_grids_that_make_no_sense_are_refused(robot, heights, resolution, message):
    with pytest.raises(InputError, match=message):
        workspace(robot, "left_leg", heights, resolution)


def test_a_loop_that_is_open_at_home_is_refused(robot):
    (closure,) = sk.load_robot("linkages/four-bar").closures
    ends = {"link_a": robot.base_link, "link_b": robot.link_names[-1]}
    closed = replace(robot, closures=(replace(closure, **ends),))
    with pytest.raises(InputError, match=r"closure loop is open by .* give a posture home that closes it"):
        workspace(closed, "left_leg", [0.35], 0.01)


def test_limbs_that_cannot_hold_an_orientation_are_refused(robot):
    with pytest.raises(InputError, match="left_arm has 3 joints; six are needed"):
        workspace(sk.load_robot("bioloid"), "left_arm")
    with pytest.raises(UnknownNameError, match="third_leg"):
        workspace(robot, "third_leg")
    joints = tuple(
        replace(j, screw=Screw(Vector(1, 0, 0), j.screw.s0)) if j.name == "left_hip_yaw" else j
        for j in robot.joints
    )
    lying = replace(
        robot,
        joints=joints,
        limbs=tuple(
            replace(m, frame=replace(m.frame, p=Vector(0.4, 0.05, 0.0))) if m.name == "left_leg" else m
            for m in robot.limbs
        ),
    )
    with pytest.raises(InputError, match="give heights"):
        default_heights(lying, "left_leg")
