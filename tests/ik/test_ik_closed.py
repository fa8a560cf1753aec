"""The closed forms: exact, complete, for any directions of the axes, and in every degenerate place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from screwkin.algebra.newton import newton
from screwkin.errors import InputError
from screwkin.ik import closed
from screwkin.ik.closed import ClosedForm, closed_form, solve_closed
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.table import load_robot
from tests.ik.legs import (
    Floats,
    Leg,
    apart,
    backwards,
    miss,
    offset_leg,
    random_parallel_leg,
    random_spherical_leg,
    spherical_leg,
    structured_leg,
)

RANDOM_LEGS = {
    **{f"parallel axes {seed}": random_parallel_leg(seed) for seed in range(4)},
    **{f"axes 2 to 4 parallel {seed}": backwards(random_parallel_leg(seed), seed) for seed in range(2)},
    "spherical hip": random_spherical_leg(0),
    **{f"spherical hip {kind}": structured_leg(kind, 0) for kind in ("m012", "m012 p34", "m012 p45")},
    "spherical wrist": backwards(random_spherical_leg(0), 0),
    "spherical wrist m345 m12": structured_leg("m345 m12", 0),
}


def angles(seed: int, count: int, limit: float = np.pi) -> Floats:
    return np.asarray(np.random.default_rng(seed).uniform(-limit, limit, (count, 6)))


def leg_of(chain: SerialChain) -> Leg:
    """The chain's numbers as plain arrays, for the independent forward kinematics."""
    tip = np.eye(4)
    tip[:3, 3] = list(map(float, chain.tip.p))
    axes = np.array([list(map(float, screw.s)) for screw in chain.screws])
    return Leg(axes, np.array([list(map(float, screw.s0)) for screw in chain.screws]), tip)


def assert_solved(
    leg: Leg, chain: SerialChain, q: Floats, tolerance: float = 1e-12, near: float = 1e-6
) -> Floats:
    """Every target is solved, every valid branch reaches it, q is one of them; counts come back."""
    target = leg.reach(q)
    found, error, valid = solve_closed(closed_form(chain), target)
    assert valid.any(axis=1).all()
    samples, branches = np.nonzero(valid)
    # scipy's matrices and angles add their own rounding to that of the solution.
    assert miss(leg, found[samples, branches], target[samples]).max() <= tolerance + 2e-13
    assert error[valid].max() <= tolerance
    distance = np.where(valid, apart(found, q[:, None]), np.inf).min(axis=1)
    assert distance.max() <= near
    return np.asarray(valid.sum(axis=1))


@pytest.mark.parametrize("robot", ["poppy12", "bioloid"])
@pytest.mark.parametrize("limb", ["left_leg", "right_leg"])
def test_ten_thousand_random_poses_inside_the_limits_are_all_solved_exactly(robot: str, limb: str) -> None:
    chain = SerialChain.of(load_robot(robot), limb)
    q = np.random.default_rng(7).uniform(chain.lower, chain.upper, (10_000, 6))
    counts = assert_solved(leg_of(chain), chain, q)
    assert counts.max() == 8


@pytest.mark.parametrize("name", RANDOM_LEGS)
def test_axes_may_have_any_directions(name: str) -> None:
    leg = RANDOM_LEGS[name]
    form = closed_form(leg.chain())
    assert form.family == ("spherical hip" if "spherical" in name else "parallel axes")
    assert form.backwards == ("wrist" in name or "2 to 4" in name)
    counts = assert_solved(leg, leg.chain(), angles(3, 400))
    assert counts.max() <= 8


