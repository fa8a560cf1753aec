"""Closures with the floor and between hands: what stays where it is held, by the poses of links alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import screwkin as sk
from screwkin.algebra.se3 import as_array, pose_from_array
from screwkin.dynamics.contact_forces import ContactForces
from screwkin.errors import InputError, TableError, UnreachableError
from screwkin.gait.held import with_held_joints
from screwkin.kinematics.status import Status
from screwkin.mechanism.action_choice import action_choice
from screwkin.mechanism.holds import on_floor
from screwkin.mechanism.linkages import linkages, motor_joints
from screwkin.model.records import FLOOR, Closure
from screwkin.model.toml_out import robot_toml
from tests.held import FEET_TEXT, holding, on_both_feet, with_closures

FEET, HANDS = ("right_foot", "left_foot"), ("right_hand", "left_hand")
AXES = ("px", "py", "pz", "rx", "ry", "rz")
seeds = st.integers(0, 2**32 - 1)


def test_both_feet_on_the_floor_leave_twelve_freedoms() -> None:
    """The waist's six and three of every hand: 6 + 18 less six of every foot."""
    mechanism = sk.closed_mechanism(on_both_feet())
    assert (mechanism.mobility, mechanism.kutzbach) == (12, 12)
    assert [name for name in mechanism.primary if name.startswith("waist.")] == [
        f"waist.{c}" for c in ("px", "py", "pz", "rx", "ry", "rz")
    ]
    assert not [name for name in mechanism.primary if name.startswith(FEET)]
    assert on_floor(on_both_feet()) == FEET
    assert sk.closed_mechanism(holding()).mobility == 24


def test_all_joints_of_limbs_whose_tips_are_held_have_motors() -> None:
    for robot in (on_both_feet(), holding()):
        assert linkages(robot) == ()
        assert motor_joints(robot) == robot.joint_names


def test_closures_with_the_floor_come_back_from_text() -> None:
    robot = on_both_feet()
    again = sk.robot_from_text(robot_toml(robot))
    assert [(c.name, c.link_a, c.link_b) for c in again.closures] == [
        ("right_sole", "right_foot_link", FLOOR),
        ("left_sole", "left_foot_link", FLOOR),
    ]
    for one, other in zip(again.closures, robot.closures, strict=True):
        for key in ("frame_a", "frame_b"):
            np.testing.assert_allclose(as_array(getattr(one, key)), as_array(getattr(other, key)), atol=1e-15)


def test_what_the_floor_cannot_be_is_named() -> None:
    with pytest.raises(TableError, match=r"no link 'flor'. Did you mean 'floor'"):
        with_closures("bioloid", FEET_TEXT.replace('"floor"', '"flor"'))
    four_bar = sk.load_robot("linkages/four-bar")
    on_ground = four_bar.text.replace('link_b = "rocker"', 'link_b = "floor"')
    with pytest.raises(TableError, match=r"link_b: is the floor, to which the base is fixed. Write 'ground'"):
        sk.robot_from_text(on_ground)
    with pytest.raises(TableError, match="link 'floor' has the name of what robots stand on"):
        sk.robot_from_text(four_bar.text.replace('"coupler"', '"floor"'))
    with pytest.raises(InputError, match="closure right_sole is open by 10 mm and 0 deg"):
        sk.closed_mechanism(with_closures("bioloid", FEET_TEXT.replace('"-hip_y", 0]', '"-hip_y", "10*mm"]')))


@given(seeds)
@settings(max_examples=2)
def test_feet_stay_wherever_the_waist_goes(seed: int) -> None:
    """Newton through N, and closed forms limb by limb, agree; the feet stand where they stood."""
    robot = on_both_feet()
    home, mechanism = sk.home(robot), sk.closed_mechanism(robot)
    here = sk.close_loops(mechanism, home, {}).coordinates
    move = np.random.default_rng(seed).uniform(-1, 1, (6, 20)) * [
        [x] for x in (0.01, 0.01, 0.008, 0.03, 0.03, 0.05)
    ]
    move[2] -= 0.008  # downwards: at home the knees are nearly straight
    imposed = {
        f"{chain}.{c}": here[mechanism.position[f"{chain}.{c}"]] + x
        for chain, axes in (("waist", AXES), *((tip, AXES[:3]) for tip in HANDS))
        for c, x in zip(axes, move, strict=False)
    }
    closed = sk.close_loops(mechanism, home, imposed)
    assert not closed.status.any()
    hand = {tip: sk.frame_pose(robot, closed.state, tip)[:, :3, 3] for tip in HANDS}
    solved = sk.solve_pose(robot, {"base": closed.state.T_world_base, **hand})
    assert set(solved.limbs) == {limb.name for limb in robot.limbs}
    assert solved.ok
    np.testing.assert_allclose(solved.state.q, closed.state.q, atol=1e-8)
    for state in (closed.state, solved.state):
        for foot in FEET:
            stood = np.broadcast_to(sk.frame_pose(robot, home, foot), (20, 4, 4))
            np.testing.assert_allclose(sk.frame_pose(robot, state, foot), stood, atol=1e-9)


