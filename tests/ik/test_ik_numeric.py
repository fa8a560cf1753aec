"""Numeric and hybrid methods: what a step is, when they stop, and what the paper's settings give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from screwkin.errors import InputError
from screwkin.ik.hybrid import hybrid_seed, spherical_variant
from screwkin.ik.methods import Method, solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.kinematics.axis_geometry import meeting
from screwkin.kinematics.serial_chain import SerialChain, residual
from screwkin.model.table import load_robot
from tests.ik.legs import Floats, apart, backwards, miss, offset_leg, random_spherical_leg, spherical_leg

LEG = offset_leg()
CHAIN = LEG.chain()
KNEES_BENT = np.array([0, 0, -0.6, 1.1, -0.5, 0])
NUMERIC: tuple[Method, ...] = ("newton", "lm", "dls", "pinv")


def bent(seed: int, count: int) -> Floats:
    """Regular positions: knees well bent."""
    q = np.random.default_rng(seed).uniform(-0.4, 0.4, (count, 6))
    return np.asarray(q + KNEES_BENT)


def lack(q: Floats, target: Floats) -> Floats:
    """What lacks, by the independent forward kinematics: rotation vector and translation (B, 6)."""
    from scipy.spatial.transform import Rotation

    T = LEG.reach(q)
    turn = Rotation.from_matrix(target[:, :3, :3] @ T[:, :3, :3].swapaxes(1, 2)).as_rotvec()
    return np.concatenate([turn, target[:, :3, 3] - T[:, :3, 3]], axis=1)


def test_error_and_jacobian_agree_with_differences_of_another_forward_kinematics() -> None:
    q, target = bent(1, 20), LEG.reach(bent(2, 20))
    error, J = residual(CHAIN, q, target)
    np.testing.assert_allclose(error, lack(q, target), atol=1e-12)
    h = 1e-6
    for i in range(6):
        moved = LEG.reach(q + h * np.eye(6)[i])
        # Seen from the target at q itself, what lacks is small and its rotation vector is the turn.
        np.testing.assert_allclose(J[:, :, i], lack(q, moved) / h, atol=2e-6)
    places, positions = residual(CHAIN, q, target[:, :3, 3])
    np.testing.assert_array_equal(places, error[:, 3:])
    np.testing.assert_array_equal(positions, J[:, 3:])


@pytest.mark.parametrize("method", NUMERIC)
def test_every_method_arrives_from_nearby(method: Method) -> None:
    q = bent(3, 200)
    start = q + np.random.default_rng(4).uniform(-0.1, 0.1, q.shape)
    found = solve_limb(CHAIN, LEG.reach(q), method, start, IkSettings(), (200,))
    assert found.q.shape == (200, 1, 6)
    assert found.valid.all()
    assert apart(found.best, q).max() < 1e-6
    assert miss(LEG, found.best, LEG.reach(q)).max() < 2e-10


@pytest.mark.parametrize("method", NUMERIC)
def test_at_the_target_nothing_is_done(method: Method) -> None:
    q = bent(5, 10)
    found = solve_limb(CHAIN, LEG.reach(q), method, q, IkSettings(), (10,))
    assert (found.iterations == 0).all()
    np.testing.assert_array_equal(found.best, q)


@pytest.mark.parametrize("method", NUMERIC)
def test_a_sample_is_solved_alike_alone_and_in_company(method: Method) -> None:
    q = bent(6, 12)
    start = np.tile(KNEES_BENT / 2, (12, 1))
    settings = IkSettings(1e-6, 1e-6)
    together = solve_limb(CHAIN, LEG.reach(q), method, start, settings, (12,))
    for k in range(12):
        alone = solve_limb(CHAIN, LEG.reach(q[k : k + 1]), method, start[:1], settings, (1,))
        assert alone.iterations[0] == together.iterations[k]
        np.testing.assert_allclose(alone.best[0], together.best[k], atol=1e-9)


def test_one_step_of_damped_least_squares_is_the_textbook_formula() -> None:
    q, target = bent(7, 5), LEG.reach(bent(8, 5))
    settings = IkSettings(max_iterations=1, damping=0.3, gain=0.7, starts=1)
    found = solve_limb(CHAIN, target, "dls", q, settings, (5,))
    for k in range(5):
        J = residual(CHAIN, q[k : k + 1], target[k : k + 1])[1][0]
        # Least squares with the unknowns themselves as further, weighted equations.
        stacked = np.vstack([J, 0.3 * np.eye(6)])
        right = np.r_[lack(q[k : k + 1], target[k : k + 1])[0], np.zeros(6)]
        step = np.linalg.lstsq(stacked, right, rcond=None)[0]
        assert apart(found.best[k], q[k] + 0.7 * step) < 1e-12
        assert found.iterations[k] == 1


def test_one_step_of_the_pseudoinverse_is_the_shortest_that_solves_the_linear_equations() -> None:
    q, target = bent(9, 5), LEG.reach(bent(10, 5))
    found = solve_limb(CHAIN, target, "pinv", q, IkSettings(max_iterations=1, starts=1), (5,))
    for k in range(5):
        J = residual(CHAIN, q[k : k + 1], target[k : k + 1])[1][0]
        step = np.linalg.lstsq(J, lack(q[k : k + 1], target[k : k + 1])[0], rcond=None)[0]
        assert apart(found.best[k], q[k] + step) < 1e-12


def test_tolerances_decide_what_is_solved() -> None:
    q = bent(11, 50)
    start = q + 1e-4
    loose = IkSettings(position_tolerance=1e-3, rotation_tolerance=1e-2)
    assert (solve_limb(CHAIN, LEG.reach(q), "dls", start, loose, (50,)).iterations == 0).all()
    tight = solve_limb(CHAIN, LEG.reach(q), "dls", start, replace(loose, position_tolerance=1e-9), (50,))
    assert (tight.iterations > 0).all()
    gap = np.linalg.norm(LEG.reach(tight.best)[:, :3, 3] - LEG.reach(q)[:, :3, 3], axis=1)
    assert gap.max() <= 1.1e-9


def test_the_bound_on_iterations_holds_and_such_samples_are_not_valid() -> None:
    target = LEG.reach(bent(12, 20))
    target[:, 2, 3] -= 0.5
    for method in NUMERIC:
        found = solve_limb(CHAIN, target, method, bent(13, 20), IkSettings(max_iterations=7), (20,))
        assert found.iterations.max() <= 7
        assert not found.valid.any()
        np.testing.assert_allclose(found.residual[:, 0], miss(LEG, found.best, target), rtol=1e-9)


def test_out_of_reach_newton_and_the_closed_form_end_at_one_least_squares_answer() -> None:
    target = LEG.reach(bent(14, 30))
    target[:, 2, 3] -= 0.3
    closed = solve_limb(CHAIN, target, "closed", np.zeros((30, 6)), IkSettings(), (30,))
    newton = solve_limb(CHAIN, target, "newton", closed.best + 0.02, IkSettings(), (30,))
    assert not closed.valid.any()
    np.testing.assert_allclose(newton.residual, closed.residual[:, :1], rtol=1e-4)


def test_positions_alone_are_reached_by_arms_of_three_joints() -> None:
    robot = load_robot("bioloid")
    chain = SerialChain.of(robot, "right_arm")
    start = np.array(robot.posture("home").q)[list(chain.joints)]
    place = np.array([[0.03, -0.08, 0.02], [0.02, -0.10, 0.03]])
    for method in NUMERIC:
        found = solve_limb(chain, place, method, np.tile(start, (2, 1)), IkSettings(), (2,))
        assert found.valid.all()
    closed = solve_limb(chain, place, "closed", np.tile(start, (2, 1)), IkSettings(), (2,))
    np.testing.assert_allclose(closed.best, found.best, atol=1e-8)
    with pytest.raises(InputError, match="closed needs poses"):
        solve_limb(CHAIN, place, "closed", np.zeros((2, 6)), IkSettings(), (2,))


def test_the_hybrids_hip_is_where_the_paper_puts_it() -> None:
    """Paper B's similar leg: hip centre at (0, y0 + y1 - y3, -z2); the axes keep their directions."""
    similar = spherical_variant(SerialChain.of(load_robot("poppy12"), "left_leg"))
    hip = meeting(similar, (0, 1, 2))
    assert hip is not None
    np.testing.assert_allclose(list(hip), [0.0, 0.048, -0.047], atol=1e-15)
    np.testing.assert_array_equal([list(screw.s) for screw in similar.screws], LEG.axes)