@pytest.mark.parametrize("leg", [offset_leg(), spherical_leg()], ids=["offset", "spherical"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_leg_turned_mirrored_and_renamed_has_the_same_branches(leg: Leg, mirrored: bool) -> None:
    """Nothing hangs on the base's axes, on the senses of joints, or on which points of the axes are named."""
    rng = np.random.default_rng(11)
    R = Rotation.random(random_state=5).as_matrix() @ np.diag([1.0, -1.0 if mirrored else 1.0, 1.0])
    signs = rng.choice([-1.0, 1.0], size=6)
    other = leg.moved(R).flipped(signs).slid(rng.normal(size=6))
    q = angles(12, 300, 1.5)
    assert_solved(other, other.chain(), q)
    one, _, valid = solve_closed(closed_form(leg.chain()), leg.reach(q))
    two, _, also = solve_closed(closed_form(other.chain()), other.reach(signs * q))
    two = two * signs
    for a, b, in_a, in_b in zip(one, two, valid, also, strict=True):
        assert in_a.sum() == in_b.sum()
        for branch in a[in_a]:
            assert apart(b[in_b], branch).min() < 1e-6


def test_a_spherical_leg_has_the_same_branches_by_the_quartic() -> None:
    """Two derivations that share nothing but the triangle's law of cosines find the same eight sets."""
    leg = spherical_leg()
    q = angles(5, 500, 2.6)
    by_points = closed_form(leg.chain())
    assert by_points.family == "spherical hip"
    by_quartic = closed_form(leg.chain(), family="parallel axes")
    one, _, valid = solve_closed(by_points, leg.reach(q))
    two, _, also = solve_closed(by_quartic, leg.reach(q))
    assert (valid.sum(axis=1) == also.sum(axis=1)).all()
    for a, b, in_a, in_b in zip(one, two, valid, also, strict=True):
        assert max(apart(b[in_b], branch).min() for branch in a[in_a]) < 1e-6


@pytest.mark.parametrize("leg", [offset_leg(), random_parallel_leg(1), random_spherical_leg(2)])
def test_no_solution_is_missing(leg: Leg) -> None:
    """Whatever Newton's method finds from random starts is among the branches."""
    chain = leg.chain()
    target = leg.reach(angles(21, 4, 2.0))
    found, _, valid = solve_closed(closed_form(chain), target)
    starts = angles(22, 80)
    for k in range(len(target)):
        met = set()
        for q in newton_from(leg, target[k], starts):
            near = np.where(valid[k], apart(found[k], q), np.inf)
            assert near.min() < 1e-6
            met.add(int(near.argmin()))
        assert len(met) >= 2


def newton_from(leg: Leg, target: Floats, starts: Floats) -> Floats:
    """Solutions of the independent forward kinematics, by Newton's method with central differences."""

    def lack(x: Floats) -> Floats:
        T = leg.reach(x)
        turn = Rotation.from_matrix(target[:3, :3] @ T[:, :3, :3].swapaxes(1, 2)).as_rotvec()
        return np.concatenate([turn, target[:3, 3] - T[:, :3, 3]], axis=1)

    def residual(x: Floats, samples: Floats) -> tuple[Floats, Floats]:
        h = 1e-6 * np.eye(6)
        J = np.stack([(lack(x - h[i]) - lack(x + h[i])) / 2e-6 for i in range(6)], axis=-1)
        return lack(x), J

    result = newton(residual, starts, 1e-9, 60)
    return np.asarray(result.x[result.residual < 1e-9])


DEGENERATE = {
    "hip turned by half a turn": {0: np.pi},
    "straight knee": {3: 0.0},
    "hip turned by half a turn and straight knee": {0: np.pi, 3: 0.0},
    "all at zero": dict.fromkeys(range(6), 0.0),
    "ankle roll at zero": {5: 0.0},
    "hip yaw at zero": {1: 0.0},
    "folded knee": {3: np.pi},
}


@pytest.mark.parametrize("aside", [0.023, 0.0], ids=["knee aside", "knee below the hip"])
@pytest.mark.parametrize("case", DEGENERATE)
def test_degenerate_places_of_the_quartic_are_solved(case: str, aside: float) -> None:
    """q1 = pi is t = infinity; with the knee below the hip every root of the quartic is double."""
    leg = offset_leg(aside)
    q = angles(31, 300)
    for joint, value in DEGENERATE[case].items():
        q[:, joint] = value
    assert_solved(leg, leg.chain(), q, near=2e-6)


@pytest.mark.parametrize("aside", [0.023, 0.0])
def test_a_foot_parallel_to_the_waist_is_solved(aside: float) -> None:
    leg = offset_leg(aside)
    q = angles(41, 300, 1.0)
    q[:, 1], q[:, 5], q[:, 4] = 0.0, -q[:, 0], -q[:, 2] - q[:, 3]
    assert_solved(leg, leg.chain(), q)


@pytest.mark.parametrize("aside", [0.023, 0.0])
def test_a_hip_that_may_turn_while_the_foot_is_held_gets_one_of_its_solutions(aside: float) -> None:
    """At q2 = 90 deg axes 1, 3, 4 and 5 are parallel: the quartic vanishes, solutions form a curve."""
    leg = offset_leg(aside)
    q = angles(51, 300)
    q[:, 1] = np.pi / 2
    target = leg.reach(q)
    found, error, valid = solve_closed(closed_form(leg.chain()), target)
    assert valid.any(axis=1).all()
    samples, branches = np.nonzero(valid)
    assert miss(leg, found[samples, branches], target[samples]).max() < 2e-12
    assert error[valid].max() <= 1e-12


@pytest.mark.parametrize("leg", [offset_leg(), offset_leg(0.0), spherical_leg()])
def test_right_angles_everywhere_are_solved(leg: Leg) -> None:
    """Every coincidence of axes and planes that quarter turns can make."""
    q = np.random.default_rng(61).choice([0.0, np.pi / 2, np.pi, -np.pi / 2], (500, 6))
    target = leg.reach(q)
    found, _, valid = solve_closed(closed_form(leg.chain()), target)
    assert valid.any(axis=1).all()
    assert miss(leg, found[valid], np.repeat(target, valid.sum(axis=1), axis=0)).max() < 2e-12


def test_a_double_root_is_one_branch() -> None:
    leg = offset_leg()
    q = angles(71, 100, 1.0)
    q[:, 3] = 0.0
    found, _, valid = solve_closed(closed_form(leg.chain()), leg.reach(q))
    near = (apart(found, q[:, None]) < 1e-5) & valid
    assert (near.sum(axis=1) == 1).all()


def test_an_empty_batch_gives_no_branches() -> None:
    q, error, valid = solve_closed(closed_form(offset_leg().chain()), np.zeros((0, 4, 4)))
    assert (q.shape, error.shape, valid.shape) == ((0, 8, 6), (0, 8), (0, 8))


@pytest.mark.parametrize("leg", [offset_leg(), spherical_leg()], ids=["offset", "spherical"])
def test_out_of_reach_the_answer_is_a_least_squares_one(leg: Leg) -> None:
    """No change of the joints lessens the weighted squares, near or far."""
    chain = leg.chain()
    target = leg.reach(angles(81, 60, 1.0))
    target[:, :3, 3] += [0.02, -0.03, -0.5 * chain.length]
    q, error, valid = solve_closed(closed_form(chain), target)
    lost = ~valid.any(axis=1)
    assert lost.sum() > 50

    def squares(x: Floats) -> Floats:
        T = leg.reach(x)
        turn = Rotation.from_matrix(target[:, :3, :3] @ T[:, :3, :3].swapaxes(1, 2)).magnitude()
        gap = np.linalg.norm(T[:, :3, 3] - target[:, :3, 3], axis=1) / chain.length
        return np.asarray(turn**2 + gap**2)

    best = squares(q[:, 0])
    rng = np.random.default_rng(82)
    for scale in (3.0, 1e-1, 1e-2, 1e-3):
        for _ in range(10):
            changed = squares(q[:, 0] + scale * rng.normal(size=q[:, 0].shape))
            assert (changed >= best - 1e-5)[lost].all()
    np.testing.assert_allclose(error[lost, 0], miss(leg, q[:, 0], target)[lost], rtol=1e-9)


def test_a_target_a_little_too_far_leaves_a_straight_knee_and_its_distance() -> None:
    leg = spherical_leg()
    target = leg.reach(np.zeros((1, 6)))
    target[0, 2, 3] -= 0.01
    q, error, valid = solve_closed(closed_form(leg.chain()), target)
    assert not valid.any()
    assert error[0, 0] == pytest.approx(0.01, abs=1e-9)
    assert abs(q[0, 0, 3]) < 1e-3


def test_the_message_tells_what_the_geometry_lacks() -> None:
    leg = offset_leg()
    bent = leg.axes.copy()
    bent[3] = [0.0, np.cos(0.1), np.sin(0.1)]
    with pytest.raises(InputError, match=r"joint3, joint4 are not parallel \(5.73 deg\)") as caught:
        closed_form(replace(leg, axes=bent).chain())
    assert "joint1, joint2, joint3 do not meet in a point" in str(caught.value)
    with pytest.raises(InputError, match="it has 3 joints; six revolute joints are needed"):
        closed_form(SerialChain.of(load_robot("bioloid"), "left_arm"))


def test_parallel_axes_that_fall_together_are_no_closed_form() -> None:
    leg = offset_leg()
    points = leg.points.copy()
    points[3] = points[2]
    with pytest.raises(InputError, match="joint3, joint4 fall together"):
        closed_form(replace(leg, points=points).chain())


def test_an_arm_with_a_spherical_wrist_is_found_by_walking_it_backwards() -> None:
    chain = SerialChain.of(load_robot("bioloid24"), "left_arm")
    form = closed_form(chain)
    assert isinstance(form, ClosedForm)
    assert (form.family, form.backwards) == ("spherical hip", True)
    assert_solved(leg_of(chain), chain, angles(91, 500, 2.5))


def test_a_batch_larger_than_a_block_is_solved_like_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    leg = offset_leg()
    form, target = closed_form(leg.chain()), leg.reach(angles(101, 70))
    whole = solve_closed(form, target)
    monkeypatch.setattr(closed, "BLOCK", 16)
    for one, other in zip(solve_closed(form, target), whole, strict=True):
        np.testing.assert_array_equal(one, other)
