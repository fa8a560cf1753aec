"""Couplings of a tip's chain that follow where a limb has fewer than six joints."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.mechanism.followers import followers, tip_chain
from screwkin.model.table import parse_robot
from tests.bodies import LEG, humanoid

LEGS = {
    "no yaw": (LEG[1:], ("rz",)),
    "no ankle roll": (LEG[:-1], ("rx",)),
    "neither": (LEG[1:-1], ("rx", "rz")),
    "six": (LEG, ()),
}


@pytest.mark.parametrize("name", LEGS)
def test_what_follows_is_what_the_limb_cannot_do(name: str) -> None:
    leg, free = LEGS[name]
    robot = parse_robot(humanoid(leg, arm=()))
    assert [followers(robot, limb.name) for limb in robot.limbs] == [free, free]
    mechanism = sk.closed_mechanism(robot)
    virtual = {name for name in mechanism.secondary if name not in robot.joint_names}
    assert virtual == {f"{limb.tip}.{axis}" for limb in robot.limbs for axis in free}
    assert mechanism.mobility == 6 + 2 * len(leg)


@pytest.mark.parametrize("name", LEGS)
def test_rates_move_the_foot_as_imposed_and_only_the_free_rotations_follow(name: str) -> None:
    leg, free = LEGS[name]
    robot = parse_robot(humanoid(leg, arm=(), ahead=0.03))
    mechanism, home = sk.closed_mechanism(robot), sk.home(robot)
    twist = np.array([0.0, 0.0, 0.0, 0.2, 0.1, -0.05])
    rates = sk.virtual_motion(mechanism, home, twist, dict.fromkeys(robot.tip_names, np.zeros(6)))
    both = dict(zip(mechanism.secondary, sk.secondary_rates(mechanism, home, rates), strict=True))
    qd = np.array([both[joint] for joint in robot.joint_names])
    for tip in robot.tip_names:
        foot = sk.jacobian(robot, home, tip) @ np.r_[twist, qd]
        imposed = [k for k in range(3) if f"r{'xyz'[k]}" not in free]
        np.testing.assert_allclose(foot[[*imposed, 3, 4, 5]], 0.0, atol=1e-12)


def test_an_order_of_the_table_s_own_stays() -> None:
    text = humanoid(LEG[1:], arm=()).replace(
        'tip = "right_foot"', 'tip = "right_foot"\nchain = ["px", "py", "pz", "rz", "rx", "ry"]'
    )
    robot = parse_robot(text)
    assert tip_chain(robot, "right_leg") == ("px", "py", "pz", "rz", "rx", "ry")
    assert followers(robot, "right_leg") == ("ry",)


def test_a_rotation_of_axes_by_less_than_a_degree_changes_no_choice() -> None:
    """Columns that are nearly dependent must not be taken because they are not quite."""
    text = humanoid(LEG[1:], arm=()).replace(
        "s = [1, 0, 0]", "s = [0.9999499988, 0.00799999999, 0.005999999992]"
    )
    robot = parse_robot(text)
    assert followers(robot, "right_leg") == ("rz",)
    assert "right_foot.rz" in sk.closed_mechanism(robot).secondary
