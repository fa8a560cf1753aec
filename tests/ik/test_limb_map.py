"""Workspace points by programs against their fallback: the same causes, positions and condition numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis import workspace as maps
from screwkin.compiler.run import run
from screwkin.ik import reach as reaching
from screwkin.ik.limb import resting
from screwkin.ik.limb_map import limb_map
from screwkin.ik.reach import REACHABLE, reach
from screwkin.kinematics.serial_chain import SerialChain
from tests.compiler.robots import with_leg
from tests.ik.legs import backwards, random_parallel_leg, random_spherical_leg


def points_of(chain, height, resolution):
    """Points (B, 3) that a map tries."""
    x, y, near = maps._grid(chain, height, resolution)
    i, j = np.nonzero(near)
    return np.stack([x[i], y[j], np.full(len(i), -height)], axis=1)


def by_fallback(monkeypatch, *arguments):
    """What is reached by a limb that is taken for one without a closed form's program."""
    with monkeypatch.context() as patch:
        patch.setattr(reaching, "recognised", lambda *_: None)
        return reach(*arguments)


@pytest.fixture
def agree(monkeypatch):
    def check(robot, limb, points, share=0.99):
        """Causes, positions and conditioning by both; at least a share of the samples is certified."""
        chain = SerialChain.of(robot, limb)
        length, guess = maps.normalising_length(chain), resting(robot, chain)
        cause, q, inverse = by_fallback(monkeypatch, robot, limb, points, guess, length)
        mine = reach(robot, limb, points, guess, length)
        np.testing.assert_array_equal(mine.cause, cause)
        np.testing.assert_allclose(mine.q, q, atol=1e-9)
        reached = cause == REACHABLE
        assert np.isnan(mine.inverse_condition[~reached]).all()
        # 1e-12 times the condition number of each value, relative to it.
        np.testing.assert_allclose(mine.inverse_condition[reached], inverse[reached], rtol=0, atol=1e-12)
        out = run(limb_map(robot, chain.limb, tuple(guess.tolist()), length), {"point": points})
        assert (out["certified"][:, 0] > 0).mean() >= share
        assert (out["certified"][reached, 1] > 0).mean() >= share
        return cause

    return check


@pytest.mark.parametrize(("name", "limb"), [("bioloid", "left_leg"), ("poppy12", "right_leg")])
def test_maps_of_bundled_legs_are_those_of_the_fallback(agree, name, limb):
    robot = sk.load_robot(name)
    chain = SerialChain.of(robot, limb)
    heights = maps.default_heights(robot, limb)
    points = np.concatenate([points_of(chain, h, 0.008 if name == "bioloid" else 0.02) for h in heights])
    causes = agree(robot, limb, points)
    assert len(set(causes)) >= (2 if name == "bioloid" else 6)


@pytest.mark.parametrize(
    "leg",
    [random_spherical_leg(1), random_parallel_leg(2), backwards(random_spherical_leg(3), 3)],
    ids=["spherical", "parallel", "backwards"],
)
def test_maps_of_legs_with_any_axes(agree, leg):
    robot = with_leg(leg, 5)
    chain = SerialChain.of(robot, "left_leg")
    rng = np.random.default_rng(0)
    points = float(chain.tip.p.x), float(chain.tip.p.y), float(chain.tip.p.z)
    causes = agree(robot, "left_leg", points + rng.normal(size=(1500, 3)), 0.95)
    assert REACHABLE in causes
    assert len(set(causes)) > 2


def test_mirror_images_straight_legs_and_borders_are_decided_as_the_fallback_does(agree):
    """Without limits and with the middle as guess, knees bend forward or backward equally well."""
    robot = sk.load_robot("bioloid")
    free = replace(
        robot,
        postures=(),
        joints=tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in robot.joints),
    )
    chain = SerialChain.of(free, "left_leg")
    hip, tip = (np.array([float(c) for c in p]) for p in (chain.screws[0].s0, chain.tip.p))
    share, ankle = np.linspace(0.0, 1.0, 30)[:, None], np.array([0.0, 0.0, 0.030779])
    up, forward = share * np.array([0.0, 0.0, 0.05]), share * np.array([0.05, 0.0, 0.0])
    straight = float(np.linalg.norm(tip + ankle - hip))
    ring = np.array([[np.sin(a), 0.0, -np.cos(a)] for a in np.linspace(-0.5, 0.5, 11)])
    border = hip - ankle + straight * ring
    raised = tip + np.array([0.0, 0.0, 0.02])
    points = np.concatenate([tip + up, raised + forward, border, border + 1e-9 * ring, border + 1e-4 * ring])
    agree(free, "left_leg", points, 0.0)
    agree(robot, "left_leg", points, 0.0)
    limited = replace(
        free, joints=tuple(replace(j, lower=-1.0 if "knee" in j.name else j.lower) for j in free.joints)
    )
    agree(limited, "left_leg", np.concatenate([points, points + np.array([0.01, 0.02, 0.06])]), 0.0)


def test_a_level_is_the_same_by_programs_and_without_them(monkeypatch):
    robot = sk.load_robot("poppy12")
    by_program = maps.workspace(robot, "left_leg", [0.375], 0.012)[0]
    monkeypatch.setattr(reaching, "recognised", lambda *_: None)
    other = maps.workspace(robot, "left_leg", [0.375], 0.012)[0]
    np.testing.assert_array_equal(by_program.cause, other.cause)
    np.testing.assert_array_equal(by_program.x, other.x)
    np.testing.assert_allclose(by_program.q, other.q, atol=1e-9)
    np.testing.assert_allclose(by_program.inverse_condition, other.inverse_condition, rtol=1e-11)
