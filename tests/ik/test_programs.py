"""Closed forms as programs against the readable closed forms, hard cases included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler.run import run
from screwkin.errors import ShapeError
from screwkin.ik import programs as limbs
from screwkin.ik.closed import closed_form, solve_closed
from screwkin.ik.loops import solve_pose
from screwkin.kinematics.serial_chain import Chain
from tests.compiler.robots import with_leg
from tests.ik.legs import backwards, random_parallel_leg, random_spherical_leg

LEGS = (("bioloid", "left_leg"), ("bioloid", "right_leg"), ("poppy12", "left_leg"), ("poppy12", "right_leg"))


@pytest.fixture
def by_program(monkeypatch):
    """Makes limb_ik take the program, or the readable algorithms."""
    return lambda answer: monkeypatch.setattr("screwkin.ik.limb.pays", lambda *_, **__: answer)


def within_limits(robot, count, seed=0):
    rng = np.random.default_rng(seed)
    low, high = (np.array([getattr(j, k) for j in robot.joints]) for k in ("lower", "upper"))
    return rng.uniform(low, high, (count, len(low)))


@pytest.mark.parametrize(("name", "limb"), LEGS)
def test_the_program_has_the_branches_flags_and_order_of_the_readable_path(name, limb, by_program):
    robot = sk.load_robot(name)
    T = sk.frame_pose(robot, sk.State(np.eye(4), within_limits(robot, 1200)), robot.limb(limb).tip)
    T[:40, 0, 3] += 2.0  # out of reach
    by_program(True)
    large = sk.limb_ik(robot, limb, T, least_squares=False)
    by_program(False)
    parts = [sk.limb_ik(robot, limb, T[i : i + 600], least_squares=False) for i in (0, 600)]
    for field in ("valid", "in_limits"):
        np.testing.assert_array_equal(
            getattr(large, field), np.concatenate([getattr(p, field) for p in parts])
        )
    # Where branches are equally near to the guess rounding decides which comes first.
    q, few = large.q[40:], np.concatenate([p.q for p in parts])[40:]
    alike = np.isclose(q, few, atol=1e-7, equal_nan=True).all(axis=(1, 2))
    assert alike.mean() > 0.998
    np.testing.assert_allclose(large.best[40:], few[:, 0], atol=1e-7)
    assert large.residual[40:, 0].max() <= 1e-12
    assert (large.status[:40] == sk.solve.status.Status.UNREACHABLE).all()


@pytest.mark.parametrize(
    "leg",
    [random_spherical_leg(11), random_parallel_leg(12), backwards(random_spherical_leg(13), 13)],
    ids=["spherical", "parallel", "backwards"],
)
def test_legs_with_any_axes_have_the_solutions_and_flags_of_the_readable_path(leg, by_program):
    robot = with_leg(leg, 6)
    chain = Chain.of(robot, "left_leg")
    q = np.zeros((1100, 12))
    q[:, list(chain.joints)] = np.random.default_rng(3).uniform(-3, 3, (1100, 6))
    T = sk.frame_pose(robot, sk.State(np.eye(4), q), "left_foot")
    T[:100, :3, 3] += np.random.default_rng(4).normal(size=(100, 3))  # within reach or not
    by_program(True)
    large = sk.limb_ik(robot, "left_leg", T, least_squares=False)
    by_program(False)
    small = [sk.limb_ik(robot, "left_leg", T[i : i + 550], least_squares=False) for i in (0, 550)]
    for field in ("valid", "in_limits", "status"):
        told = np.concatenate([getattr(p, field) for p in small])
        assert (getattr(large, field) == told).all(), field
    few = np.concatenate([p.q for p in small])
    alike = np.isclose(large.q, few, atol=1e-6, equal_nan=True).all(axis=(1, 2))
    assert alike.mean() > 0.995  # branches equally near to the guess stand in either order
    assert np.nanmax(np.where(large.valid, large.residual, np.nan)) <= 1e-11


@pytest.mark.parametrize("beyond", [-1e-6, 0.0, 1e-10, 1e-8, 1e-6])
def test_a_joint_at_its_limit_is_inside_to_a_billionth(beyond, by_program):
    by_program(True)
    robot = sk.load_robot("bioloid")
    q = np.tile(sk.home(robot).q, (1000, 1))
    joint = robot.joint_names.index("left_hip_roll")
    q[::2, joint] = robot.joints[joint].upper + beyond
    T = sk.frame_pose(robot, sk.State(np.eye(4), q), "left_foot")
    guess = q[:, list(Chain.of(robot, "left_leg").joints)]
    found = sk.limb_ik(robot, "left_leg", T, guess=guess, least_squares=False)
    same = np.abs(found.q[::2] - guess[::2, None]).max(axis=-1) < 1e-6
    assert (same.sum(axis=1) == 1).all()
    assert (found.in_limits[::2][same] == (beyond <= 1e-9)).all()


@pytest.mark.parametrize(("name", "limb"), LEGS)
def test_the_nearest_solution_is_the_one_that_was_moved_a_little(name, limb):
    robot = sk.load_robot(name)
    q = within_limits(robot, 3000, 1)
    T = sk.frame_pose(robot, sk.State(np.eye(4), q), robot.limb(limb).tip)
    chain = Chain.of(robot, limb)
    own = q[:, list(chain.joints)]
    guess = own + 0.05 * np.random.default_rng(2).uniform(-1, 1, own.shape)
    found = run(limbs.limb_nearest(robot, limb), {"T_base_tip": T, "guess": guess}, path="numpy")
    sure = found["found"][:, 0] == 1
    assert sure.mean() > 0.99
    branches, _, valid = solve_closed(closed_form(chain), T)
    apart = np.linalg.norm(np.sin((branches - guess[:, None]) / 2), axis=-1)
    first = np.where(valid, apart, np.inf).argmin(axis=1)
    readable = branches[np.arange(len(T)), first]
    np.testing.assert_allclose(found["q"][sure], readable[sure], atol=1e-7)
    assert np.quantile(found["error"][sure], 0.99) < 1e-12


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
    count = len(walked.time)
    assert count > 1000, "else the test compares Newton with itself"
    targets = {"base": walked.T_world_base}
    for limb in robot.limbs:
        T = walked.T_world_tip[limb.tip]
        targets[limb.tip] = T if limb.kind == "leg" else T[:, :3, 3]
    guess = sk.State(walked.T_world_base, np.array(robot.posture("home").q))
    fast, slow = sk.solve_pose(robot, targets, guess), solve_pose(robot, targets, guess)
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
    small = solve_pose(
        robot, {k: v[:10] for k, v in targets.items()}, sk.State(states.T_world_base[:10], q[:10])
    )
    np.testing.assert_array_equal(large.status[:10], small.status)
    assert large.status[[3, 7], 0].tolist() == [
        sk.solve.status.Status.SINGULAR,
        sk.solve.status.Status.UNREACHABLE,
    ]
    np.testing.assert_allclose(large.distance[7, 0], small.distance[7, 0], rtol=1e-6)
