"""A stabilised walk: its kinematics against the library's, and symmetry."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.algebra.se3 import Pose, Rotation, Vector, X, Y, as_array, pose_from_array, rotate
from screwkin.compiler.run import run
from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.sim.feedback import WalkController
from screwkin.stabiliser import pairs as pairs
from screwkin.stabiliser.cycle import STARTING, STEPPING, STOPPING, Memory
from screwkin.stabiliser.rhythm import CYCLE
from screwkin.stabiliser.walk import (
    Felt,
    StabilisedState,
    StabilisedWalk,
    cycle_in_a_step,
    stabilised,
    stabiliser_of,
)
from screwkin.trajectory import Trajectory

States = list[StabilisedState]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return sk.load_robot("bioloid")


def planned(robot: Robot, steps: int = 4, **changes: object) -> Trajectory:
    usual = {"Tc": 0.4, "stride": 0.08, "lift": 0.012, "lead": 0.6, "horizon": 1.0}
    gait = sk.load_gait("preview").replace(**usual | changes)
    return sk.walk(robot, gait, steps=steps)


@pytest.fixture(scope="module")
def plan(robot: Robot) -> Trajectory:
    return planned(robot)


@pytest.fixture(scope="module")
def walk(robot: Robot, plan: Trajectory) -> StabilisedWalk:
    return stabilised(robot, plan)


def level(q: np.ndarray) -> Felt:
    return Felt(np.eye(3), q, np.ones(2), np.zeros((2, 2)))


def walked(walk: StabilisedWalk, cycles: int) -> list[StabilisedState]:
    """Open loop."""
    courses = [walk.start]
    for _ in range(cycles):
        courses.append(walk.advanced(courses[-1], level(courses[-1].q), feedback=False))
    return courses


@pytest.fixture(scope="module")
def courses(walk: StabilisedWalk) -> list[StabilisedState]:
    return walked(walk, len(walk.heights) + 40)


def memory(course: StabilisedState) -> Memory:
    return pairs.of_row(Memory, course.memory.tolist())


def test_the_plan_s_own_rhythm_and_steps_are_read_off_it(walk: StabilisedWalk) -> None:
    rhythm = walk.rhythm
    assert rhythm.period == pytest.approx(0.4)
    assert rhythm.lift == pytest.approx(0.012, abs=5e-4)
    assert rhythm.apart == pytest.approx(0.042165)
    assert rhythm.half == pytest.approx((0.052, 0.033))
    np.testing.assert_allclose(walk.steps[:-1], [[0.04, 0.0, 0.0]] * 3, atol=1e-9)
    np.testing.assert_allclose(walk.steps[-1], 0.0, atol=1e-9)
    assert 0.5 < walk.body.share < 1.0


def test_open_loop_it_takes_the_planned_steps_and_comes_to_rest_between_the_feet(
    walk: StabilisedWalk, plan: Trajectory, courses: States
) -> None:
    modes = [memory(course).mode for course in courses]
    assert [m for m, n in itertools.pairwise(modes) if m != n] == [STARTING, STEPPING]
    last = memory(courses[-1])
    assert last.mode == STOPPING
    assert courses[-1].landed == len(walk.steps)
    feet = {last.side: last.stance, -last.side: last.other}
    for side, tip in zip((-1.0, 1.0), walk.body.tips, strict=True):
        np.testing.assert_allclose(feet[side][:2], plan.T_world_tip[tip][-1, :2, 3], atol=1e-6)
    assert math.hypot(*last.rate) < 2e-3
    assert last.com[0] == pytest.approx(plan.com[-1, 0], abs=2e-3)
    assert abs(last.com[1]) < 2e-3


def test_in_single_support_the_zmp_is_on_the_sole_that_stands(walk: StabilisedWalk, courses: States) -> None:
    """Whatever foot is off the floor, by the library's own forward kinematics."""
    swung = 0
    for course in courses:
        now = memory(course)
        state = sk.State(np.eye(4), course.q)
        heights = [sk.frame_pose(walk.body.robot, state, tip)[2, 3] for tip in walk.body.tips]
        if abs(heights[0] - heights[1]) > 1e-4:
            swung += 1
            assert np.argmin(heights) == (now.side > 0)
            off = np.abs(np.subtract(now.zmp, now.stance[:2])) - walk.rhythm.half
            assert off.max() < -0.4 * 0.033
    assert swung > 80


