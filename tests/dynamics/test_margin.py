"""The margin by a program against shapely and against the readable path."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import screwkin as sk
from screwkin.compiler import native
from screwkin.compiler.run import run
from screwkin.dynamics.margin import margin, support, support_margin_fast
from screwkin.dynamics.support import convex_hull, signed_margin, support_margin
from screwkin.errors import InputError
from screwkin.gait.balance import soles_on_floor
from tests.dynamics.test_support import SOLE, shapely_margin

PATHS = ["python", "numpy", *(["C"] if native.compiler() else [])]


def by_program(zmp, soles, contact, path="numpy"):
    program = support(*soles.shape[1:3])
    return run(program, {"zmp": zmp, "soles": soles, "contact": contact}, path=path)["margin"][:, 0]


def stances(count, seed=0, corners=4):
    """Pairs of soles anywhere, apart, touching and overlapping, and points in and out of what they span."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-0.5, 0.5, (count, 2))
    c, s = np.cos(angle), np.sin(angle)
    outline = np.resize(SOLE, (corners, 2))
    turned = np.einsum("tfij,kj->tfki", np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2), outline)
    placed = turned + rng.uniform(-0.1, 0.1, (count, 2, 1, 2))
    return rng.uniform(-0.15, 0.15, (count, 2)), placed, rng.random((count, 2)) > 0.3


@pytest.mark.parametrize("path", PATHS)
def test_the_margin_is_shapelys_distance_and_that_of_the_readable_path(path):
    zmp, soles, contact = stances(120)
    found = by_program(zmp, soles, contact, path)
    np.testing.assert_allclose(found, support_margin(zmp, soles, contact), rtol=0, atol=1e-15)
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
    found = by_program(zmp, soles, np.ones((300, 2), dtype=bool))
    wanted = signed_margin(zmp, convex_hull(soles[0].reshape(-1, 2)))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-15)


def test_on_the_border_the_margin_is_zero_and_beside_it_the_distance():
    corner, edge = SOLE[0], np.array([0.052, 0.01])
    away = np.array([0.03, -0.04])
    zmp = np.stack([corner, edge, corner + away, edge + np.array([0.02, 0]), [0.0, 0.0], corner - [1e-16, 0]])
    soles = np.broadcast_to(np.stack([SOLE, SOLE + 1.0]), (6, 2, 4, 2))
    found = by_program(zmp, soles, np.tile([True, False], (6, 1)))
    np.testing.assert_allclose(found, [0, 0, -0.05, -0.02, 0.033, 0], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("feet", "corners"), [(1, 3), (1, 4), (2, 3), (2, 6), (3, 4)])
def test_other_numbers_of_feet_and_corners_in_any_order(feet, corners):
    """Random corners: outlines that cross themselves, corners inside."""
    rng = np.random.default_rng(corners)
    soles = rng.uniform(-0.1, 0.1, (40, feet, corners, 2))
    zmp = rng.uniform(-0.12, 0.12, (40, 2))
    contact = np.ones((40, feet), dtype=bool)
    wanted = support_margin(zmp, soles, contact)
    np.testing.assert_allclose(by_program(zmp, soles, contact), wanted, rtol=0, atol=1e-15)


def test_a_polygon_without_area_has_no_inside():
    line = np.array([[0.0, 0.0], [0.1, 0.0], [0.05, 0.0]])
    zmp = np.array([[0.02, 0.03], [0.13, 0.04], [0.07, 0.0]])
    found = by_program(zmp, np.broadcast_to(line, (3, 1, 3, 2)), np.ones((3, 1), dtype=bool))
    np.testing.assert_allclose(found, [-0.03, -0.05, 0.0], rtol=0, atol=1e-16)


def test_many_polygons_are_computed_by_the_program_and_few_by_sorting(monkeypatch):
    """Also points that are no numbers, and soles whose outlines were filled up with equal corners."""
    count = 1000 + 50
    zmp, soles, contact = stances(count, corners=5)
    contact[:, 0] = True
    zmp[7] = np.nan
    wanted = support_margin(zmp, soles, contact)
    np.testing.assert_allclose(support_margin_fast(zmp, soles, contact), wanted, rtol=0, atol=1e-14)
    still = np.broadcast_to(soles[:1], soles.shape)
    contact[:] = True
    wanted = support_margin(zmp, still, contact)
    monkeypatch.setattr("screwkin.dynamics.margin.run", None)  # not to be called
    np.testing.assert_array_equal(support_margin_fast(zmp, still, contact), wanted)


@pytest.mark.parametrize(("name", "gait"), [("bioloid", "walk"), ("poppy12", "poppy12-preview")])
def test_a_robots_program_puts_its_soles_where_its_feet_are(name, gait):
    robot = sk.load_robot(name)
    walked = sk.walk(robot, sk.load_gait(gait), 2)
    program = margin(robot)
    tips = [g.name.removeprefix("T_world_") for g in program.inputs if g.name.startswith("T_world_")]
    contact = np.stack([walked.contact[:, walked.feet.index(tip)] for tip in tips], axis=1)
    told = {"zmp": walked.zmp, "contact": contact}
    told |= {f"T_world_{tip}": walked.T_world_tip[tip] for tip in tips}
    found = run(program, told)["margin"][:, 0]
    soles = soles_on_floor(robot, tuple(tips), walked.T_world_tip)
    wanted = support_margin(walked.zmp, soles, contact)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found, walked.margin, rtol=0, atol=1e-9)


def test_a_robot_without_soles_is_told_so():
    with pytest.raises(InputError, match="has no"):
        margin(sk.load_robot("linkages/four-bar"))
