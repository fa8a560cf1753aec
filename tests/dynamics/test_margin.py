"""The margin against shapely and against sorted hulls; a robot's program against the arrays."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import screwkin as sk
from screwkin.compiler import native
from screwkin.compiler.run import run
from screwkin.dynamics.margin import margin, support_margin
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.dynamics.support import convex_hull
from screwkin.errors import InputError
from tests.dynamics.test_support import SOLE, shapely_margin

PATHS = ["python", "numpy", *(["C"] if native.compiler() else [])]


def by_hulls(zmp, soles, contact):
    """Distance to the edges of the sorted hull, sample by sample."""
    margin = np.full(len(zmp), -np.inf)
    for k in np.flatnonzero(contact.any(axis=1)):
        start = convex_hull(soles[k, contact[k]].reshape(-1, 2))
        edge, offset = np.roll(start, -1, axis=0) - start, zmp[k] - start
        along = np.clip((offset * edge).sum(axis=1) / (edge**2).sum(axis=1), 0.0, 1.0)
        away = np.linalg.norm(offset - along[:, None] * edge, axis=1).min()
        inside = (edge[:, 0] * offset[:, 1] - edge[:, 1] * offset[:, 0] >= 0).all()
        margin[k] = away if inside else -away
    return margin


def stances(count, seed=0, corners=4):
    """Pairs of soles anywhere, apart, touching and overlapping, and points in and out of what they span."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-0.5, 0.5, (count, 2))
    c, s = np.cos(angle), np.sin(angle)
    outline = np.resize(SOLE, (corners, 2))
    turned = np.einsum("tfij,kj->tfki", np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2), outline)
    placed = turned + rng.uniform(-0.1, 0.1, (count, 2, 1, 2))
    return rng.uniform(-0.15, 0.15, (count, 2)), placed, rng.random((count, 2)) > 0.3


def test_the_margin_is_shapelys_distance_and_that_of_sorted_hulls():
    zmp, soles, contact = stances(120)
    found = support_margin(zmp, soles, contact)
    np.testing.assert_allclose(found, by_hulls(zmp, soles, contact), rtol=0, atol=1e-15)
    inside = 0
    for k in np.flatnonzero(contact.any(axis=1)):
        polygon = shapely.MultiPoint(soles[k, contact[k]].reshape(-1, 2)).convex_hull
        assert found[k] == pytest.approx(shapely_margin(polygon, zmp[k]), abs=1e-14)
        inside += found[k] > 0
    assert 10 < inside < 90
    assert (found[~contact.any(axis=1)] == -np.inf).all()
    assert (~contact.any(axis=1)).any()


@pytest.mark.parametrize(
    "offset",
    [(0.0, 0.066), (0.104, 0.066), (0.0, 0.0), (0.05, 0.066), (1e-15, 0.066), (1e-9, 0.0), (0.0, 1e-17)],
)
def test_soles_that_touch_overlap_or_nearly_coincide(offset):
    """Edge on edge, corner on corner, one on the other, a hair beside."""
    rng = np.random.default_rng(1)
    zmp = rng.uniform(-0.12, 0.16, (300, 2))
    soles = np.broadcast_to(np.stack([SOLE, SOLE + np.array(offset)]), (300, 2, 4, 2))
    found = support_margin(zmp, soles, np.ones((300, 2), dtype=bool))
    wanted = by_hulls(zmp, soles, np.ones((300, 2), dtype=bool))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-15)


def test_on_the_border_the_margin_is_zero_and_beside_it_the_distance():
    corner, edge = SOLE[0], np.array([0.052, 0.01])
    away = np.array([0.03, -0.04])
    zmp = np.stack([corner, edge, corner + away, edge + np.array([0.02, 0]), [0.0, 0.0], corner - [1e-16, 0]])
    soles = np.broadcast_to(np.stack([SOLE, SOLE + 1.0]), (6, 2, 4, 2))
    found = support_margin(zmp, soles, np.tile([True, False], (6, 1)))
    np.testing.assert_allclose(found, [0, 0, -0.05, -0.02, 0.033, 0], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("feet", "corners"), [(1, 3), (1, 4), (2, 3), (2, 6), (3, 4), (2, 20), (4, 9)])
def test_other_numbers_of_feet_and_corners_in_any_order(feet, corners):
    """Random corners: outlines that cross themselves, corners inside."""
    rng = np.random.default_rng(corners)
    soles = rng.uniform(-0.1, 0.1, (40, feet, corners, 2))
    zmp = rng.uniform(-0.12, 0.12, (40, 2))
    contact = np.ones((40, feet), dtype=bool)
    wanted = by_hulls(zmp, soles, contact)
    np.testing.assert_allclose(support_margin(zmp, soles, contact), wanted, rtol=0, atol=1e-15)


def test_a_polygon_without_area_has_no_inside():
    line = np.array([[0.0, 0.0], [0.1, 0.0], [0.05, 0.0]])
    zmp = np.array([[0.02, 0.03], [0.13, 0.04], [0.07, 0.0]])
    found = support_margin(zmp, np.broadcast_to(line, (3, 1, 3, 2)), np.ones((3, 1), dtype=bool))
    np.testing.assert_allclose(found, [-0.03, -0.05, 0.0], rtol=0, atol=1e-16)


def test_points_and_segments_have_distances_and_an_absent_zmp_has_none():
    """Soles that are one corner, or two; a ZMP that is not a number is never inside."""
    zmp = np.array([[0.0, 0.05], [0.0, 0.03], [np.nan, 0.0], [np.inf, 0.0], [np.nan, 0.0]])
    soles = np.zeros((5, 1, 2, 2))
    soles[1:, 0, 1, 0] = 0.1
    contact = np.array([[True]] * 4 + [[False]])
    wanted = [-0.05, -0.03, np.nan, np.nan, -np.inf]
    np.testing.assert_allclose(support_margin(zmp, soles, contact), wanted, rtol=0, atol=1e-16)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(("name", "gait"), [("bioloid", "walk"), ("poppy12", "poppy12-preview")])
def test_a_robots_program_puts_its_soles_where_its_feet_are(name, gait, path):
    robot = sk.load_robot(name)
    walked = sk.walk(robot, sk.load_gait(gait), 2)
    program = margin(robot)
    tips = [g.name.removeprefix("T_world_") for g in program.inputs if g.name.startswith("T_world_")]
    contact = np.stack([walked.contact[:, walked.feet.index(tip)] for tip in tips], axis=1)
    told = {"zmp": walked.zmp, "contact": contact}
    told |= {f"T_world_{tip}": walked.T_world_tip[tip] for tip in tips}
    found = run(program, told, path=path)["margin"][:, 0]
    soles = soles_on_floor(robot, tuple(tips), walked.T_world_tip)
    wanted = support_margin(walked.zmp, soles, contact)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found, walked.margin, rtol=0, atol=1e-9)
    told["zmp"] = np.full(2, np.nan)
    assert np.isnan(run(program, told, path=path)["margin"]).all()


def test_a_robot_without_soles_is_told_so():
    with pytest.raises(InputError, match="has no"):
        margin(sk.load_robot("linkages/four-bar"))