def test_a_foot_that_is_held_does_not_go_elsewhere() -> None:
    robot = on_both_feet()
    target = sk.frame_pose(robot, sk.home(robot), "left_foot")
    lifted = np.stack([target, target])
    lifted[1, 2, 3] += 0.01
    solved = sk.solve_pose(robot, {"left_foot": lifted})
    row = solved.limbs.index("left_leg")
    assert solved.status[:, row].tolist() == [Status.CONVERGED, Status.UNREACHABLE]
    with pytest.raises(UnreachableError, match="left_leg, sample 1: out of reach by 10 mm"):
        solved.raise_on_failure(robot)


def test_a_shin_on_the_floor_is_left_to_close_loops() -> None:
    """A link that ends no limb: the mechanism knows it, the limbs do not."""
    robot = sk.load_robot("bioloid")
    calf = next(link for link in robot.links if link.name == "right_calf").frame
    home = sk.home(robot)
    at = sk.frame_pose(robot, home, "right_calf")
    closure = Closure("kneeling", "right_calf", calf, FLOOR, pose_from_array(at))
    kneeling = replace(robot, closures=(closure,), text="")
    assert sk.closed_mechanism(kneeling).mobility == 18
    with pytest.raises(
        InputError, match=r"\(kneeling\) that hold links on the floor which end no limb; close_loops"
    ):
        sk.solve_pose(kneeling, {"left_foot": sk.frame_pose(robot, home, "left_foot")})


def test_the_floor_carries_the_weight_and_six_internal_freedoms_are_named() -> None:
    robot = on_both_feet()
    home, mechanism = sk.home(robot), sk.closed_mechanism(robot)
    forces = sk.static_forces(mechanism, home, weights=True)
    assert forces.system.contacts == ("right_sole", "left_sole")
    choice = action_choice(mechanism, None, forces.system.active, forces.system.contacts)
    assert choice.degree == 6
    assert choice.primary == tuple(f"left_sole.{c}" for c in ("mx", "my", "mz", "fx", "fy", "fz"))
    lifted = sum(forces.wrench(name)[5] for name in forces.system.contacts)
    assert lifted == pytest.approx(16.677, abs=1e-9)
    free = sk.load_robot("bioloid")
    alike = sk.static_forces(sk.closed_mechanism(free), sk.home(free), contacts=FEET, weights=True)
    for closure, foot in zip(forces.system.contacts, FEET, strict=True):
        np.testing.assert_allclose(forces.wrench(closure), alike.wrench(foot), atol=1e-9)


def test_contact_forces_are_those_of_a_robot_that_stands() -> None:
    robot, rest = on_both_feet(), np.zeros(18)
    free = sk.load_robot("bioloid")
    held: ContactForces = sk.contact_forces(robot, sk.home(robot), rest, rest)
    stands = sk.contact_forces(free, sk.home(free), rest, rest)
    np.testing.assert_array_equal(held.wrenches, stands.wrenches)
    np.testing.assert_array_equal(held.efforts, stands.efforts)
    with pytest.raises(InputError, match="closures hold left_foot of bioloid on the floor"):
        sk.contact_forces(robot, sk.home(robot), rest, rest, contacts=["right_foot"])


@pytest.mark.parametrize("name", ["mass_matrix", "inverse_dynamics", "forward_dynamics"])
def test_dynamics_of_a_free_body_refuse_a_held_one(name: str) -> None:
    robot, rest = on_both_feet(), np.zeros(18)
    call, more = getattr(sk, name), [] if name == "mass_matrix" else [rest, rest]
    with pytest.raises(InputError, match=rf"\(right_sole, left_sole\).*{name} sees it free.*contact_forces"):
        call(robot, sk.home(robot), *more)


