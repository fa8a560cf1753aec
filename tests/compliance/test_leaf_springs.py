"""Legs with leaf springs in shin and tarsus, after Cassie's: links that bend within closed loops."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import screwkin as sk
from screwkin.model.library import find_robot

FEET = ("right_foot", "left_foot")
PUSH = 1e-4 * np.array([4.0, 1.0, -9.0])
"""On the base's origin [N]: so little that its own turning with the base does not count."""
LEAVES = {
    "right_shin": ("-thigh", "-thigh - shin"),
    "right_tarsus": ("-thigh - shin", "-thigh - shin - tarsus"),
}
"""Heights of root and end of the leaf in each link."""


@cache
def sprung(E: float) -> sk.Robot:
    """The biped with flat steel leaves of 20 x 1.5 mm in its legs, of this modulus [Pa]."""
    text = find_robot("linkages/tarsus-legs").read_text(encoding="utf-8")
    for link, (root, end) in LEAVES.items():
        ends = ", ".join(f'{key} = [0, "-hip_y", "{z}"]' for key, z in (("root", root), ("end", end)))
        section = f"E = {E:g}, G = {E / 2.6:g}, A = 3e-5, I = [5.6e-12, 1e-9], J = 2e-11, about = [0, 1, 0]"
        row = f'[[link]]\nname = "{link}"\n'
        assert row in text
        text = text.replace(row, f"{row}spring = {{ {ends}, {section} }}\n")
    return sk.robot_from_text(text)


def pushed(robot: sk.Robot, **options) -> sk.Deflection:
    return sk.static_deflection(
        robot, sk.home(robot), FEET, 20.0, "linear", 0.0, loads={"base": PUSH}, **options
    )


@pytest.mark.slow
def test_the_work_of_a_load_is_stored_in_joints_and_leaves() -> None:
    """Clapeyron's theorem: F d is twice the energy of all springs; the leaves have their share."""
    robot = sprung(2.1e11)
    found = pushed(robot)
    assert {*LEAVES} <= {*found.bending}
    joints = -found.theta @ found.torque
    leaves = sum(
        d @ np.array(robot.link(name).spring.stiffness, float) @ d
        for name, d in zip(found.bending, found.links, strict=True)
    )
    assert leaves > 0.1 * joints
    assert PUSH @ found.of("base")[3:] == pytest.approx(joints + leaves, rel=1e-5)
    np.testing.assert_allclose(found.wrenches[:, 3:].sum(axis=0), -PUSH, atol=1e-12)


@pytest.mark.slow
def test_stiff_leaves_are_rigid_links() -> None:
    rigid = sk.load_robot("linkages/tarsus-legs")
    found, wanted = pushed(sprung(2.1e17)).change, pushed(rigid).change
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())