def test_a_hybrid_seed_of_a_spherical_leg_is_its_solution() -> None:
    leg = spherical_leg()
    q = bent(15, 100)
    seed = hybrid_seed(leg.chain(), leg.reach(q), q)
    assert miss(leg, seed, leg.reach(q)).max() < 1e-10
    assert apart(seed, q).max() < 1e-6


def test_a_hybrid_seed_prefers_the_limits_then_the_guess() -> None:
    chain = SerialChain.of(load_robot("poppy12"), "left_leg")
    q = np.random.default_rng(16).uniform(chain.lower, chain.upper, (300, 6))
    seed = hybrid_seed(chain, LEG.reach(q), np.zeros((300, 6)))
    # The paper: a seed is off by 21 mm in the median over the joint box, 61 mm at most.
    off = np.linalg.norm(LEG.reach(seed)[:, :3, 3] - LEG.reach(q)[:, :3, 3], axis=1)
    assert 0.015 < np.median(off) < 0.027
    assert off.max() < 0.07
    assert (seed[:, 3] > -0.2).mean() > 0.95


def test_hybrids_that_do_not_fit_are_refused_by_name() -> None:
    target, start = np.eye(4)[None], np.zeros((1, 6))
    wrist = backwards(random_spherical_leg(0), 0).slid(np.arange(6.0))
    with pytest.raises(InputError, match="joint5 and joint6 do not meet"):
        solve_limb(
            replace(wrist, points=wrist.points + np.arange(6.0)[:, None]).chain(),
            target, "hybrid", start, IkSettings(), (1,),
        )  # fmt: skip
    arm = SerialChain.of(load_robot("bioloid"), "left_arm")
    with pytest.raises(InputError, match="six revolute joints are needed"):
        solve_limb(arm, target, "hybrid", np.zeros((1, 3)), IkSettings(), (1,))
    with pytest.raises(InputError, match="hybrid needs poses"):
        solve_limb(CHAIN, np.zeros((1, 3)), "hybrid", start, IkSettings(), (1,))
    axes = LEG.axes.copy()
    axes[1] = axes[0]
    with pytest.raises(InputError, match="neighbouring hip axes are parallel"):
        solve_limb(replace(LEG, axes=axes).chain(), target, "hybrid", start, IkSettings(), (1,))


@pytest.mark.parametrize(
    ("name", "value"),
    [("position_tolerance", 0.0), ("damping", -1.0), ("gain", np.nan), ("max_iterations", 0), ("gain", "a")],
)
def test_settings_out_of_range_are_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(InputError, match=f"{name} is .* it must be a positive number"):
        IkSettings(**{name: value})  # type: ignore[arg-type]


def test_an_unknown_finish_lists_the_valid_ones() -> None:
    with pytest.raises(InputError, match="valid: newton, lm, dls, pinv"):
        IkSettings(finish="closed")  # type: ignore[arg-type]
