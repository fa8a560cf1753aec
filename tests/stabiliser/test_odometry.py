"""Where feet stand, by joints and heading, against forward kinematics; and steps that lead back to a plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import Z, as_array, rotate
from screwkin.model.robot import Robot
from screwkin.stabiliser.odometry import BACK, SHARE, Whereabouts, back_to_plan, joined_place, seen_from
from screwkin.stabiliser.walk import Felt, StabilisedWalk, stabilised

FEET = ("left_foot", "right_foot")
places = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0)).map(np.array)
steps = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.3, 0.3)).map(np.array)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


@given(origin=places, step=steps)
def test_a_place_seen_from_another_is_the_step_to_it(origin: np.ndarray, step: np.ndarray) -> None:
    """Against homogeneous matrices."""
    place = joined_place(origin, step)
    np.testing.assert_allclose(seen_from(place, origin), step, atol=1e-12)
    a, b, c = (
        np.block([[as_array(rotate(Z, x[2]))[:2, :2], x[:2, None]], [0, 0, 1]]) for x in (origin, step, place)
    )
    np.testing.assert_allclose(a @ b, c, atol=1e-12)


@given(start=places, plan=st.lists(steps, min_size=8, max_size=8), off=steps)
def test_steps_come_back_to_the_planned_footholds(
    start: np.ndarray, plan: list[np.ndarray], off: np.ndarray
) -> None:
    """From the plan they are the plan's; from beside it, each within its bound, nearer by half."""
    footholds = [start]
    for step in plan:
        footholds.append(joined_place(footholds[-1], step))
    goals = np.array(footholds[1:])
    np.testing.assert_allclose(back_to_plan(start, goals, np.array(plan)), plan, atol=1e-12)
    strayed = joined_place(start, 0.1 * off)
    back = back_to_plan(strayed, goals, np.array(plan))
    assert (np.abs(back - plan) <= BACK + 1e-12).all()
    place, turns = strayed, [0.1 * off[2]]
    for step, goal in zip(back, goals, strict=True):
        place = joined_place(place, step)
        turns.append(place[2] - goal[2])
    np.testing.assert_allclose(turns, 0.1 * off[2] * SHARE ** np.arange(9), atol=1e-12)
    far = np.linalg.norm(place[:2] - goals[-1][:2])
    longest = np.abs(plan)[:, :2].sum(axis=1).max()
    most = 0.2 * np.linalg.norm(0.1 * off[:2]) + 0.1 * np.abs(off[2]) * longest
    assert far <= most + 1e-12


def test_no_steps_are_none() -> None:
    assert back_to_plan(np.zeros(3), np.zeros((0, 3)), np.zeros((0, 3))).shape == (0, 3)


@settings(max_examples=25)
@given(
    north=st.floats(-3.0, 3.0),
    at=places,
    turned=st.floats(-0.15, 0.15),
    slipped=st.tuples(st.floats(-0.015, 0.015), st.floats(-0.015, 0.015)),  # with the turn, what is believed
    seed=st.integers(0, 99),
)
def test_a_landed_foot_is_where_kinematics_has_it(
    robot: Robot, north: float, at: np.ndarray, turned: float, slipped: tuple[float, float], seed: int
) -> None:
    """A standing foot that twisted by an angle, the other beside its command: any IMU sees it anywhere."""
    rng = np.random.default_rng(seed)
    q = np.array(sk.home(robot).q) + rng.uniform(-0.05, 0.05, 18)
    start = Whereabouts(np.array([*at[:2], 0.0]), np.zeros(3))
    right, left = (np.asarray(sk.frame_pose(robot, sk.State(np.eye(4), q), tip)) for tip in FEET[::-1])
    yaw = np.arctan2(right[1, 0], right[0, 0])
    attitude = as_array(rotate(Z, north - yaw))  # at rest the right foot heads ahead
    feet = start.oriented(robot, attitude, q, FEET[1])
    assert feet.north == pytest.approx((north + np.pi) % (2 * np.pi) - np.pi, abs=1e-9)
    twist = as_array(rotate(Z, turned))
    between = twist @ as_array(rotate(Z, -yaw)) @ (left[:3, 3] - right[:3, 3])
    heads = turned - yaw + np.arctan2(left[1, 0], left[0, 0])
    truth = np.array([at[0] + between[0], at[1] + between[1], heads])
    commanded = truth + np.array([*slipped, 0.0])
    feet = replace(feet, stance=commanded, other=feet.stance)
    seen = feet.measured(robot, as_array(rotate(Z, turned)) @ attitude, q, FEET)
    np.testing.assert_allclose(seen.stance, truth, atol=1e-9)


def test_a_foot_is_believed_to_lie_a_hand_s_breadth_beside_its_command_at_most(robot: Robot) -> None:
    """However far the joints say it is; and a robot that was turned half round knows it."""
    q = np.array(sk.home(robot).q)
    feet = Whereabouts(np.array([1.0, 0.0, 0.0]), np.zeros(3), 0.0)
    seen = feet.measured(robot, np.eye(3), q, FEET)
    np.testing.assert_allclose(seen.stance, [0.97, 0.03, 0.0], atol=1e-9)
    turned = feet.measured(robot, as_array(rotate(Z, np.pi - 0.1)), q, FEET)
    assert turned.stance[2] == pytest.approx(np.pi - 0.1)


def test_what_is_no_number_is_not_believed(robot: Robot) -> None:
    q, feet = np.array(sk.home(robot).q), Whereabouts(np.array([1.0, 0.0, 0.0]), np.zeros(3), 0.0)
    for attitude, joints in ((np.full((3, 3), np.nan), q), (np.eye(3), np.nan * q)):
        assert (feet.measured(robot, attitude, joints, FEET).stance == feet.stance).all()
    blind = replace(feet, north=None)
    assert blind.measured(robot, np.eye(3), q, FEET) is blind
    assert blind.oriented(robot, np.full((3, 3), np.nan), q, FEET[0]).north is None


@pytest.fixture(scope="module")
def walk(robot: Robot) -> StabilisedWalk:
    gait = sk.load_gait("preview").replace(Tc=0.4, stride=0.08, lift=0.012, lead=0.6, horizon=1.0)
    return stabilised(robot, sk.walk(robot, gait, steps=4))


def test_a_robot_that_twists_on_its_feet_walks_on_in_the_plan_s_direction(walk: StabilisedWalk) -> None:
    """Joints that follow, on a floor that turns below: the commanded feet turn against it."""
    course, turn, landed = walk.start, 0.0, 0
    for _ in range(len(walk.heights)):
        if course.landed > landed:
            landed, turn = course.landed, turn + 0.03
        attitude = as_array(rotate(Z, 0.7 + turn))
        course = walk.advanced(course, Felt(attitude, course.q, np.ones(2), np.zeros((2, 2))))
    assert course.landed == len(walk.steps)
    heading = course.memory[6] + turn  # of the last foot: what is commanded, and how far the floor turned it
    assert abs(heading) < 0.065 < turn
