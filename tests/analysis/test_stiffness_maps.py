"""Deflection maps: each point is the statics of that posture, and the whole shows what the paper saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.map_arrays import deflection_arrays
from screwkin.analysis.stiffness_maps import other_leg, stiffness_maps
from screwkin.analysis.workspace import workspace
from screwkin.compliance.stiffness import static_deflection
from screwkin.errors import InputError, UnknownNameError
from screwkin.model.robot import Robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("poppy12")


@pytest.fixture(scope="module")
def places(robot):
    return workspace(robot, "left_leg", [0.35, 0.4], 0.01)


@pytest.fixture(scope="module")
def maps(robot, places):
    return stiffness_maps(robot, places)


def test_every_point_is_the_static_deflection_of_its_posture(robot, places, maps):
    left = [robot.joint_names.index(name) for name in places[1].joint_names]
    home = sk.home(robot).q
    nonlinear = stiffness_maps(robot, places[1:], 40.0, "nonlinear", posture="home")[0]
    for i, j in np.argwhere(places[1].reachable)[::60]:
        for one, stance, k, method in (
            (maps[1], 0 * home, 60.0, "linear"),
            (nonlinear, home, 40.0, "nonlinear"),
        ):
            q = stance.copy()
            q[left] = places[1].q[i, j]
            alone = static_deflection(robot, sk.State(np.eye(4), q), "right_foot", k, method)
            np.testing.assert_allclose(one.change[i, j], alone.of("left_foot"), rtol=0, atol=1e-13)
            np.testing.assert_allclose(one.base_change[i, j], alone.of("base"), rtol=0, atol=1e-13)


def test_values_stand_where_the_foot_can_and_nowhere_else(maps):
    for one in maps:
        assert (np.isfinite(one.magnitude) == one.place.reachable).all()
        assert one.summary()["collapsed"] == 0


def test_the_foot_sinks_everywhere_least_near_the_waist_and_most_at_the_border(maps):
    """What paper B reports of its figures 6 and 13 to 16."""
    for one in maps:
        assert (one.translation[..., 2][one.place.reachable] < 0).all()
        i, j = np.unravel_index(np.nanargmin(one.magnitude), one.magnitude.shape)
        assert np.hypot(one.place.x[i], one.place.y[j]) < 0.075
        i, j = np.unravel_index(np.nanargmax(one.magnitude), one.magnitude.shape)
        around = one.place.reachable[i - 1 : i + 2, j - 1 : j + 2]
        assert not around.all()
        for axis in (0, 1):
            assert np.nanmin(one.translation[..., axis]) < 0 < np.nanmax(one.translation[..., axis])


def test_linear_maps_scale_with_one_over_the_stiffness(robot, places, maps):
    unit = stiffness_maps(robot, places[:1], 1.0)[0]
    np.testing.assert_allclose(unit.change, 60 * maps[0].change, rtol=1e-12, atol=1e-15)
    assert maps[0].summary()["unit_max"] == pytest.approx(unit.summary()["max_mm"], rel=1e-12)
    assert unit.summary()["unit_median"] == unit.summary()["median_mm"]


def test_the_equilibrium_differs_by_a_twentieth_at_the_nominal_stiffness(robot, places, maps):
    full = stiffness_maps(robot, places[:1], method="nonlinear")[0]
    apart = np.nanmax(np.linalg.norm(full.translation - maps[0].translation, axis=-1))
    assert 0.2e-3 < apart < 1e-3
    assert full.summary()["unit_max"] is None


def test_the_other_leg_yields_in_mirrored_directions(robot, maps, places):
    other = stiffness_maps(robot, workspace(robot, "right_leg", [0.4], 0.01))[0]
    assert other.support == "left_foot"
    both = other.place.reachable & places[1].reachable[:, ::-1]
    mirrored = maps[1].translation[:, ::-1] * [1, -1, 1]
    assert both.sum() > 500
    # A point where two branches keep the limits may be taken by the other one on the other side.
    close = np.abs(other.translation[both] - mirrored[both]).max(axis=-1) < 1e-12
    assert close.mean() > 0.99


def test_joints_may_differ(robot, places):
    soft = {"default": 60, "right_hip_roll": 30}
    mixed = stiffness_maps(robot, places[:1], soft)[0]
    assert mixed.common_stiffness is None
    assert mixed.summary()["unit_max"] is None
    assert mixed.summary()["max_mm"] > stiffness_maps(robot, places[:1], 60.0)[0].summary()["max_mm"]


def test_joints_too_soft_to_stand_are_told_as_collapsed(robot, places):
    weak = stiffness_maps(robot, places[1:], 2.0, "nonlinear")[0]
    told = weak.summary()
    assert told["collapsed"] > 0
    assert told["collapsed"] == (places[1].reachable & np.isnan(weak.magnitude)).sum()


def test_arrays_hold_the_maps_on_one_grid(maps):
    arrays = deflection_arrays(maps)
    assert arrays["deflection"].shape == (2, len(arrays["x"]), len(arrays["y"]), 6)
    for k, one in enumerate(maps):
        assert np.isfinite(arrays["deflection"][k, ..., 0]).sum() == one.place.reachable.sum()
        assert np.nansum(arrays["deflection"][k]) == pytest.approx(np.nansum(one.change), rel=1e-12)
    assert arrays["stiffness"].shape == arrays["joint_names"].shape == (12,)
    assert str(arrays["support"]) == "right_foot"


def test_wrong_input_is_told(robot, places):
    with pytest.raises(InputError, match="cannot support the robot and be moved"):
        stiffness_maps(robot, places, support="left_foot")
    with pytest.raises(UnknownNameError, match="third_foot"):
        stiffness_maps(robot, places, support="third_foot")
    with pytest.raises(UnknownNameError, match="dancing"):
        stiffness_maps(robot, places, posture="dancing")
    with pytest.raises(InputError, match="must be a positive number"):
        stiffness_maps(robot, places, -1.0)
    assert other_leg(robot, "left_leg") == "right_foot"
    with pytest.raises(InputError, match="no leg but left_leg"):
        other_leg(replace(robot, limbs=robot.limbs[:1], soles=robot.soles[:1]), "left_leg")
