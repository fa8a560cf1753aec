"""The comparison of methods: the paper's Table 5 in our rows, the walk it is made on, and other libraries."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from screwkin.analysis import ik_others
from screwkin.analysis.ik_study import IkRow, fitting_entries, ik_study, measured_row
from screwkin.analysis.ik_targets import (
    FootPath,
    foot_along,
    random_targets,
    walking_path,
    walking_targets,
)
from screwkin.errors import InputError, UnknownNameError, UnreachableError
from screwkin.ik.methods import solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.table import load_robot
from tests.ik.legs import apart

PATH = FootPath(lateral=0.048, height=0.43, stride=0.06, lift=0.03)


@pytest.fixture(scope="module")
def leg() -> SerialChain:
    return SerialChain.of(load_robot("poppy12"), "left_leg")


@pytest.fixture(scope="module")
def rows(leg: SerialChain) -> dict[str, IkRow]:
    """The rows of the walk that the paper's table has, and those that its speed-up is told by."""
    target = walking_targets(leg, walking_path(leg))
    wanted = ("closed", "hybrid-newton", "hybrid-lm", "hybrid-dls", "dls-0.01", "dls-0.055", "pinv")
    entries = [entry for entry in fitting_entries(leg, 500) if entry.name in wanted]
    return {entry.name: measured_row(leg, "gait", target, entry) for entry in entries}


def test_hybrids_take_at_most_three_iterations_on_all_points_of_the_walk(rows: dict[str, IkRow]) -> None:
    for name in ("hybrid-newton", "hybrid-lm"):
        assert rows[name].samples == 750
        assert rows[name].solved == 1.0
        assert rows[name].max_iterations <= 3


def test_mean_iterations_stand_in_the_order_of_the_papers_table(rows: dict[str, IkRow]) -> None:
    means = [rows[name].mean_iterations for name in ("closed", "hybrid-dls", "dls-0.01", "pinv")]
    assert means == sorted(means)
    assert rows["closed"].mean_iterations < rows["hybrid-newton"].mean_iterations < means[2]
    assert rows["closed"].solved == rows["closed"].in_limits == 1.0


def test_the_hybrid_needs_a_twentieth_of_the_iterations_of_damped_least_squares(
    rows: dict[str, IkRow],
) -> None:
    """The paper says up to 20 times; damping 0.055 gives the 104 iterations of its numerical DLS."""
    assert 20 * rows["hybrid-newton"].mean_iterations <= rows["dls-0.055"].mean_iterations
    assert 95 < rows["dls-0.055"].mean_iterations < 115


def test_the_walk_is_the_papers_in_size_and_number(leg: SerialChain) -> None:
    path = walking_path(leg)
    assert (path.height, path.stride, path.lateral) == pytest.approx((0.43, 0.06, 0.048))
    assert walking_targets(leg, path).shape == (750, 4, 4)


def test_the_joints_move_smoothly_along_the_walk(leg: SerialChain) -> None:
    target = walking_targets(leg, walking_path(leg))
    found = solve_limb(leg, target, "closed", np.zeros((750, 6)), IkSettings(), (750,))
    assert apart(found.path()[1:], found.path()[:-1]).max() < 0.06
    assert found.in_limits.any(axis=1).all()


def feet() -> tuple[np.ndarray, np.ndarray]:
    return foot_along(PATH, 1), foot_along(PATH, -1)


def test_one_foot_stands_while_the_other_swings_and_both_in_double_support() -> None:
    """The waist cancels in the difference of the feet; heights are above the floor."""
    left, right = feet()
    high = np.stack([left, right])[:, :, 2] + PATH.height
    assert high.min() >= -1e-15
    assert high.max() == pytest.approx(PATH.lift, rel=1e-3)
    assert not ((high[0] > 1e-9) & (high[1] > 1e-9)).any()
    fraction = np.arange(750) / 50 % 1.0
    assert (high[:, fraction < PATH.double_support] < 1e-12).all()
    np.testing.assert_allclose(left[:, 1] - right[:, 1], 2 * PATH.lateral, atol=1e-15)
    np.testing.assert_allclose((left - right)[[0, -1], 0], 0.0, atol=1e-15)
    assert np.abs((left - right)[:, 0]).max() == pytest.approx(PATH.stride)


def test_the_waist_moves_as_the_pendulum_whose_zmp_goes_from_foot_to_foot() -> None:
    """Its ZMP, c - h c''/g from differences of its path, rests below the standing foot."""
    left, _ = feet()
    y = PATH.lateral - left[:, 1]
    zmp = y[1:-1] - PATH.height / 9.81 * np.diff(y, 2) * 50.0**2
    middle = [round((phase + 0.6) * 50) - 1 for phase in range(15)]
    wanted = [0.0, *(-PATH.lateral if phase % 2 else PATH.lateral for phase in range(1, 14)), 0.0]
    np.testing.assert_allclose(zmp[middle], wanted, atol=0.002)


def test_the_waist_walks_as_far_as_the_feet() -> None:
    left, right = feet()
    # Both feet end side by side, twelve steps ahead, with the waist between them.
    np.testing.assert_allclose([left[0, 0], right[0, 0]], 0.0, atol=1e-5)
    np.testing.assert_allclose([left[-1, 0], right[-1, 0]], 0.0, atol=2e-3)


