"""Six joints without closed form: all branches, each certified by its residual."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.arrays import Integers
from screwkin.algebra.linear import determinant, null_vector
from screwkin.errors import InputError
from screwkin.ik import all_branches
from screwkin.ik.all_branches import has_branches
from screwkin.ik.closed import recognised
from screwkin.ik.eliminated import Candidates
from screwkin.ik.methods import solve_limb_arrays
from screwkin.ik.numeric import IkSettings
from screwkin.ik.polish import unfolded
from screwkin.ik.solutions import LimbSolutions
from screwkin.ik.ways import usable_ways
from screwkin.kinematics.serial_chain import SerialChain, distance, residual
from screwkin.kinematics.status import Status
from tests.ik.legs import Leg, apart, nearly, offset_leg, random_tip, spherical_leg, unit
from tests.laws.limbs import inside, random_robot, targets_at

LOW = np.array([-2.0, -0.5, -2.0, -0.1, -0.9, -0.4])
HIGH = np.array([1.5, 1.5, 2.0, 2.5, 0.9, 0.4])


def pairs_leg() -> Leg:
    """A leg of pairs: pitch and tilted roll 30 mm apart, a yaw that meets the roll, a knee parallel to the
    ankle's pitch, an ankle's roll 18 mm below."""
    tilt = 0.17
    axes = [[0, 1, 0], [np.cos(tilt), 0, np.sin(tilt)], [-np.sin(tilt), 0, np.cos(tilt)]]
    axes += [[0, 1, 0], [0, 1, 0], [1, 0, 0]]
    points = [[0, 0.06, -0.1], [0, 0.11, -0.13], [0.05, 0.11, -0.25], [0, 0.11, -0.44]]
    points += [[0, 0.11, -0.74], [0, 0.11, -0.758]]
    tip = np.eye(4)
    tip[:3, 3] = [0, 0.11, -0.79]
    return Leg(np.array(axes, dtype=float), np.array(points, dtype=float), tip)


def universal_leg() -> Leg:
    """A yaw that meets the hip's pitch, a universal ankle, a tilted knee: determinants vanish everywhere."""
    leg = offset_leg()
    axes = leg.axes.copy()
    axes[3] = [0, np.cos(0.1), np.sin(0.1)]
    return replace(leg, axes=axes)


def random_leg(seed: int) -> Leg:
    rng = np.random.default_rng(seed)
    return Leg(unit(rng, 6), 0.3 * rng.normal(size=(6, 3)), random_tip(rng))


LEGS = {
    "pairs": pairs_leg(),
    "two meeting pairs": universal_leg(),
    "random": random_leg(0),
    "parallel to 2e-3": nearly(offset_leg(), 2e-3, 1),
    "meeting to 2e-3": nearly(spherical_leg(), 2e-3, 2),
    "parallel to 1e-6": nearly(offset_leg(), 1e-6, 3),
    "meeting to 1e-6": nearly(spherical_leg(), 1e-6, 4),
    "meeting to 5e-5": nearly(spherical_leg(), 5e-5, 5),
}


def limited(leg: Leg) -> SerialChain:
    return replace(leg.chain(), lower=LOW, upper=HIGH)


def solved(chain: SerialChain, T: np.ndarray, guess: np.ndarray | None = None) -> LimbSolutions:
    start = np.zeros(6) if guess is None else guess
    return solve_limb_arrays(chain, T, "auto", start, IkSettings(), True)


def assert_own_branch(leg: Leg, count: int, share: float, seed: int = 0) -> None:
    chain = limited(leg)
    assert recognised(chain) is None
    q = np.random.default_rng(seed).uniform(LOW, HIGH, (count, 6))
    T = leg.reach(q)
    found = solved(chain, T)
    assert found.method == "branches"
    own = (apart(found.q, q[:, None]) < 1e-6) & found.valid
    assert own.any(axis=1).mean() >= share
    assert found.in_limits.any(axis=1).mean() >= share
    sample, k = found.valid.nonzero()
    miss = np.abs(leg.reach(found.q[sample, k]) - T[sample]).max(axis=(1, 2))
    assert miss.max() < 1e-11


@pytest.mark.parametrize("name", LEGS)
def test_the_own_branch_is_found_and_every_branch_is_a_solution(name: str) -> None:
    assert_own_branch(LEGS[name], 150, 0.99)


def upright_pairs_leg() -> Leg:
    """Pitch, roll and yaw in pairs, the yaw 12 mm ahead, a knee parallel to a universal ankle's pitch."""
    axes = [[0, 1, 0], [1, 0, 0], [0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0]]
    points = [[0, 0, -0.077], [0, 0, -0.103], [0.012, 0, -0.1515], [-0.002, 0, -0.2685]]
    points += [[-0.0018, 0.0002, -0.51369], [-0.0018, 0.0002, -0.51369]]
    tip = np.eye(4)
    tip[:3, 3] = [0, 0, -0.55]
    return Leg(np.array(axes, dtype=float), np.array(points, dtype=float), tip)


