"""Welds in PyBullet: both sides are one body, and its mass is divided so that the solver converges."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.dynamics.loops import loops_of
from screwkin.mechanism.least_values import least_values
from screwkin.sim.backend import Command
from screwkin.sim.loops import with_shared_masses
from screwkin.sim.pybullet import PyBulletBackend
from tests.kinematics.machines import array_of, pose, random_loops
from tests.linked import flat_at_90, gaps


@given(seed=st.integers(0, 2), loops=st.integers(1, 2))
@settings(max_examples=3, derandomize=True)
def test_a_closed_mechanism_is_the_same_however_the_mass_of_its_welds_is_divided(seed, loops):
    robot = random_loops(seed, loops, "floating", False)
    home = sk.home(robot)
    assume(least_values(loops_of(robot), home.T_world_base, home.q).min() > 0.01)
    other = with_shared_masses(robot)
    changed = [a.name for a, b in zip(robot.links, other.links, strict=True) if abs(a.mass - b.mass) > 1e-3]
    assert len(changed) >= 2
    rng = np.random.default_rng(seed)
    state = sk.State(array_of(pose(rng)), home.q)
    qd, qdd = rng.uniform(-1, 1, (2, len(robot.joints)))
    twist, rate = rng.uniform(-1, 1, (2, 6))
    wanted, found = (sk.inverse_dynamics(one, state, qd, qdd, twist, rate) for one in (robot, other))
    np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())


def test_what_the_floor_presses_on_keeps_its_mass_and_so_does_a_link_without_any() -> None:
    """The eyes of the parallel ankles' rods end at the feet; those of the toes at links without mass."""
    for name in ("linkages/parallel-ankles", "linkages/tarsus-legs"):
        robot = sk.load_robot(name)
        shared = with_shared_masses(robot)
        for limb in robot.limbs:
            assert shared.link(limb.link) == robot.link(limb.link)
    assert shared.link("right_toe_eye").mass == 0
    assert shared.link("right_heel_eye").mass == shared.link("right_tarsus").mass > 0


def squat(robot, knee):
    """The state over the feet of home at which both knees are bent so far."""
    home, at = sk.home(robot), robot.joint_names.index("right_knee")
    feet = {tip: sk.frame_pose(robot, home, tip) for tip in ("right_foot", "left_foot")}
    T = np.tile(home.T_world_base, (400, 1, 1))
    T[:, 2, 3] = np.linspace(0.13, home.T_world_base[2, 3], 400)
    found = sk.solve_pose(robot, {"base": T, **feet}, home).state
    k = int(np.argmin(np.abs(found.q[:, at] - knee)))
    return sk.State(T[k], found.q[k])


def test_a_knee_near_its_dead_point_follows_its_motor_in_pybullet() -> None:
    """Six degrees from where the parallelogram lies flat; on an eye without mass the knees sink 9 degrees."""
    robot = flat_at_90()
    state, knee = squat(robot, np.deg2rad(84.0)), robot.joint_names.index("right_knee")
    backend = PyBulletBackend(robot)
    backend.reset(state)
    for _ in range(100):
        backend.step(Command(state.q, np.zeros_like(state.q), state.T_world_base))
    seen = backend.observe()
    backend.close()
    assert abs(seen.q[knee] - state.q[knee]) < 0.01
    assert gaps(robot, seen.q).max() < 5e-5