def test_a_study_tells_every_method_that_fits_on_both_sets_and_its_settings() -> None:
    shares: list[float] = []
    study = ik_study(load_robot("poppy12"), "right_leg", poses=20, cap=30, progress=shares.append)
    ours = [entry.name for entry in fitting_entries(SerialChain.of(load_robot("poppy12"), "right_leg"), 500)]
    for data, samples in (("gait", 750), ("random", 20)):
        rows = [row for row in study.rows if row.data == data]
        assert [row.method for row in rows][: len(ours)] == ours
        assert all(row.settings and row.samples == samples for row in rows)
        assert all(0 <= row.in_limits <= row.solved <= 1 for row in rows)
    assert any("waist 0.430 m" in note for note in study.notes)
    assert any("seed 0" in note for note in study.notes)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_a_limb_without_closed_form_gets_the_numeric_rows_and_no_walk() -> None:
    study = ik_study(load_robot("bioloid"), "left_arm", poses=10, cap=30)
    names = {row.method for row in study.rows}
    assert {"newton", "lm", "dls-0.01", "dls-0.055", "pinv"} <= names
    assert not names & {"closed", "hybrid-newton"}
    assert {row.data for row in study.rows} == {"random"}


def test_a_smaller_robot_walks_with_its_waist_as_high_as_it_can() -> None:
    chain = SerialChain.of(load_robot("bioloid"), "left_leg")
    path = walking_path(chain)
    assert 0.94 < path.height / 0.1862548 < 0.984
    assert path.stride / path.height == pytest.approx(0.06 / 0.43)


def test_random_targets_are_the_same_for_a_seed_and_lie_within_reach(leg: SerialChain) -> None:
    np.testing.assert_array_equal(random_targets(leg, 5, 3), random_targets(leg, 5, 3))
    assert np.abs(random_targets(leg, 5, 3) - random_targets(leg, 5, 4)).max() > 0.01
    assert (np.linalg.norm(random_targets(leg, 100, 3)[:, :3, 3], axis=1) < 0.5).all()


def test_what_cannot_be_studied_is_refused() -> None:
    robot = load_robot("poppy12")
    with pytest.raises(UnknownNameError, match="left_leg"):
        ik_study(robot, "tail")
    with pytest.raises(InputError, match="poses is 0"):
        ik_study(robot, "left_leg", poses=0)
    with pytest.raises(InputError, match="seed is -1"):
        ik_study(robot, "left_leg", seed=-1)
    with pytest.raises(InputError, match="waist is nan"):
        ik_study(robot, "left_leg", waist=float("nan"))
    with pytest.raises(UnreachableError, match=r"with the waist 0\.440 m above the soles") as caught:
        ik_study(robot, "left_leg", waist=0.44)
    assert caught.value.limb == "left_leg"


def test_libraries_that_are_absent_give_no_rows(monkeypatch: pytest.MonkeyPatch, leg: SerialChain) -> None:
    assert ik_others._library("no_such_library") is None
    monkeypatch.setattr(ik_others, "_library", lambda name: None)
    for _, _, solve in ik_others.OTHERS:
        assert solve(leg, random_targets(leg, 1, 0), IkSettings()) is None


def test_offsets_and_axes_make_the_limb_by_the_product_of_its_rotations(leg: SerialChain) -> None:
    """The convention of EAIK: p = P0 + R1 (P1 + R2 (P2 + …)), R = R1 R2 … Rn."""
    axes, offsets = ik_others.offset_parameters(leg)
    q = np.array([0.1, -0.2, -0.5, 0.9, -0.3, 0.2])
    p, R = offsets[6], np.eye(3)
    for s, offset, theta in reversed(list(zip(axes, offsets[:6], q, strict=True))):
        turn = Rotation.from_rotvec(theta * s).as_matrix()
        p, R = offset + turn @ p, turn @ R
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = R, p
    found = solve_limb(leg, target[None], "closed", q[None], IkSettings(), (1,))
    assert apart(found.best[0], q) < 1e-9


def test_of_eaiks_answers_least_squares_ones_and_wrong_ones_do_not_count(
    monkeypatch: pytest.MonkeyPatch, leg: SerialChain
) -> None:
    """A stand-in with EAIK's interface: right for the first pose, wrong for the next, none for the last."""
    q = np.array([0.1, -0.2, -0.5, 0.9, -0.3, 0.2])
    target = np.repeat(random_targets(leg, 1, 0), 3, axis=0)
    right = solve_limb(leg, target[:1], "closed", q[None], IkSettings(), (1,)).best[0]
    answers = iter([([right, right + 2.0], [False, True]), ([right + 0.1], [False]), ([right], [True])])

    class HPRobot:
        def __init__(self, H: np.ndarray, P: np.ndarray) -> None:
            assert H.shape == (6, 3)
            assert P.shape == (7, 3)

        def hasKnownDecomposition(self) -> bool:
            return True

        def IK(self, pose: np.ndarray) -> SimpleNamespace:
            Q, least = next(answers)
            return SimpleNamespace(Q=Q, is_LS=least)

    monkeypatch.setattr(ik_others, "_library", lambda name: SimpleNamespace(HPRobot=HPRobot))
    outcome = ik_others.eaik(leg, target, IkSettings())
    assert outcome is not None
    assert outcome.solved.tolist() == [True, False, False]
    np.testing.assert_array_equal(outcome.q[0], right)
