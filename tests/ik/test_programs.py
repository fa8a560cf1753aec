"""Closed forms as programs against the algorithm over arrays, hard cases included."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler.program import Recorder
from screwkin.compiler.run import run
from screwkin.errors import ShapeError
from screwkin.ik import programs as limbs
from screwkin.ik.closed import closed_form, solve_closed
from screwkin.ik.limb import resting
from screwkin.ik.solutions import ordered
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.kinematics.status import Status
from tests.compiler.robots import with_leg
from tests.ik.legs import backwards, random_parallel_leg, random_spherical_leg

LEGS = (("bioloid", "left_leg"), ("bioloid", "right_leg"), ("poppy12", "left_leg"), ("poppy12", "right_leg"))


def within_limits(robot, count, seed=0):
    rng = np.random.default_rng(seed)
    low, high = (np.array([getattr(j, k) for j in robot.joints]) for k in ("lower", "upper"))
    return rng.uniform(low, high, (count, len(low)))


def by_arrays(chain, target, guess):
    """Solutions by the algorithm over arrays, which certifies what programs leave open."""
    q, error, valid = solve_closed(closed_form(chain), target, guess, least_squares=False)
    return ordered(chain, "closed", q, valid, error, np.ones(valid.shape), guess, (len(q),))


@pytest.mark.parametrize(("name", "limb"), LEGS)
def test_the_program_has_the_branches_flags_and_order_of_the_array_algorithm(name, limb):
    robot = sk.load_robot(name)
    T = sk.frame_pose(robot, sk.State(np.eye(4), within_limits(robot, 1200)), robot.limb(limb).tip)
    T[:40, 0, 3] += 2.0  # out of reach
    large = sk.limb_ik(robot, limb, T, least_squares=False)
    chain = SerialChain.of(robot, limb)
    guess = np.tile(resting(robot, chain), (1200, 1))
    few = by_arrays(chain, T, guess)
    for field in ("valid", "in_limits"):
        np.testing.assert_array_equal(getattr(large, field), getattr(few, field))
    np.testing.assert_allclose(large.q[40:], few.q[40:], atol=1e-7)
    assert large.residual[40:, 0].max() <= 1e-12
    assert (large.status[:40] == Status.UNREACHABLE).all()


@pytest.mark.parametrize(
    "leg",
    [random_spherical_leg(11), random_parallel_leg(12), backwards(random_spherical_leg(13), 13)],
    ids=["spherical", "parallel", "backwards"],
)
def test_legs_with_any_axes_have_the_solutions_and_flags_of_the_array_algorithm(leg):
    robot = with_leg(leg, 6)
    chain = SerialChain.of(robot, "left_leg")
    q = np.zeros((1100, 12))
    q[:, list(chain.joints)] = np.random.default_rng(3).uniform(-3, 3, (1100, 6))
    T = sk.frame_pose(robot, sk.State(np.eye(4), q), "left_foot")
    T[:100, :3, 3] += np.random.default_rng(4).normal(size=(100, 3))  # within reach or not
    large = sk.limb_ik(robot, "left_leg", T, least_squares=False)
    few = by_arrays(chain, T, np.tile(resting(robot, chain), (1100, 1)))
    for field in ("valid", "in_limits", "status"):
        assert (getattr(large, field) == getattr(few, field)).all(), field
    np.testing.assert_allclose(large.q, few.q, atol=1e-6)
    assert np.nanmax(np.where(large.valid, large.residual, np.nan)) <= 1e-11


@pytest.mark.parametrize("beyond", [-1e-6, 0.0, 1e-10, 1e-8, 1e-6])
def test_a_joint_at_its_limit_is_inside_to_a_billionth(beyond):
    robot = sk.load_robot("bioloid")
    q = np.tile(sk.home(robot).q, (1000, 1))
    joint = robot.joint_names.index("left_hip_roll")
    q[::2, joint] = robot.joints[joint].upper + beyond
    T = sk.frame_pose(robot, sk.State(np.eye(4), q), "left_foot")
    guess = q[:, list(SerialChain.of(robot, "left_leg").joints)]
    found = sk.limb_ik(robot, "left_leg", T, guess=guess, least_squares=False)
    same = np.abs(found.q[::2] - guess[::2, None]).max(axis=-1) < 1e-6
    assert (same.sum(axis=1) == 1).all()
    assert (found.in_limits[::2][same] == (beyond <= 1e-9)).all()


@pytest.mark.parametrize(("name", "limb"), LEGS)
def test_the_nearest_solution_is_the_one_that_was_moved_a_little(name, limb):
    robot = sk.load_robot(name)
    q = within_limits(robot, 3000, 1)
    T = sk.frame_pose(robot, sk.State(np.eye(4), q), robot.limb(limb).tip)
    chain = SerialChain.of(robot, limb)
    own = q[:, list(chain.joints)]
    guess = own + 0.05 * np.random.default_rng(2).uniform(-1, 1, own.shape)
    found = run(limbs.limb_nearest(robot, limb), {"T_base_tip": T, "guess": guess}, path="numpy")
    certified = found["found"][:, 0] == 1
    assert certified.mean() > 0.99
    few = by_arrays(chain, T, guess)
    np.testing.assert_allclose(found["q"][certified], few.best[certified], atol=1e-7)
    assert np.quantile(found["error"][certified], 0.99) < 1e-12


def test_out_of_reach_and_at_the_border_are_told_apart():
    robot = sk.load_robot("bioloid")
    straight = np.zeros((2, 18))
    T = sk.frame_pose(robot, sk.State(np.eye(4), straight), "left_foot")
    T[1, 2, 3] -= 0.01
    found = run(limbs.limb_nearest(robot, "left_leg"), {"T_base_tip": T, "guess": np.full((2, 6), 0.1)})
    assert found["found"][:, 0].tolist() == [-1, 0]
    np.testing.assert_allclose(found["q"][1], 0.1)


@pytest.mark.parametrize(("name", "gait"), [("bioloid", "walk"), ("poppy12", "poppy12-preview")])
def test_whole_bodies_are_posed_by_closed_forms_as_by_newton(name, gait):
    robot = sk.load_robot(name)
    walked = sk.walk(robot, sk.load_gait(gait).replace(rate=300), steps=3)
    targets = {"base": walked.T_world_base}
    for limb in robot.limbs:
        T = walked.T_world_tip[limb.tip]
        targets[limb.tip] = T if limb.kind == "leg" else T[:, :3, 3]
    guess = sk.State(walked.T_world_base, np.array(robot.posture("home").q))
    fast, slow = (sk.solve_pose(robot, targets, guess, method) for method in ("auto", "newton"))
    assert fast.ok
    np.testing.assert_allclose(fast.state.q, slow.state.q, atol=1e-9)
    assert fast.residual.max() < 1e-12
    assert fast.iterations.max() == 1, "no sample was left to Newton"


def test_joints_stay_on_the_turn_of_their_guess():
    robot = sk.load_robot("bioloid")
    wide = tuple(replace(joint, lower=-7.0, upper=7.0) for joint in robot.joints)
    robot = replace(robot, joints=wide)
    q = np.tile(sk.home(robot).q, (1000, 1))
    joint = robot.joint_names.index("right_hip_yaw")
    q[::2, joint] = 3.3
    q[1::4, joint] = -4.0
    states = sk.State(np.tile(np.eye(4), (1000, 1, 1)), q)
    targets = {tip: sk.frame_pose(robot, states, tip) for tip in ("left_foot", "right_foot")}
    found = sk.solve_pose(robot, targets, states)
    assert found.ok
    np.testing.assert_allclose(found.state.q, q, atol=1e-8)
    with pytest.raises(ShapeError, match="do not broadcast"):
        sk.solve_pose(robot, targets, sk.State(states.T_world_base[:999], q[:999]))


def test_unreachable_singular_and_forbidden_samples_have_the_same_status_in_a_large_batch():
    robot = sk.load_robot("bioloid")
    home = sk.home(robot)
    q = np.tile(home.q, (1200, 1))
    q[3, :] = 0.0  # straight knees
    q[5, robot.joint_names.index("left_hip_roll")] = -np.pi / 2 - 1e-3
    states = sk.State(np.tile(home.T_world_base, (1200, 1, 1)), q)
    targets = {tip: sk.frame_pose(robot, states, tip) for tip in ("left_foot", "right_foot")}
    targets["left_foot"][7, 0, 3] += 0.3
    large = sk.solve_pose(robot, targets, sk.State(states.T_world_base, q))
    small = sk.solve_pose(
        robot,
        {k: v[:10] for k, v in targets.items()},
        sk.State(states.T_world_base[:10], q[:10]),
        method="newton",
    )
    np.testing.assert_array_equal(large.status[:10], small.status)
    assert large.status[[3, 7], 0].tolist() == [
        Status.SINGULAR,
        Status.UNREACHABLE,
    ]
    np.testing.assert_allclose(large.distance[7, 0], small.distance[7, 0], rtol=1e-6)


@pytest.mark.parametrize("count", range(1, 9))
def test_branches_are_sorted_whatever_their_order(count):
    """A network that sorts all sequences of 0 and 1 sorts all sequences."""
    recorder = Recorder("sorted", "")
    rows = [[x] for x in recorder.input("x", count)]
    recorder.output("y", [x for (x,) in limbs._sorted(rows)])
    x = np.array(list(product((0.0, 1.0), repeat=count)))
    assert (run(recorder.program(), {"x": x})["y"] == np.sort(x, axis=1)).all()
