"""Law 3 over forces: points slide along axes, base frames lie elsewhere, rows change order; forces stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import UNTURNED, Pose, Vector
from tests.kinematics.machines import heavy_four_bar
from tests.laws.descriptions import seen_from
from tests.laws.tables import shuffled, slid

AWAY = Pose(UNTURNED, Vector(0.3, -0.2, 0.5))
"""Another base frame."""


def moved(state: sk.State) -> sk.State:
    """The same state by the pose of that base frame."""
    T = np.array(state.T_world_base)
    T[:3, 3] += T[:3, :3] @ np.array([*AWAY.p])
    return sk.State(T, state.q)


@pytest.mark.parametrize("way", ["slid", "seen from elsewhere", "in another order"])
def test_forces_of_contacts_do_not_depend_on_how_the_robot_is_described(way: str) -> None:
    robot, rng = sk.load_robot("bioloid"), np.random.default_rng(5)
    home, n = sk.home(robot), len(robot.joints)
    state, order = sk.State(home.T_world_base, home.q + rng.uniform(-0.2, 0.2, n)), np.arange(n)
    qd, qdd = rng.uniform(-1, 1, (2, n))
    plain = sk.contact_forces(robot, state, qd, qdd)
    if way == "slid":
        other = slid(robot, rng)
    elif way == "seen from elsewhere":
        other, state = seen_from(robot, AWAY), moved(state)
    else:
        other, order = shuffled(robot, rng)
        state = sk.State(state.T_world_base, state.q[order])
    again = sk.contact_forces(other, state, qd[order], qdd[order])
    for tip in plain.tips:
        np.testing.assert_allclose(again[tip], plain[tip], atol=1e-9)
    np.testing.assert_allclose(again.efforts, plain.efforts[order], atol=1e-9)


def test_efforts_in_loops_do_not_depend_on_how_the_mechanism_is_described() -> None:
    robot, rng = heavy_four_bar(), np.random.default_rng(6)
    T = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    state = sk.State(T, sk.home(robot).q)
    qd, qdd = np.array([[2.0, 0, 0, 0], [3.0, 0, 0, 0]])
    plain = sk.inverse_dynamics(robot, state, qd, qdd)[6:]
    assert abs(plain[0]) > 0.05
    back = AWAY.inverse
    closures = [replace(c, frame_a=back @ c.frame_a, frame_b=back @ c.frame_b) for c in robot.closures]
    elsewhere = replace(seen_from(robot, AWAY), closures=tuple(closures))
    for other, at in ((slid(robot, rng), state), (elsewhere, moved(state))):
        np.testing.assert_allclose(sk.inverse_dynamics(other, at, qd, qdd)[6:], plain, atol=1e-10)
