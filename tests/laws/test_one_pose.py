"""Laws of inverse kinematics: one answer in any company, geometry and not its description, limits first."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwkin as sk
from screwkin.compiler.run import compile_program
from screwkin.ik.numeric import IkSettings
from screwkin.ik.pose_solution import PoseSolution
from screwkin.ik.programs import limb_programs_of
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.kinematics.status import Status
from tests.laws.limbs import at, inside, random_robot, slid, targets_at

BUNDLED = ("bioloid", "bioloid24", "poppy12")
BASE = np.eye(4)
ROOT = Path(__file__).parents[2]


def fresh(name: str) -> sk.Robot:
    return replace(sk.load_robot(name))


def solved(robot: sk.Robot, targets: dict[str, np.ndarray], method: str = "auto") -> PoseSolution:
    return sk.solve_pose(robot, targets, sk.State(BASE, sk.home(robot).q), method)  # type: ignore[arg-type]


def assert_one_answer(robot: sk.Robot, q: np.ndarray, sizes: tuple[int, ...]) -> PoseSolution:
    """The answer of the whole batch, which is that of every sample alone and in batches of any size."""
    targets = targets_at(robot, q)
    whole = solved(robot, targets)
    for size in sizes:
        for first in range(0, min(len(q), 8 * size), size):
            part = slice(first, first + size)
            some = solved(robot, at(targets, part))
            np.testing.assert_array_equal(some.status, whole.status[part])
            np.testing.assert_allclose(some.state.q, whole.state.q[part], atol=1e-11)
    return whole


@pytest.mark.parametrize("name", BUNDLED)
def test_a_pose_is_solved_alike_alone_and_in_any_batch(name: str) -> None:
    robot = fresh(name)
    assert_one_answer(robot, inside(robot, 105, 1), (1, 7, 101))


@pytest.mark.parametrize("seed", [1, pytest.param(0, marks=pytest.mark.slow)])
def test_poses_of_random_robots_are_solved_alike_alone_and_in_any_batch(seed: int) -> None:
    robot = random_robot(seed)
    assert_one_answer(robot, inside(robot, 6, seed), (1, 5))


@pytest.mark.parametrize("name", ["bioloid", pytest.param("poppy12", marks=pytest.mark.slow)])
def test_a_prepared_robot_gives_the_same_answers(name: str) -> None:
    robot = fresh(name)
    q = inside(robot, 300, 2)
    targets, leg = targets_at(robot, q), robot.limbs[0]
    before, branches = solved(robot, targets), sk.limb_ik(robot, leg.name, targets_at(robot, q)[leg.tip])
    for program in limb_programs_of(robot):
        compile_program(program)
    after, same = solved(robot, targets), sk.limb_ik(robot, leg.name, targets[leg.tip])
    np.testing.assert_array_equal(after.status, before.status)
    np.testing.assert_allclose(after.state.q, before.state.q, atol=1e-11)
    np.testing.assert_array_equal(same.valid, branches.valid)
    np.testing.assert_allclose(same.q, branches.q, atol=1e-7)
    np.testing.assert_allclose(same.best, branches.best, atol=1e-11)


@pytest.mark.parametrize("spread", [None, 1.0])
@pytest.mark.parametrize("name", BUNDLED)
def test_reachable_poses_converge_from_home_inside_the_limits(name: str, spread: float | None) -> None:
    robot = fresh(name)
    targets = targets_at(robot, inside(robot, 500, 3, spread))
    solution = solved(robot, targets)
    assert (solution.status == Status.CONVERGED).mean() > 0.99
    for limb in robot.limbs:
        if limb.kind == "leg":
            best = sk.limb_ik(robot, limb.name, targets[limb.tip], guess=home_of(robot, limb.name)).best
            joints = list(SerialChain.of(robot, limb.name).joints)
            np.testing.assert_allclose(solution.state.q[:, joints], best, atol=1e-7)


@pytest.mark.parametrize("seed", [2, 4])
def test_reachable_poses_of_random_robots_converge_from_home_inside_the_limits(seed: int) -> None:
    robot = random_robot(seed)
    solution = solved(robot, targets_at(robot, inside(robot, 100, seed)))
    assert (solution.status == Status.CONVERGED).mean(axis=0).min() > 0.97


def test_a_position_beyond_a_redundant_limb_s_reach_is_unreachable() -> None:
    robot = random_robot(3)
    chain = SerialChain.of(robot, "right_arm")
    assert len(chain.joints) == 4
    far = np.array([1.01 * sum(chain.levers), 0.0, 0.0]) + np.array(list(chain.screws[0].s0))
    assert sk.limb_ik(robot, "right_arm", far).status == Status.UNREACHABLE
    assert solved(robot, {"right_hand": far}).status == Status.UNREACHABLE


def test_a_pose_that_five_joints_cannot_take_is_unreachable() -> None:
    robot = random_robot(4)
    T = sk.frame_pose(robot, sk.State(BASE, inside(robot, 20, 1)), "left_hand")
    T[:, :3, :3] = T[::-1, :3, :3]
    assert (sk.limb_ik(robot, "left_arm", T).status == Status.UNREACHABLE).all()


def home_of(robot: sk.Robot, limb: str) -> np.ndarray:
    return np.asarray(sk.home(robot).q[list(SerialChain.of(robot, limb).joints)])


@pytest.mark.parametrize("name", BUNDLED)
def test_points_named_on_the_axes_mean_nothing(name: str) -> None:
    robot = fresh(name)
    q = inside(robot, 60, 4)
    targets, other = targets_at(robot, q), slid(robot, 5)
    here, there = solved(robot, targets), solved(other, targets)
    np.testing.assert_array_equal(there.status, here.status)
    np.testing.assert_allclose(there.state.q, here.state.q, atol=1e-9)
    for limb in robot.limbs:
        one, two = SerialChain.of(robot, limb.name), SerialChain.of(other, limb.name)
        assert two.length == pytest.approx(one.length, abs=1e-12)


def test_a_limb_s_size_does_not_depend_on_its_zero_pose_s_description() -> None:
    """Seven random axes: sliding points along them and moving the base leave the size as it is."""
    robot = random_robot(2)
    for limb in robot.limbs:
        length = SerialChain.of(robot, limb.name).length
        assert SerialChain.of(slid(robot, 1), limb.name).length == pytest.approx(length, rel=1e-12)


def test_rows_in_another_order_mean_nothing() -> None:
    robot = fresh("bioloid")
    order = np.random.default_rng(6).permutation(len(robot.joints))
    posture = replace(robot.posture("home"), q=tuple(robot.posture("home").q[i] for i in order))
    other = replace(robot, joints=tuple(robot.joints[i] for i in order), postures=(posture,))
    targets = targets_at(robot, inside(robot, 60, 7))
    np.testing.assert_allclose(
        solved(other, targets).state.q, solved(robot, targets).state.q[:, order], atol=1e-9
    )


@pytest.mark.parametrize("method", ["newton", "lm", "dls", "pinv"])
def test_a_straight_leg_bends_towards_a_target_on_its_own_line(method: str) -> None:
    robot = fresh("bioloid")
    T = sk.frame_pose(robot, sk.State(BASE, np.zeros(18)), "left_foot")
    T[2, 3] += 0.02
    found = sk.limb_ik(robot, "left_leg", T, method, guess=np.zeros(6))  # type: ignore[arg-type]
    assert found.status == Status.CONVERGED
    solution = sk.solve_pose(robot, {"left_foot": T}, sk.State(BASE, np.zeros(18)), "newton")
    assert solution.ok


@pytest.mark.parametrize("method", ["newton", "lm", "dls", "pinv"])
def test_a_straight_arm_bends_towards_a_target_on_its_own_line(method: str) -> None:
    robot = fresh("bioloid")
    straight = np.zeros(3)
    point = sk.frame_pose(robot, sk.State(BASE, np.zeros(18)), "left_hand")[:3, 3]
    shoulder = np.array([0, 0.064646, 0.121451])
    target = shoulder + 0.8 * (point - shoulder)
    found = sk.limb_ik(robot, "left_arm", target, method, guess=straight)  # type: ignore[arg-type]
    assert found.valid.any()


def test_limits_are_preferred_within_the_tolerance_of_the_caller() -> None:
    robot = fresh("poppy12")
    joints = list(SerialChain.of(robot, "left_leg").joints)
    q = sk.home(robot).q.copy()
    q[joints[1]] = robot.joints[joints[1]].upper + 1e-7
    T = sk.frame_pose(robot, sk.State(BASE, q), "left_foot")
    loose = IkSettings(position_tolerance=1e-6, rotation_tolerance=1e-6)
    for method in ("auto", "newton"):
        kept = sk.limb_ik(robot, "left_leg", T, method, guess=q[joints], settings=loose)  # type: ignore[arg-type]
        assert kept.status == Status.CONVERGED, method
        exact = sk.limb_ik(robot, "left_leg", T, method, guess=q[joints])  # type: ignore[arg-type]
        assert exact.status == Status.OUT_OF_LIMITS, method
        both = {"settings": loose, "method": method}
        assert sk.solve_pose(robot, {"left_foot": T}, sk.State(BASE, q), **both).ok  # type: ignore[arg-type]


def test_a_joint_that_no_target_needs_rests_at_the_guess() -> None:
    robot = random_robot(11)
    assert robot.joints[0].name == "waist"
    guess = sk.State(BASE, sk.home(robot).q)
    left = robot.limbs[0]
    q = inside(robot, 4, 8)
    q[:, 0] = guess.q[0]
    both = sk.solve_pose(robot, targets_at(robot, q), guess)
    assert (both.iterations == both.iterations[:, :1]).all(), "one system for both limbs"
    one = sk.solve_pose(robot, {left.tip: targets_at(robot, q)[left.tip]}, guess)
    resting = [i for i in range(len(robot.joints)) if i not in robot.path_to(left.link)]
    np.testing.assert_array_equal(one.state.q[:, resting], np.tile(guess.q[resting], (4, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("spread", [None, 1.0])
@pytest.mark.parametrize("name", BUNDLED)
def test_thousands_of_poses_of_bundled_robots(name: str, spread: float | None) -> None:
    robot = fresh(name)
    q = inside(robot, 5000, 1, spread)
    assert (assert_one_answer(robot, q, (1, 7, 999, 1000)).status == Status.CONVERGED).mean() > 0.99
    for _ in range(20):
        solved(robot, at(targets_at(robot, q), slice(0, 3)))
    assert_one_answer(robot, q[:1000], (1, 7))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_a_thousand_poses_of_random_robots(seed: int) -> None:
    """Limbs of 3 to 8 joints, poses and positions, alone or sharing a joint; the calls are a history, too."""
    robot = random_robot(seed)
    whole = assert_one_answer(robot, inside(robot, 1000, seed), (1, 7, 999))
    assert (whole.status == Status.CONVERGED).mean(axis=0).min() > 0.97


POSES = """
import sys
from tests.laws.limbs import inside, random_robot, targets_at
from tests.laws.test_one_pose import BUNDLED, fresh, solved
answers = []
for robot in [*map(fresh, BUNDLED), *map(random_robot, range(5))]:
    solution = solved(robot, targets_at(robot, inside(robot, 60, 1)))
    answers += [solution.status.tobytes(), solution.state.q.tobytes()]
sys.stdout.buffer.write(b"".join(answers))
"""


@pytest.mark.slow
def test_poses_are_the_same_bytes_in_every_process_with_a_cold_and_a_warm_cache(tmp_path: Path) -> None:
    first, *others = (
        subprocess.run(
            [sys.executable, "-c", POSES],
            env={**os.environ, "SCREWKIN_CACHE": str(tmp_path / folder), "PYTHONPATH": str(ROOT)},
            cwd=ROOT,
            capture_output=True,
            check=True,
        ).stdout
        for folder in ("one", "one", "two")
    )
    assert len(first) > 60 * 8 * (18 + 18 + 12)
    assert others == [first, first]
