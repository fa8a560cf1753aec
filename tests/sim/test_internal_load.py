"""What feet press against each other does not count: held against virtual power and a plan's own torques."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import screwkin as sk
from screwkin.gait.feed_forward import walking_torques
from screwkin.sim.internal_load import feet_held, without_internal_load
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.measure import torque_needed, torque_use
from screwkin.sim.run import Run, simulate
from tests.laws.limbs import inside, random_robot


def on_legs(seed: int) -> sk.Robot:
    robot = random_robot(seed)
    return replace(robot, limbs=tuple(replace(limb, kind="leg") for limb in robot.limbs))


def feet_of(robot: sk.Robot) -> list[str]:
    return [limb.tip for limb in robot.limbs if limb.kind == "leg"]


def balancing(robot: sk.Robot, state: sk.State, wrenches: np.ndarray) -> np.ndarray:
    """Torques (M, n) against wrenches (M, 2, 6) about the world origin: no power in any motion of the joints.

    The power is taken by differences of the feet's poses.
    """
    step, n = 1e-6, len(robot.joints)
    torque = np.zeros((len(state.q), n))
    for j in range(n):
        ends = [sk.State(state.T_world_base, state.q + sign * step * np.eye(n)[j]) for sign in (1.0, -1.0)]
        for foot, wrench in zip(feet_of(robot), np.moveaxis(wrenches, 1, 0), strict=True):
            after, before = (sk.frame_pose(robot, end, foot) for end in ends)
            rate = (after - before) / (2 * step)
            at = 0.5 * (after + before)
            spin = rate[:, :3, :3] @ np.swapaxes(at[:, :3, :3], 1, 2)
            omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
            moment = wrench[:, :3] - np.cross(at[:, :3, 3], wrench[:, 3:])
            power = (moment * omega).sum(axis=1) + (wrench[:, 3:] * rate[:, :3, 3]).sum(axis=1)
            torque[:, j] -= power
    return torque


@pytest.mark.parametrize("seed", range(4))
def test_no_load_between_the_feet_of_any_robot_counts(seed: int) -> None:
    robot, rng = on_legs(seed), np.random.default_rng(seed)
    q = inside(robot, 5, seed)
    T = np.tile(np.eye(4), (5, 1, 1))
    T[:, :3, 3] = rng.normal(size=(5, 3))
    state = sk.State(T, q)
    wrenches = rng.normal(size=(5, 2, 6))
    wrenches[:, :, 5] = rng.uniform(5.0, 20.0, (5, 2))
    torque = rng.normal(size=q.shape)
    plain = without_internal_load(robot, state, torque, wrenches)

    pressed = rng.normal(scale=30.0, size=(5, 6))
    pair = np.stack([pressed, -pressed], axis=1)
    loaded = without_internal_load(robot, state, torque + balancing(robot, state, pair), wrenches + pair)
    assert np.abs(balancing(robot, state, pair)).max() > 1.0
    np.testing.assert_allclose(loaded, plain, rtol=0, atol=2e-7)


@cache
def planned(name: str) -> tuple[sk.Robot, sk.Trajectory]:
    robot = sk.load_robot(name)
    return robot, sk.walk(robot, sk.fitting_gait(robot), steps=1)


@pytest.mark.parametrize("name", ["bioloid", "poppy12"])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_standing_it_is_the_torque_of_the_plan_however_the_feet_are_loaded(name: str, share: float) -> None:
    robot, plan = planned(name)
    still = replace(
        plan, **{key: 0.0 * getattr(plan, key) for key in ("qd", "qdd", "base_twist", "base_acceleration")}
    )
    state, rest = sk.State(plan.T_world_base[:1], plan.q[:1]), np.zeros((1, len(robot.joints)))
    whole = sk.ground_wrench(robot, state, rest, rest)
    wrenches = np.stack([share * whole, (1.0 - share) * whole], axis=1)
    free = sk.inverse_dynamics(robot, state, rest, rest)[:, 6:]
    torque = free + balancing(robot, state, wrenches)
    expected = walking_torques(robot, still)[:1]
    measured = without_internal_load(robot, state, torque, wrenches)
    np.testing.assert_allclose(measured, expected, rtol=0, atol=1e-6 * robot.mass)
    assert np.abs(torque - expected).max() > 0.01 * np.abs(expected).max()


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("bioloid")


@pytest.fixture(scope="module")
def walk(robot: sk.Robot) -> sk.Trajectory:
    return sk.walk(robot, sk.load_gait("walk"), steps=2)


@pytest.fixture(scope="module")
def pressed(robot: sk.Robot, walk: sk.Trajectory) -> Run:
    """Servos at their limit through double support alone: the feet press against each other by 30 N."""
    run = simulate(robot, walk, KinematicBackend(robot, dt=0.005))
    assert run.servo == "rigid"
    state = sk.State(run.T_world_base, run.q)
    place = [sk.frame_pose(robot, state, foot)[:, :3, 3] for foot in feet_of(robot)]
    both = np.interp(run.time, walk.time, walk.contact.all(axis=1)) > 0.999
    weight = np.tile([0.0, 0.0, 0.5 * 9.81 * robot.mass], (len(run.time), 1))
    aside = np.tile([0.0, 30.0, 0.0], (len(run.time), 1)) * both[:, None]
    wrenches = np.stack(
        [
            np.concatenate([np.cross(p, f), f], axis=1)
            for p, f in zip(place, (weight - aside, weight + aside), strict=True)
        ],
        axis=1,
    )
    torque = balancing(robot, state, wrenches)
    wrenches[~both, 1] = 0.0
    torque[~both] *= 0.1
    return replace(run, ankle_wrench=wrenches, torque=torque)


def test_rigid_servos_are_asked_for_what_the_load_needs(
    robot: sk.Robot, walk: sk.Trajectory, pressed: Run
) -> None:
    used, needed = torque_use(pressed, robot), torque_needed(pressed, robot, walk)
    roll = robot.joint_names.index("right_hip_roll")
    assert used[roll] > 1.5
    assert needed[roll] < 0.6 * used[roll]
    assert (needed <= used + 1e-12).all()


def test_what_a_real_servo_holds_counts(robot: sk.Robot, walk: sk.Trajectory, pressed: Run) -> None:
    """Springs and motors have a stiffness, by which what the feet press is what it is."""
    real = replace(pressed, servo="springs")
    assert np.array_equal(torque_needed(real, robot, walk), torque_use(real, robot))


def test_feet_that_commands_press_together_count(robot: sk.Robot, walk: sk.Trajectory, pressed: Run) -> None:
    """Commands that spread the feet on the floor by .3 mm load any servo."""
    assert feet_held(robot, walk)[walk.contact.all(axis=1)].all()
    assert not feet_held(robot, walk)[~walk.contact.all(axis=1)].any()
    roll, q = robot.joint_names.index("right_hip_roll"), np.array(walk.q)
    q[:, roll] += 0.002 * np.sin(40.0 * walk.time)
    spread = replace(walk, q=q)
    assert not feet_held(robot, spread).any()
    assert np.array_equal(torque_needed(pressed, robot, spread), torque_use(pressed, robot))