def test_its_phase_is_that_of_the_plan(robot: Robot, walk: StabilisedWalk, courses: States) -> None:
    """Open loop it is as far as time is; the CoM is where the plan has it, and its period is the gait's."""
    plan = planned(robot, Tc=0.35)
    quick = stabilised(robot, plan)
    assert quick.rhythm.period == pytest.approx(0.35, abs=2e-3)
    end = len(walk.heights)
    assert all(abs(walk.phase(course) - k) <= 2 for k, course in enumerate(courses[:end]))
    steps = [c for c in walked(quick, len(quick.heights)) if memory(c).mode == STEPPING and c.landed < 3]
    for course in steps[::10]:
        com = np.array([np.interp(course.time, plan.time, x) for x in plan.com[:, :2].T])
        np.testing.assert_allclose(memory(course).com, com, atol=0.012)


def test_a_slow_walk_of_a_tall_robot_stays_with_its_plan() -> None:
    """Open loop, in steps of six time constants: what the reference lacked would grow by hundreds in each."""
    tall = sk.load_robot("poppy12")
    plan = sk.walk(tall, sk.load_gait("poppy12-preview"), steps=4)
    walk = stabilised(tall, plan)
    assert walk.rhythm.period * walk.rhythm.w > 6.0
    walking = [c for c in walked(walk, len(walk.heights) - 1) if c.landed < len(walk.steps) - 1]
    for course in walking[::10]:
        com = [np.interp(course.time, plan.time, x) for x in plan.com[:, :2].T]
        np.testing.assert_allclose(memory(course).com, com, atol=0.15 * walk.rhythm.apart)


def test_commands_allow_for_servos_as_those_of_the_plan(
    robot: Robot, plan: Trajectory, walk: StabilisedWalk, courses: States
) -> None:
    """Beside commands that differ from the plan by known angles, the walk's differ by them from the start."""
    bend = 0.1 * np.sin(np.outer(plan.time, 1.0 + np.arange(18)))
    sent = WalkController(
        walk, False, replace(plan, q=plan.q + bend, qd=plan.qd + np.gradient(bend, plan.time, axis=0))
    )
    plain = WalkController(walk, False)
    assert sent.reset() == pytest.approx(plain.reset() + bend[0])
    for course in courses[:150]:
        felt = level(course.q)
        added = sent.answer(felt) - plain.answer(felt)
        k = walk.phase(sent.course)
        expected = [np.interp(k * CYCLE, plan.time, x) for x in bend.T]
        np.testing.assert_allclose(added, expected, atol=2e-3)


def test_what_lasts_and_what_is_small_is_left_alone(walk: StabilisedWalk, courses: States) -> None:
    """Errors of the DCM within the dead zone move no pendulum; a lean that lasts is noted as such."""
    k = next(k for k, course in enumerate(courses) if course.landed == 1 and memory(course).tau > 0.15)
    small = replace(level(courses[k].q), attitude=as_array(rotate(X, 0.01)))
    one, other = walk.advanced(courses[k], small), walk.advanced(courses[k], level(courses[k].q))
    assert memory(one).com == memory(other).com
    course = walk.start
    for _ in range(round(float(walk.rhythm.beginning) / CYCLE) - 2):
        course = walk.advanced(course, replace(level(course.q), attitude=as_array(rotate(X, 0.05))))
    assert abs(memory(course).lasting[1]) > 0.4 * 0.05 * walk.rhythm.com_height


