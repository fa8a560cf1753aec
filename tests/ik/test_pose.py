"""Whole-body positions: reachable poses are found again, and every way to fail is told by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.screws import INFINITE, Screw
from screwkin.algebra.se3 import IDENTITY, UNTURNED, Pose, Vector, exp
from screwkin.errors import (
    InputError,
    LimitError,
    ShapeError,
    SingularError,
    UnknownNameError,
    UnreachableError,
)
from screwkin.kinematics.status import Status
from screwkin.model.robot import Inertia, Joint, Limb, Link
from screwkin.model.table import load_robot
from tests.kinematics.machines import array_of, machine

FEET = ("right_foot", "left_foot")
HANDS = ("right_hand", "left_hand")


@pytest.fixture(scope="module")
def bioloid():
    return load_robot("bioloid")


def targets_at(robot, state, poses=FEET, places=HANDS):
    """Targets that the state itself fulfils."""
    wanted = {name: sk.frame_pose(robot, state, name) for name in poses}
    wanted |= {name: sk.frame_pose(robot, state, name)[..., :3, 3] for name in places}
    return wanted | {"base": state.T_world_base}


def near_home(robot, seed, count, spread=0.4):
    rng = np.random.default_rng(seed)
    q = np.array(robot.posture("home").q) + rng.uniform(-spread, spread, (count, len(robot.joints)))
    T = np.array([array_of(exp_of(rng)) for _ in range(count)])
    return sk.State(T, q)


def exp_of(rng):
    from screwkin.algebra.se3 import Twist

    return exp(Twist(Vector(*rng.uniform(-1, 1, 3)), Vector(*rng.uniform(-2, 2, 3))))


@given(seed=st.integers(0, 1000))
@settings(max_examples=8, derandomize=True)
def test_reachable_postures_are_found_again_from_home(seed):
    robot = load_robot("bioloid")
    state = near_home(robot, seed, 20)
    wanted = targets_at(robot, state)
    solution = sk.solve_pose(robot, wanted)
    assert np.isin(solution.status, [Status.CONVERGED, Status.OUT_OF_LIMITS]).all()
    assert solution.residual.max() < 1e-11
    for name in FEET:
        np.testing.assert_allclose(sk.frame_pose(robot, solution.state, name), wanted[name], atol=1e-11)
    for name in HANDS:
        found = sk.frame_pose(robot, solution.state, name)[..., :3, 3]
        np.testing.assert_allclose(found, wanted[name], atol=1e-11)
    np.testing.assert_array_equal(solution.state.T_world_base, state.T_world_base)


def test_from_a_near_guess_the_same_joint_positions_come_back_in_a_few_steps(bioloid):
    state = near_home(bioloid, 1, 50, spread=0.3)
    guess = sk.State(state.T_world_base, state.q + 0.01)
    solution = sk.solve_pose(bioloid, targets_at(bioloid, state), guess)
    assert solution.ok
    np.testing.assert_allclose(solution.state.q, state.q, atol=1e-9)
    assert solution.iterations.max() <= 5


def test_where_the_robot_stands_does_not_enter(bioloid):
    state = sk.home(bioloid)
    far = state.T_world_base.copy()
    far[:2, 3] = [50, -80]
    lowered = {name: sk.frame_pose(bioloid, state, name) for name in FEET}
    for T in lowered.values():
        T[2, 3] += 0.01
    here = sk.solve_pose(bioloid, {"base": state.T_world_base, **lowered})
    moved = {name: far @ np.linalg.inv(state.T_world_base) @ T for name, T in lowered.items()}
    there = sk.solve_pose(bioloid, {"base": far, **moved})
    assert here.ok
    assert there.ok
    np.testing.assert_allclose(there.state.q, here.state.q, atol=1e-11)


def test_limbs_without_target_keep_the_guess(bioloid):
    state = sk.home(bioloid)
    guess = sk.State(state.T_world_base, state.q + 0.05)
    solution = sk.solve_pose(bioloid, {"left_foot": sk.frame_pose(bioloid, state, "left_foot")}, guess)
    assert solution.limbs == ("left_leg",)
    others = [i for i, name in enumerate(bioloid.joint_names) if i not in range(6, 12)]
    np.testing.assert_array_equal(solution.state.q[others], guess.q[others])
    np.testing.assert_array_equal(solution.state.T_world_base, state.T_world_base)


def test_batches_of_base_targets_and_guess_broadcast(bioloid):
    state = sk.home(bioloid)
    lifted = np.tile(sk.frame_pose(bioloid, state, "right_foot"), (3, 1, 1, 1))
    lifted[:, 0, 2, 3] += [0.0, 0.01, 0.02]
    base = np.tile(state.T_world_base, (4, 1, 1))
    base[:, 0, 3] += [0.0, 0.01, 0.02, 0.03]
    hand = sk.frame_pose(bioloid, state, "left_hand")[:3, 3] + [0.0, 0.01, 0.01]
    solution = sk.solve_pose(bioloid, {"base": base, "right_foot": lifted, "left_hand": hand})
    assert solution.state.q.shape == (3, 4, 18)
    assert solution.state.T_world_base.shape == (3, 4, 4, 4)
    assert solution.status.shape == solution.residual.shape == (3, 4, 2)
    assert solution.ok
    found = sk.frame_pose(bioloid, solution.state, "right_foot")
    np.testing.assert_allclose(found, np.broadcast_to(lifted, (3, 4, 4, 4)), atol=1e-11)


def test_an_unreachable_foot_names_limb_sample_and_distance(bioloid):
    """The foot is pulled straight down below a leg of 0.18625 m: the missing length is known."""
    state = sk.home(bioloid)
    foot = np.tile(sk.frame_pose(bioloid, state, "left_foot"), (5, 1, 1))
    foot[3, 2, 3] -= 0.030
    solution = sk.solve_pose(bioloid, {"left_foot": foot}, state)
    assert list(solution.status[:, 0] == Status.UNREACHABLE) == [False, False, False, True, False]
    missing = 0.170 + 0.030 - (0.0773829 + 0.0780929 + 0.030779)
    assert solution.distance[3, 0] == pytest.approx(missing, rel=1e-3)
    assert solution.angle[3, 0] < 1e-3
    with pytest.raises(UnreachableError, match=r"left_leg, sample 3: out of reach by 13\.7 mm") as caught:
        solution.raise_on_failure(bioloid)
    assert (caught.value.limb, caught.value.sample) == ("left_leg", 3)
    assert caught.value.distance == pytest.approx(missing, rel=1e-3)
    with pytest.raises(UnreachableError, match=r"left_leg, sample 3 \(t = 0\.060 s\)"):
        solution.raise_on_failure(bioloid, 0.02 * np.arange(5))


def test_a_hand_out_of_reach_ends_at_its_nearest_point(bioloid):
    state = sk.home(bioloid)
    shoulder = sk.frame_pose(bioloid, state, "base")[:3, 3] + [0, 0.064646, 0.121451]
    away = np.array([0.6, 0.0, 0.8])
    solution = sk.solve_pose(bioloid, {"left_hand": shoulder + 0.2 * away}, state)
    assert solution.status == Status.UNREACHABLE
    assert solution.distance == pytest.approx(0.2 - 0.12109, abs=1e-6)
    hand = sk.frame_pose(bioloid, solution.state, "left_hand")[:3, 3]
    np.testing.assert_allclose(hand, shoulder + 0.12109 * away, atol=1e-3)


def test_a_straight_knee_is_reached_but_told_to_be_singular(bioloid):
    straight = sk.State(np.eye(4), np.zeros(18))
    wanted = {name: sk.frame_pose(bioloid, straight, name) for name in FEET}
    solution = sk.solve_pose(bioloid, {"base": np.eye(4), **wanted}, sk.home(bioloid))
    assert (solution.status == Status.SINGULAR).all()
    assert solution.residual.max() < 1e-10
    with pytest.raises(SingularError, match=r"right_leg, sample 0: singular; the limb has lost a direction"):
        solution.raise_on_failure(bioloid)


def test_even_a_straight_guess_leads_to_a_bent_posture(bioloid):
    """At q = 0 the Jacobian is singular: damped steps leave it."""
    state = sk.home(bioloid)
    straight = sk.State(state.T_world_base, np.full(18, 1e-3))
    solution = sk.solve_pose(bioloid, {n: sk.frame_pose(bioloid, state, n) for n in FEET}, straight)
    assert np.isin(solution.status, [Status.CONVERGED, Status.OUT_OF_LIMITS]).all()
    assert solution.residual.max() < 1e-10


def limited(robot, name, lower, upper):
    joints = tuple(replace(j, lower=lower, upper=upper) if j.name == name else j for j in robot.joints)
    i = robot.joint_names.index(name)
    postures = tuple(posture for posture in robot.postures if lower <= posture.q[i] <= upper)
    return replace(robot, joints=joints, postures=postures)


def test_a_joint_beyond_its_limits_is_named_with_position_and_limits(bioloid):
    robot = limited(bioloid, "right_knee", 0.0, 0.5)
    state = sk.home(bioloid)
    solution = sk.solve_pose(robot, {n: sk.frame_pose(bioloid, state, n) for n in FEET}, state)
    assert list(solution.status) == [Status.OUT_OF_LIMITS, Status.CONVERGED]
    knee = np.degrees(state.q[bioloid.joint_names.index("right_knee")])
    with pytest.raises(LimitError, match=rf"right_knee at {knee:.1f} deg, limits 0.0 to 28.6 deg") as caught:
        solution.raise_on_failure(robot)
    assert (caught.value.limb, caught.value.sample) == ("right_leg", 0)


def test_limits_of_a_slider_are_told_in_millimetres():
    slider = Joint(
        "slider",
        "base",
        "sled",
        "prismatic",
        Screw(Vector(1, 0, 0), Vector(0, 0, 0), INFINITE),
        0.0,
        0.1,
        1.0,
        1.0,
    )
    robot = rail([slider])
    solution = sk.solve_pose(robot, {"hand": [0.25, 0, 0]})
    assert solution.status == Status.OUT_OF_LIMITS
    with pytest.raises(LimitError, match=r"slider at 250.0 mm, limits 0.0 to 100.0 mm"):
        solution.raise_on_failure(robot)


def rail(joints, tip=(0.0, 0.0, 0.0)):
    links = [Link(name, 0, Vector(0, 0, 0), Inertia(0, 0, 0), IDENTITY) for name in ("base", "sled")]
    limb = Limb(
        "arm", "arm", "sled", "hand", Pose(UNTURNED, Vector(*tip)), ("px", "py", "pz", "rx", "ry", "rz")
    )
    return machine(links, joints, limbs=(limb,), home=np.zeros(len(joints)))


def test_whole_turns_are_taken_back_for_hinges_only():
    """A helical joint advances with every turn: 2 pi more is another place."""
    thread = Joint(
        "thread",
        "base",
        "sled",
        "helical",
        Screw(Vector(0, 0, 1), Vector(0, 0, 0), 0.01),
        -99.0,
        99.0,
        1.0,
        1.0,
    )
    robot = rail([thread])
    solution = sk.solve_pose(robot, {"hand": [0.0, 0.0, 0.2]})
    assert solution.status == Status.CONVERGED
    assert solution.state.q[0] == pytest.approx(20.0)


def test_a_hinge_comes_back_near_its_guess_or_within_its_limits():
    hinge = Joint(
        "hinge", "base", "sled", "revolute", Screw(Vector(0, 0, 1), Vector(0, 0, 0)), -8.0, 8.0, 1.0, 1.0
    )
    robot = rail([hinge], tip=(0.5, 0.0, 0.0))
    target = np.array([0.5 * np.cos(0.6), 0.5 * np.sin(0.6), 0.0])
    guess = sk.State(np.eye(4), np.array([2 * np.pi + 0.2]))
    assert sk.solve_pose(robot, {"hand": target}, guess).state.q[0] == pytest.approx(2 * np.pi + 0.6)
    narrow = limited(robot, "hinge", -1.0, 1.0)
    solution = sk.solve_pose(narrow, {"hand": target}, guess)
    assert solution.state.q[0] == pytest.approx(0.6)
    assert solution.ok


@pytest.fixture(scope="module")
def turning_torso(bioloid):
    """The torso turns on the pelvis about a waist yaw that both arms share."""
    yaw = Joint(
        "waist_yaw",
        "pelvis",
        "torso",
        "revolute",
        Screw(Vector(0, 0, 1), Vector(0, 0, 0)),
        -2.0,
        2.0,
        6.0,
        1.5,
    )
    pelvis = Link("pelvis", 0.1, Vector(0, 0, 0), Inertia(1e-4, 1e-4, 1e-4), IDENTITY)
    joints = [replace(j, parent="pelvis") if "hip_yaw" in j.name else j for j in bioloid.joints]
    home = (*bioloid.posture("home").q, 0.0)
    posture = replace(bioloid.posture("home"), q=home)
    links, joints = (pelvis, *bioloid.links), [*joints, yaw]
    return replace(bioloid, base_link="pelvis", links=links, joints=tuple(joints), postures=(posture,))


def test_a_joint_that_two_limbs_share_is_solved_for_both_at_once(turning_torso):
    robot = turning_torso
    state = sk.home(robot)
    state.q[-1] = 0.3
    wanted = {name: sk.frame_pose(robot, state, name)[:3, 3] for name in HANDS}
    wanted |= {name: sk.frame_pose(robot, state, name) for name in FEET}
    solution = sk.solve_pose(robot, wanted)
    assert solution.ok
    for name in HANDS:
        np.testing.assert_allclose(
            sk.frame_pose(robot, solution.state, name)[:3, 3], wanted[name], atol=1e-11
        )
    arms = [solution.limbs.index(name) for name in ("right_arm", "left_arm")]
    assert len(set(solution.iterations[arms])) == 1, "one system"


def test_the_mechanism_of_a_shared_joint_has_one_block_for_both_arms(turning_torso):
    """Seven real joints and two monitored hands close two circuits: the shared yaw is one freedom more."""
    mechanism = sk.closed_mechanism(turning_torso)
    assert mechanism.mobility == 6 + 19
    assert len(mechanism.circuits) == 4
    N = sk.network_matrix(mechanism, sk.home(turning_torso))
    rates = np.random.default_rng(1).uniform(-1, 1, 25)
    full = np.empty(len(mechanism.couplings))
    full[mechanism.primary_columns] = rates
    full[mechanism.secondary_columns] = sk.secondary_rates(mechanism, sk.home(turning_torso), rates)
    assert np.abs(N @ full).max() < 1e-12


@pytest.mark.parametrize(
    ("targets", "error", "message"),
    [
        ({"tail": np.eye(4)}, UnknownNameError, "unknown target 'tail'; valid: base, right_foot, left_foot"),
        ({"torso": np.eye(4)}, UnknownNameError, "unknown target 'torso'"),
        ({"right_foot": np.zeros((5, 4))}, ShapeError, r"has shape \(5, 4\), expected \(..., 3\)"),
        ({"base": np.zeros(3), "right_foot": np.eye(4)}, ShapeError, r"expected \(..., 4, 4\)"),
        ({"right_foot": np.full((4, 4), np.nan)}, ShapeError, "NaN or infinity"),
        ({"right_foot": "there"}, ShapeError, "is not an array of numbers"),
        ({"base": np.eye(4)}, InputError, "no targets; name at least one tip, such as right_foot, left_foot"),
        ({"right_foot": np.zeros((2, 4, 4)) + np.eye(4), "left_foot": np.zeros((3, 4, 4)) + np.eye(4)},
         ShapeError, "do not broadcast"),
    ],
)  # fmt: skip
def test_wrong_targets_are_refused_before_anything_is_computed(bioloid, targets, error, message):
    with pytest.raises(error, match=message):
        sk.solve_pose(bioloid, targets)


def test_an_unknown_method_is_refused(bioloid):
    with pytest.raises(InputError, match="unknown method 'magic'; valid: auto, newton"):
        sk.solve_pose(bioloid, {"right_foot": np.eye(4)}, method="magic")


def test_a_point_of_a_four_bars_coupler_is_led():
    """The crank leads, pin and rocker follow: positions are those of close_loops."""
    robot = load_robot("linkages/four-bar")
    frame = Pose(UNTURNED, Vector(0.1, 0, 0))
    tipped = replace(robot, limbs=(Limb("arm", "arm", "coupler", "point", frame, ("px", "py", "rz")),))
    home = sk.home(robot)
    closed = sk.close_loops(
        sk.closed_mechanism(robot), home, {"crank": home.q[0] + np.linspace(-0.2, 0.2, 5)}
    )
    target = sk.frame_pose(tipped, closed.state, "point")[:, :3, 3]
    solved = sk.solve_pose(tipped, {"point": target}, home)
    assert solved.ok
    np.testing.assert_allclose(solved.state.q, closed.state.q, atol=1e-7)
    assert not sk.solve_pose(tipped, {"point": [0.4, 0.0, 0.0]}).ok