def test_held_arms_leave_the_closures_of_the_feet() -> None:
    robot = on_both_feet()
    home = dict(zip(robot.joint_names, sk.home(robot).q.tolist(), strict=True))
    arms = {name: x for name, x in home.items() if "shoulder" in name or "elbow" in name}
    still = with_held_joints(robot, arms)
    still = replace(still, limbs=tuple(limb for limb in still.limbs if limb.kind == "leg"))
    assert sk.closed_mechanism(still).mobility == 6


@given(seeds)
@settings(max_examples=2)
def test_one_hand_takes_the_other_along(seed: int) -> None:
    robot = holding()
    home, rng = sk.home(robot), np.random.default_rng(seed)
    target = np.tile(sk.frame_pose(robot, home, "right_hand"), (20, 1, 1))
    target[:, :3, 3] += rng.uniform(-0.01, 0.01, (20, 3))
    turns = Rotation.from_rotvec(rng.uniform(-0.1, 0.1, (20, 3))).as_matrix()
    target[:, :3, :3] = turns @ target[:, :3, :3]
    solved = sk.solve_pose(robot, {"right_hand": target})
    assert solved.limbs == ("right_arm", "left_arm")
    both = (solved.status == Status.CONVERGED).all(axis=1)
    assert both.sum() > 5
    right, left = (sk.frame_pose(robot, solved.state, tip) for tip in HANDS)
    before = np.linalg.solve(*(sk.frame_pose(robot, home, tip) for tip in HANDS))
    between = np.linalg.solve(right[both], left[both])
    np.testing.assert_allclose(between, np.broadcast_to(before, between.shape), atol=1e-9)
    np.testing.assert_allclose(right[both], target[both], atol=1e-9)


def test_hands_that_are_held_together_do_not_part() -> None:
    robot = holding()
    targets = {tip: sk.frame_pose(robot, sk.home(robot), tip).copy() for tip in HANDS}
    targets["left_hand"][1, 3] += 0.004
    assert not sk.solve_pose(robot, targets).ok
    assert sk.solve_pose(
        robot, {**targets, "left_hand": sk.frame_pose(robot, sk.home(robot), "left_hand")}
    ).ok
    with pytest.raises(InputError, match=r"closure object holds right_hand to left_hand, .* give a pose"):
        sk.solve_pose(robot, {"right_hand": targets["right_hand"][:3, 3]})
    base = np.linalg.inv(sk.home(robot).T_world_base)
    with pytest.raises(InputError, match=r"a closure holds right_hand to left_hand, .* use solve_pose"):
        sk.limb_ik(robot, "left_arm", base @ targets["right_hand"])
    apart = sk.State(sk.home(robot).T_world_base, sk.home(robot).q + 0.01)
    foot = sk.frame_pose(robot, sk.home(robot), "right_foot")
    assert not sk.solve_pose(robot, {"right_foot": foot}, apart).ok


def test_a_walk_carries_what_both_hands_hold() -> None:
    """The arms rest, so that the object goes with the torso."""
    robot = holding()
    walk = sk.walk(robot, sk.load_gait("walk"), steps=2)
    notes = "; ".join(walk.meta["notes"])
    assert "right_arm rests: a closure holds right_hand to left_hand" in notes
    state = sk.State(walk.T_world_base, walk.q)
    right, left = (sk.frame_pose(robot, state, tip) for tip in HANDS)
    between = np.linalg.solve(right, left)
    np.testing.assert_allclose(between, np.broadcast_to(between[0], between.shape), atol=1e-12)
    assert walk.margin.min() > 0


def test_robots_that_cannot_walk_say_what_holds_them() -> None:
    gait = sk.load_gait("walk")
    with pytest.raises(InputError, match=r"\(right_sole, left_sole\) that hold it on the floor.*solve_pose"):
        sk.walk(on_both_feet(), gait, 1)
    robot = sk.load_robot("bioloid")
    frame = robot.limb("right_leg").frame
    tied = replace(
        robot, closures=(Closure("feet", "right_foot_link", frame, "left_foot_link", frame),), text=""
    )
    with pytest.raises(
        InputError, match="a closure holds right_foot to left_foot, and a walk leads every foot"
    ):
        sk.walk(tied, gait, 1)
