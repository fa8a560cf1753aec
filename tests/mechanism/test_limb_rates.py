"""Reciprocal screws and orthogonal columns against LAPACK, for limbs of any geometry."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.linear import cramer, orthogonal
from screwkin.algebra.quartic import circle_points, cube_root
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Twist, Vector, as_array, vector_from_array
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.limb_rates import pose_rates, split_of
from tests.kinematics.machines import point, unit


def twist(rng):
    return Twist(vector_from_array(rng.normal(size=3)), vector_from_array(rng.normal(size=3)))


def test_the_bundled_legs_have_their_splits():
    for limb, kind, first in (
        ("bioloid", "meeting", 0),
        ("poppy12", "parallel", 2),
        ("bioloid24", "meeting", 0),
    ):
        split = split_of(SerialChain.of(sk.load_robot(limb), "left_leg"))
        assert (split.kind, split.first) == (kind, first)
    assert split_of(SerialChain.of(sk.load_robot("bioloid"), "left_arm")) is None


@pytest.mark.parametrize("seed", range(8))
def test_any_six_screws_are_solved_as_by_lapack(seed):
    rng = np.random.default_rng(seed)
    twists, wanted, length = [Screw(unit(rng), point(rng)).twist for _ in range(6)], twist(rng), 0.4
    scale = np.r_[1, 1, 1, np.full(3, 1 / length)]
    A = np.array([as_array(t) * scale for t in twists]).T
    rates, volume = pose_rates(twists, None, wanted, length)
    expected = np.linalg.solve(A, as_array(wanted) * scale)
    np.testing.assert_allclose(rates, expected, rtol=1e-13 * np.linalg.cond(A), atol=1e-13)
    assert abs(volume) == pytest.approx(abs(np.linalg.det(A)), rel=1e-10)


def test_of_too_many_rows_the_least_squares_are_found():
    rng = np.random.default_rng(0)
    A, b = rng.normal(size=(6, 4)), rng.normal(size=6)
    found, _ = orthogonal(A.T.tolist(), b.tolist())
    np.testing.assert_allclose(found, np.linalg.lstsq(A, b)[0], atol=1e-13)


@pytest.mark.parametrize("name", ["bioloid", "poppy12", "bioloid24"])
@pytest.mark.parametrize("seed", range(4))
def test_splits_give_the_determinant_and_rates_of_the_whole_matrix(name, seed):
    """Also where the split's point is told from anywhere on its axes and axes are turned as a whole."""
    rng = np.random.default_rng(seed)
    robot = sk.load_robot(name)
    for limb in robot.limbs:
        chain = SerialChain.of(robot, limb.name)
        if len(chain.joints) != 6:
            continue
        state = sk.State(np.eye(4), sk.home(robot).q + rng.uniform(-0.3, 0.3, len(robot.joints)))
        J = sk.jacobian(robot, state, limb.tip, point=np.zeros(3))[:, 6:][:, list(chain.joints)]
        split = split_of(chain)
        carried = dict(zip(robot.link_names, sk.link_poses(robot, state), strict=True))
        link = robot.joints[chain.joints[split.first]].parent
        frame = robot.link(link).frame
        home = np.array(as_array(frame))
        place = carried[link] @ np.linalg.inv(home) @ np.r_[as_array(split.point), 1.0]
        J[3:] += np.cross(J[:3], place[:3], axis=0)
        twists = [Twist(Vector(*map(float, c[:3])), Vector(*map(float, c[3:]))) for c in J.T]
        wanted = twist(rng)
        rates, volume = pose_rates(twists, split, wanted, chain.length)
        np.testing.assert_allclose(J @ np.array(rates, dtype=float), as_array(wanted), atol=1e-11)
        scaled = J / np.r_[1, 1, 1, np.full(3, chain.length)][:, None]
        assert abs(volume) == pytest.approx(abs(np.linalg.det(scaled)), rel=1e-9)


def test_cramer_s_rule_combines_three_vectors():
    rng = np.random.default_rng(3)
    columns, wanted = rng.normal(size=(3, 3)), rng.normal(size=3)
    found, volume = cramer([vector_from_array(c) for c in columns], vector_from_array(wanted))
    np.testing.assert_allclose(columns.T @ found, wanted, atol=1e-13)
    assert volume == pytest.approx(np.linalg.det(columns.T))


@pytest.mark.parametrize("real", [4, 2])
def test_roots_on_the_circle_are_found_by_formula_where_they_are_apart(real):
    """Quartics made from their roots' half-angle tangents, real ones and pairs of complex ones."""
    rng = np.random.default_rng(real)
    for _ in range(300):
        t = np.sort(np.tan(rng.uniform(-1.4, 1.4, real)))
        if np.diff(t).min() < 1e-2:
            continue
        pair = [complex(rng.normal(), rng.uniform(0.1, 1))] if real == 2 else []
        roots = [*t, *pair, *np.conj(pair)]
        a4, a3, a2, a1, a0 = np.real(np.poly(roots))
        # (1 + t^2)^2 times the circle's function, by the tangent's powers
        c2 = (a0 + a4 - a2) / 8
        known = [(a0 + a4) / 2 - c2, (a0 - a4) / 2, (a1 + a3) / 4, c2, (a1 - a3) / 8]
        points = circle_points(known)
        found = np.array([np.arctan2(p.s, p.c) for p in points if p.slack > 1e-9])
        assert len(found) == real
        np.testing.assert_allclose(np.sort(np.tan(found / 2)), t, rtol=1e-9, atol=1e-9)


def test_cube_roots_over_sixty_orders_of_magnitude():
    x = 10.0 ** np.linspace(-30, 30, 400)
    np.testing.assert_allclose(cube_root(x), np.cbrt(x), rtol=1e-12)