def test_soles_are_where_the_memory_has_them_and_the_com_over_the_pendulum(
    robot: Robot, walk: StabilisedWalk, courses: States
) -> None:
    """By the library's own forward kinematics: the stance foot flat on the floor, the CoM within 1 mm."""
    T_waist_base = as_array(walk.body.T_waist_base)
    for course in courses[5::23]:
        now = memory(course)
        k = min(round(course.time / CYCLE), len(walk.heights) - 1)
        base = np.eye(4)
        base[:3, 3] = [*now.waist, walk.heights[k]]
        state = sk.State(base @ T_waist_base, course.q)
        tip = walk.body.tips[int(now.side > 0)]
        T = sk.frame_pose(robot, state, tip)
        np.testing.assert_allclose(T[:3, 3], [now.stance[0], now.stance[1], 0.0], atol=1e-9)
        np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-9)
        np.testing.assert_allclose(sk.center_of_mass(robot, state)[:2], now.com, atol=1e-3)


@settings(max_examples=10)
@given(
    heading=st.floats(-3.0, 3.0),
    lean=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    seed=st.integers(0, 99),
)
def test_it_measures_the_com_whatever_the_imu_s_heading(
    heading: float, lean: tuple[float, float], seed: int
) -> None:
    """A robot on one foot, anywhere, leaning with its sole: the gap is that of the library's CoM."""
    robot = sk.load_robot("bioloid")
    inputs = cycle_in_a_step(robot)
    rng = np.random.default_rng(seed)
    q = np.array(sk.home(robot).q) + rng.uniform(-0.1, 0.1, 18)
    now = pairs.of_row(Memory, inputs["memory"].tolist())
    cx, sx, cy, sy = math.cos(lean[0]), math.sin(lean[0]), math.cos(lean[1]), math.sin(lean[1])
    R = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    base = np.eye(4)
    base[:3, :3] = R
    foot = sk.frame_pose(robot, sk.State(base, q), "left_foot")
    com = sk.center_of_mass(robot, sk.State(base, q)) - foot[:3, 3]
    yaw = math.atan2(foot[1, 0], foot[0, 0])
    c, s = math.cos(-yaw), math.sin(-yaw)  # the stance foot heads ahead in the memory
    expected = np.array([c * com[0] - s * com[1], s * com[0] + c * com[1]]) + now.stance[:2]
    c, s = math.cos(heading), math.sin(heading)
    inputs |= {
        "attitude": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ R,
        "joints": q,
        "force": np.array([0.0, 20.0]),
        "pressure": np.zeros((2, 2)),
    }
    after = pairs.of_row(Memory, run(stabiliser_of(robot), inputs, ())["memory_after"].tolist())
    np.testing.assert_allclose(np.add(after.gap, after.lasting) + now.com, expected, atol=1e-9)


def test_without_feedback_nothing_felt_matters(walk: StabilisedWalk, courses: States) -> None:
    rng = np.random.default_rng(1)
    for course in courses[::40]:
        strange = Felt(
            np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=18), np.ones(2), np.ones((2, 2))
        )
        one, other = (walk.advanced(course, felt, False) for felt in (level(course.q), strange))
        assert (one.q == other.q).all()
        assert memory(one).com == memory(other).com


def test_a_robot_that_does_what_it_is_told_is_left_alone(walk: StabilisedWalk, courses: States) -> None:
    """Perfect tracking a cycle late: the stabilised walk stays within millimetres of the open one."""
    course = walk.start
    for other in courses[1 : len(walk.heights)]:
        course = walk.advanced(course, level(course.q))
        assert np.abs(course.q - other.q).max() < 0.05
    assert course.landed == len(walk.steps)
    np.testing.assert_allclose(memory(course).stance, memory(other).stance, atol=5e-3)


@pytest.mark.parametrize("late", range(7))
def test_servos_that_are_late_are_no_push(robot: Robot, late: int) -> None:
    """All joints up to 60 ms behind: the other foot still swings as it should stand, and is no measure yet.

    Between what is felt and commanded lies the way of the CoM in that time, and no more.
    """
    walk = stabilised(robot, planned(robot, Tc=0.35, stride=0.1))
    course, done, off = walk.start, [walk.start.q], []
    for _ in walk.heights:
        course = walk.advanced(course, level(done[max(0, len(done) - 1 - late)]))
        done.append(course.q)
        off.append(memory(course).error)
    assert course.landed == len(walk.steps)
    way = late * CYCLE * walk.rhythm.w * 0.05  # the DCM runs at w times its distance from the ZMP
    assert np.abs(off).max() < max(0.0, way - walk.gains.dead * walk.rhythm.half[1]) + 1e-9