def test_a_leg_in_its_plane_of_symmetry_is_solved_near_the_guess() -> None:
    """There all branches share angles of roll and yaw, so that elimination misses some."""
    leg, rng = upright_pairs_leg(), np.random.default_rng(0)
    home = np.array([-0.45, 0, 0, 0.8, -0.35, 0])
    q = home + rng.uniform(-0.3, 0.3, (200, 6)) * [1, 0, 0, 1, 1, 0]
    found = solved(limited(leg), leg.reach(q), home)
    assert found.in_limits[:, 0].all()
    assert apart(found.q[:, 0], q).max() < 1e-6


def symmetric_leg(seed: int, meet: bool = False) -> tuple[Leg, np.ndarray]:
    """Pitch, roll and yaw of a hip in any order and a knee and ankle; which joints pitch.

    All are offset; or the pitch comes first, roll, yaw and knee meet in pairs and the ankle is universal, so
    that determinants vanish everywhere.
    """
    rng = np.random.default_rng(seed)
    hip = np.array([1, 0, 2]) if meet else rng.permutation(3)
    axes = np.array([*np.eye(3)[hip], [0, 1, 0], [0, 1, 0], [1, 0, 0]], dtype=float)
    points = np.zeros((6, 3))
    points[:, 0] = rng.uniform(-0.03, 0.03, 6)
    points[:, 2] = np.array([0.0, -0.03, -0.09, -0.35, -0.65, -0.67]) + rng.uniform(-0.02, 0.02, 6)
    if meet:
        points[1:, 0], points[5, 2] = points[1, 0], points[4, 2]
    tip = np.eye(4)
    tip[:3, 3] = 0.01, 0.0, -0.72
    return Leg(axes, points, tip), axes[:, 1]


@pytest.mark.parametrize("beside", [0.0, 1e-9, 1e-5, 1e-3, 0.03])
def test_the_own_branch_is_found_in_and_beside_a_plane_in_which_all_share_an_angle(beside: float) -> None:
    """Wherever the guess is; by one elimination alone two of five are missed."""
    for seed, meet in ((31, False), (32, False), (34, False), (37, False), (38, True)):
        leg, pitch = symmetric_leg(seed, meet)
        chain = replace(leg.chain(), lower=np.full(6, -2.6), upper=np.full(6, 2.6))
        q = np.random.default_rng(seed).uniform(-1.2, 1.2, (100, 6)) * np.where(pitch == 1.0, 1.0, beside)
        found = solved(chain, leg.reach(q))
        own = ((apart(found.q, q[:, None]) < 1e-6) & found.valid).any(axis=1)
        assert own.mean() > 0.95  # the rest nearly fall together with others


def sharing(leg: Leg, chain: SerialChain, joint: int, seed: int) -> np.ndarray | None:
    """Two positions (2, 6) of one pose in which a joint has the same angle, met along a random line.

    The line's positions are one branch; Newton steps follow another one until the angles cross.
    """
    start, end = np.random.default_rng(seed).uniform(LOW, HIGH, (2, 6))

    def at(t: float) -> np.ndarray:
        return np.asarray(start + t * (end - start))

    def followed(t: float, q: np.ndarray) -> np.ndarray:
        for _ in range(3):
            lack, J = residual(chain, q[None], leg.reach(at(t)[None]))
            q = q + np.linalg.solve(J[0], lack[0])
        return q

    def ahead(t: float, q: np.ndarray) -> bool:
        return bool(np.sin(q[joint] - at(t)[joint]) > 0)

    def bisected(low: float, high: float, q: np.ndarray) -> np.ndarray:
        for _ in range(45):
            middle = (low + high) / 2
            new = followed(middle, q)
            low, high, q = (low, middle, q) if ahead(middle, new) != ahead(low, q) else (middle, high, new)
        return np.array([at(low), q])

    others = solved(chain, leg.reach(start[None])).q[0]
    for q in others[np.isfinite(others).all(axis=1) & (apart(others, start) > 1e-3)]:
        for t in np.arange(40) / 40:
            new = followed(t + 1 / 40, q)
            if apart(new, q) > 0.3:
                break
            if ahead(t + 1 / 40, new) != ahead(t, q):
                both = bisected(t, t + 1 / 40, q)
                if apart(*both[:, [joint]]) < 1e-9 and apart(*both) > 0.05:
                    return both
            q = new
    return None


@pytest.mark.parametrize("name", ["pairs", "parallel to 2e-3", "meeting to 2e-3"])
def test_branches_that_share_the_angle_that_is_eliminated_are_found(name: str) -> None:
    """There the null vector belongs to neither: another joint tells them apart."""
    leg, met = LEGS[name], 0
    chain = limited(leg)
    for seed in range(4):
        both = sharing(leg, chain, usable_ways(chain)[0].joint, seed)
        if both is not None:
            found, met = solved(chain, leg.reach(both[:1])), met + 1
            for q in both:
                assert ((apart(found.q[0], q) < 1e-6) & found.valid[0]).any(), seed
    assert met


@pytest.mark.slow
@pytest.mark.parametrize("name", LEGS)
def test_the_own_branch_is_found_in_thousands_of_poses(name: str) -> None:
    assert_own_branch(LEGS[name], 10_000, 0.999)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_the_own_branch_of_perturbed_legs_is_found(seed: int) -> None:
    assert_own_branch(nearly(pairs_leg(), 10.0 ** -(seed % 5), seed), 2000, 0.995)


