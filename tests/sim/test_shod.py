"""Feet stand on all of their soles, whatever boxes their links have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import Vector, as_array
from screwkin.model.records import Box
from screwkin.sim.backend import Command
from screwkin.sim.shod import CUBE, shod


def on_strips(robot: sk.Robot, width: float, raised: float = 0.0) -> sk.Robot:
    """The robot with feet that are strips along the middle of their soles, raised above them."""
    links = {link.name: link for link in robot.links}
    for sole in robot.soles:
        corners = np.array([as_array(c) for c in sole.corners], dtype=float)
        x, y, z = corners.mean(axis=0)
        box = Box(Vector(x, y, z + raised + 0.005), Vector(np.ptp(corners[:, 0]), width, 0.01))
        link = links[robot.limb(sole.limb).link]
        links[link.name] = replace(link, boxes=(box,))
    return replace(robot, links=tuple(links.values()))


def bottoms(robot: sk.Robot, limb: str) -> np.ndarray:
    """Lowest corners (4 boxes, 3) of the boxes of a limb's last link [m]."""
    boxes = robot.link(robot.limb(limb).link).boxes
    signs = np.array([[i, j, -1] for i in (-1, 1) for j in (-1, 1)]) / 2
    return np.vstack([as_array(b.center) + signs * as_array(b.size) for b in boxes]).astype(float)


@given(width=st.floats(0.002, 0.03), raised=st.floats(0.0, 0.02))
def test_every_corner_of_a_sole_is_carried_and_nothing_stands_lower(width, raised):
    robot = sk.load_robot("bioloid")
    standing = shod(on_strips(robot, width, raised))
    for sole in robot.soles:
        places = bottoms(standing, sole.limb)
        for corner in np.array([as_array(c) for c in sole.corners], dtype=float):
            assert np.linalg.norm(places - corner, axis=1).min() < CUBE
            assert places[:, 2].min() >= corner[2] - 1e-12


@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
def test_feet_whose_boxes_carry_their_soles_stay_as_they_are(name):
    robot = sk.load_robot(name)
    assert shod(robot) is robot


def test_in_pybullet_a_robot_with_strips_under_its_feet_stands_on_its_soles():
    pytest.importorskip("pybullet")
    from screwkin.sim.pybullet import PyBulletBackend

    robot = on_strips(sk.load_robot("bioloid"), 0.004)
    home = sk.home(robot)
    backend = PyBulletBackend(robot)
    try:
        backend.reset(home)
        for _ in range(60):
            backend.step(Command(home.q, np.zeros_like(home.q), home.T_world_base))
        places = {limb: [] for limb in ("right_leg", "left_leg")}
        for contact in backend.observe().contacts:
            limb = next(limb.name for limb in robot.limbs if limb.link == contact.link)
            places[limb].append(contact.point)
    finally:
        backend.close()
    for sole in robot.soles:
        wide = np.ptp([float(c.y) for c in sole.corners])
        assert np.ptp(np.array(places[sole.limb])[:, 1]) > 0.9 * wide