@pytest.mark.parametrize("lean", [-0.05, 0.03])
def test_half_of_what_lasts_is_taken_back_by_the_waist(walk: StabilisedWalk, lean: float) -> None:
    """On a slope the CoM stands beside where it is planned; the waist goes against it."""
    waists = []
    for angle in (0.0, lean):
        course = walk.start
        for _ in range(round(float(walk.rhythm.beginning) / CYCLE) - 2):
            course = walk.advanced(course, replace(level(course.q), attitude=as_array(rotate(Y, angle))))
        waists.append(memory(course).waist[0] * walk.body.share)
    expected = -walk.gains.trim * memory(course).lasting[0]
    assert math.isclose(waists[1] - waists[0], expected, abs_tol=2e-4)
    assert abs(expected) > 0.2 * abs(lean) * walk.rhythm.com_height


def test_a_push_aside_lets_the_foot_land_where_the_robot_falls(walk: StabilisedWalk, courses: States) -> None:
    """A trunk that leans out over the stance foot in mid step: the CoM is felt there, so it lands nearer."""
    k = next(k for k, course in enumerate(courses) if course.landed == 1 and memory(course).tau > 0.11)
    places = []
    for angle in (0.0, 0.25):
        course = courses[k]
        side = memory(course).side
        c, s = math.cos(-side * angle), math.sin(-side * angle)
        attitude = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        for _ in range(15):
            course = walk.advanced(course, replace(level(course.q), attitude=attitude))
        places.append(-side * memory(course).place[1])
    assert places[1] < places[0] - 5e-4


def test_left_and_right_are_alike(robot: Robot, walk: StabilisedWalk, courses: States) -> None:
    """The walk that begins with the other foot is the mirror image: CoM, ZMP and feet."""
    other = stabilised(robot, planned(robot, 2, first="left"))
    mirrored = walked(replace(other, rhythm=walk.rhythm, body=walk.body, steps=walk.steps), 130)
    for one, other in zip(courses[:130:20], mirrored[::20], strict=False):
        a, b = memory(one), memory(other)
        np.testing.assert_allclose(a.stance, np.array(b.stance) * [1, -1, -1], atol=1e-9)
        np.testing.assert_allclose(a.com, np.array(b.com) * [1, -1], atol=1e-9)
        np.testing.assert_allclose(a.zmp, np.array(b.zmp) * [1, -1], atol=1e-9)


def test_a_leg_out_of_reach_is_stretched(walk: StabilisedWalk) -> None:
    far = Pose(Rotation(*(Vector(*row) for row in np.eye(3).tolist())), Vector(0.0, 0.0, 0.5))
    feet = [pose_from_array(np.diag([1.0, 1.0, 1.0, 1.0])) for _ in range(2)]
    q = np.array(walk.body.posture(far, feet, walk.start.q.tolist()), dtype=float)
    assert np.isfinite(q).all()
    knee = walk.body.robot.joint_names.index("right_knee")
    assert abs(q[knee]) < 0.05


@pytest.mark.parametrize(
    ("gait", "words"), [("walk", "not geometric"), ("slope", "level ground"), ("soon", "lead = 1")]
)
def test_what_it_cannot_walk_is_refused(robot: Robot, gait: str, words: str) -> None:
    if gait == "walk":
        plan = sk.walk(robot, sk.load_gait("walk"), steps=1)
    else:
        plan = planned(robot, 2, **({"uphill": 0.03} if gait == "slope" else {"lead": 0.0, "Tc": 0.33}))
    with pytest.raises(InputError, match=words):
        stabilised(robot, plan)