def test_a_pose_alone_has_the_branches_that_it_has_in_a_batch() -> None:
    leg = pairs_leg()
    chain, T = limited(leg), leg.reach(np.random.default_rng(5).uniform(LOW, HIGH, (105, 6)))
    whole = solved(chain, T)
    for k in range(4):
        alone = solved(chain, T[k])
        np.testing.assert_array_equal(alone.valid, whole.valid[k])
        np.testing.assert_allclose(alone.q, whole.q[k], atol=1e-9)


def test_what_is_decided_at_once_is_what_care_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    """The samples that leave nothing open take a shorter way to the same answer."""
    leg, rng = pairs_leg(), np.random.default_rng(6)
    chain, T, guess = limited(leg), leg.reach(rng.uniform(LOW, HIGH, (120, 6))), rng.uniform(LOW, HIGH, 6)
    taken = all_branches._open
    opened: list[int] = []

    def counted(found: Candidates, count: int, tolerances: tuple[float, float]) -> Integers:
        opened.append(len(taken(found, count, tolerances)))
        return np.arange(count) if len(opened) > 1 else taken(found, count, tolerances)

    monkeypatch.setattr(all_branches, "_open", counted)
    one, other = solved(chain, T, guess), solved(chain, T, guess)
    assert opened[0] < 60
    np.testing.assert_array_equal(one.valid, other.valid)
    np.testing.assert_array_equal(one.in_limits, other.in_limits)
    np.testing.assert_allclose(one.q, other.q, atol=1e-11)


def test_both_branches_beside_a_fold_are_reached_from_between_them() -> None:
    """There the Jacobian is singular, and Newton steps know no way."""
    chain, leg = limited(pairs_leg()), pairs_leg()
    low, high = np.array([0.3, -0.2, 0.4, 0.5, 0.2, 0.1]), np.array([0.3, -0.2, 0.4, -0.5, 0.2, 0.1])

    def jacobian(q: np.ndarray) -> np.ndarray:
        return np.asarray(residual(chain, q[None], leg.reach(q[None]))[1][0])

    for _ in range(60):
        middle = (low + high) / 2
        same = np.linalg.det(jacobian(middle)) * np.linalg.det(jacobian(low)) > 0
        low, high = (middle, high) if same else (low, middle)
    own = low + 3e-3 * np.linalg.svd(jacobian(low))[2][-1]
    target = leg.reach(own[None])
    q, error = np.zeros((1, 16, 6)), np.full((1, 16), np.inf)
    q[0, 5], error[0, 5] = low, distance(chain, low[None], target)[0]
    assert 1e-9 < error[0, 5] < 1e-2
    unfolded(chain, q, error, target)
    solved_ones = q[0, error[0] < 1e-12]
    assert len(solved_ones) == 2
    assert apart(solved_ones, own).min() < 1e-8
    assert 1e-3 < apart(*solved_ones) < 1e-2


def test_a_pose_out_of_reach_ends_at_the_nearest() -> None:
    leg = pairs_leg()
    T = leg.reach(np.zeros((1, 6)))
    T[:, 2, 3] -= 0.2
    found = solved(limited(leg), T)
    assert found.status == Status.UNREACHABLE
    assert 0.1 < found.residual[0, 0] < 0.3


def test_a_singular_pose_is_solved() -> None:
    """The knee's axis, and the hip's and ankle's points in one line with it: two branches fall together."""
    leg = pairs_leg()
    q = np.zeros((1, 6))
    q[0, 3] = 0.0
    found = solved(limited(leg), leg.reach(q))
    assert found.status == Status.CONVERGED


def test_whole_bodies_and_limbs_agree_about_limbs_without_closed_form() -> None:
    robot = random_robot(0)
    targets = targets_at(robot, inside(robot, 20, 0))
    solution = sk.solve_pose(robot, targets)
    assert solution.ok
    for limb in robot.limbs:
        chain = SerialChain.of(robot, limb.name)
        best = sk.limb_ik(robot, limb.name, targets[limb.tip]).best
        np.testing.assert_allclose(solution.state.q[:, list(chain.joints)], best, atol=1e-9)


def test_branches_are_refused_where_it_does_not_fit() -> None:
    robot = random_robot(1)
    T = np.eye(4)
    with pytest.raises(InputError, match="four to six revolute joints"):
        sk.limb_ik(robot, "left_arm", T, "branches")
    assert not has_branches(SerialChain.of(robot, "left_arm"))


def test_reflections_give_determinants_and_null_vectors() -> None:
    rng = np.random.default_rng(0)
    for n in (1, 2, 5, 6):
        A = rng.normal(size=(n, n))
        assert determinant(A.tolist()) == pytest.approx(np.linalg.det(A))
    A[-1] = A[0] + A[1]
    assert np.abs(A @ null_vector(A.tolist())).max() < 1e-13
    A[:, 0] = 0.0
    assert null_vector(A.tolist())[0] != 0
