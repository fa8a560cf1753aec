"""Feet that pitch: edges stay, soles do not enter the floor, and only edges support."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.analysis.account import account_of
from screwkin.analysis.consistency import motion_faults
from screwkin.analysis.contact_account import forces_of
from screwkin.dynamics.on_floor import TOUCH, pressed_points, soles_on_floor
from screwkin.dynamics.support import sole_corners
from screwkin.errors import GaitError, InputError
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.footsteps import feet_motion, footholds
from screwkin.gait.loads import balance_points, load_distribution
from screwkin.gait.motion import Motion
from screwkin.gait.pitch import foot_acceleration, foot_pose, foot_twist, pitched, refuse_level_legs
from screwkin.gait.soles import outlines, underside
from screwkin.gait.stance import Stance, stance_of
from screwkin.sim.kinematic import KinematicBackend
from screwkin.sim.measure import slip
from screwkin.sim.run import simulate
from screwkin.stabiliser.walk import stabilised

ROBOT = sk.load_robot("bioloid")
STANCE = stance_of(ROBOT)
PREVIEW = sk.load_gait("preview")
EDGES = {foot.name: (min(x for x, _ in foot.sole), max(x for x, _ in foot.sole)) for foot in STANCE.feet}

angles = st.one_of(st.just(0.0), st.floats(0.01, 1.0))


def swung(liftoff: float, landing: float, **changes: Any) -> sk.Gait:
    """The preview gait with these angles, its feet off the floor between two fractions of a step."""
    keys = {"foot_progress": (liftoff, landing), "foot_height": (liftoff, 0.5 * (liftoff + landing), landing)}
    points = {f"channel.{name}.at": list(at) for name, at in keys.items()}
    return PREVIEW.replace(**points, **changes)


def feet_of(
    gait: sk.Gait, steps: int, phases: np.ndarray, stance: Stance = STANCE
) -> tuple[dict[str, Motion], np.ndarray]:
    """Feet of a gait and which are in contact, at phases that go by one a second."""
    phase = Motion(phases, np.ones_like(phases), np.zeros_like(phases))
    holds = footholds(gait, stance, steps)
    level, contact = feet_motion(gait, stance, holds, phase)
    return pitched(gait, stance, holds, phase, level), contact


def corners_of(sole: np.ndarray, motion: Motion) -> np.ndarray:
    """World corners (T, k, 3) of a sole (k, 2)."""
    T, corners = foot_pose(motion), np.pad(sole, ((0, 0), (0, 1)))
    return np.einsum("tij,kj->tki", T[:, :3, :3], corners) + T[:, None, :3, 3]


gaits = st.builds(
    swung,
    st.floats(0.2, 0.45),
    st.floats(0.6, 1.0),
    toe=angles,
    heel=angles,
    turn=st.sampled_from([0.0, 0.2, -0.3]),
    stride=st.floats(-0.05, 0.15),
)


lengths = st.floats(-0.1, 0.1)
soles = st.lists(st.tuples(lengths, lengths), min_size=3, max_size=8).filter(
    lambda c: np.ptp(c, axis=0)[0] > 1e-3
)


@given(gaits, st.integers(1, 5), soles)
def test_a_sole_on_the_floor_rests_on_it_or_on_an_edge_that_stays_and_no_sole_enters_the_floor(
    gait: sk.Gait, steps: int, sole: list[tuple[float, float]]
) -> None:
    """Whatever its outline: what does not stay put lifts off, and what is foremost or hindmost stays."""
    stance = replace(STANCE, feet=tuple(replace(foot, sole=tuple(sole)) for foot in STANCE.feet))
    feet, contact = feet_of(gait, steps, np.linspace(0.0, steps, 400), stance)
    x = np.array(sole)[:, 0]
    for i, foot in enumerate(EDGES):
        corners = corners_of(np.array(sole), feet[foot])
        assert corners[..., 2].min() > -1e-12
        both = contact[1:, i] & contact[:-1, i]
        ends = [corners[:, x == extreme] for extreme in (x.min(), x.max())]
        stays = [np.abs(np.diff(end, axis=0)).max(axis=(1, 2)) < 1e-12 for end in ends]
        assert (stays[0] | stays[1])[both].all()
        assert np.abs(corners[contact[:, i]][..., 2].min(axis=1)).max() < 1e-12


@given(gaits, st.integers(2, 5), st.data())
def test_rates_and_accelerations_are_those_of_the_poses(
    gait: sk.Gait, steps: int, data: st.DataObject
) -> None:
    """By central differences, and by that without jumps: near any phase, also where turns begin and end."""
    liftoff, landing = gait.channels["foot_height"].at[[0, -1]]
    ends = [n + at for n in range(1, steps) for at in (0.1, liftoff, landing)]
    middle = data.draw(st.one_of(st.sampled_from(ends), st.floats(0.01, steps - 0.01)))
    h = 1e-5
    feet, _ = feet_of(gait, steps, middle + h * np.arange(-1, 2))
    for motion in feet.values():
        T, V, A = foot_pose(motion), foot_twist(motion), foot_acceleration(motion)
        turning = (T[2, :3, :3] - T[0, :3, :3]) @ T[1, :3, :3].T / (2 * h)
        moved = (T[2, :3, 3] - T[0, :3, 3]) / (2 * h)
        spin = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
        assert np.concatenate([spin, moved]) == pytest.approx(V[1], abs=1e-5)
        assert (V[2] - V[0]) / (2 * h) == pytest.approx(A[1], abs=3e-1)  # h times the jerk, up to 1e4 rad/s^3


@given(gaits)
def test_soles_seen_from_above_and_their_undersides_are_those_of_their_corners(gait: sk.Gait) -> None:
    feet, _ = feet_of(gait, 3, np.linspace(0.0, 3.0, 100))
    for foot in STANCE.feet:
        sole = np.asarray(foot.sole)
        corners = corners_of(sole, feet[foot.name])
        assert outlines(sole, feet[foot.name]) == pytest.approx(corners[..., :2], abs=1e-9)
        assert underside(sole, feet[foot.name]) == pytest.approx(corners[..., 2].min(axis=1), abs=1e-9)


def test_without_angles_feet_are_what_they_were() -> None:
    gait = PREVIEW.replace(toe=0.0, heel=0.0)
    now, before = sk.walk(ROBOT, gait, 2), sk.walk(ROBOT, PREVIEW, 2)
    assert np.array_equal(now.q, before.q)
    assert np.array_equal(now.margin, before.margin)


@pytest.fixture(scope="module")
def walk() -> sk.Trajectory:
    return sk.walk(ROBOT, swung(0.25, 0.95, toe=0.2, heel=0.2), 3)


def test_only_the_edges_of_feet_that_turn_support(walk: sk.Trajectory) -> None:
    """And the ZMP stays well within: it passes from foot to foot while both are flat, to a hair."""
    soles = soles_on_floor(ROBOT, walk.feet, walk.T_world_tip)
    assert walk.margin.min() > 0.02
    for i, foot in enumerate(walk.feet):
        T = walk.T_world_tip[foot]
        corners = np.einsum("tij,kj->tki", T[:, :3, :3], sole_corners(ROBOT, foot)) + T[:, None, :3, 3]
        turned = walk.contact[:, i] & (np.ptp(corners[..., 2], axis=1) > TOUCH)
        assert turned.sum() > 5
        for sole, own in zip(soles[turned, i], corners[turned], strict=True):
            edge = own[own[:, 2] < 1e-6][:, :2]
            assert len(edge) == 2
            assert all(np.abs(edge - point).max(axis=1).min() < 1e-12 for point in sole)


def test_a_walk_on_edges_agrees_with_itself_and_does_not_slip(walk: sk.Trajectory) -> None:
    assert motion_faults(ROBOT, walk) == ()
    run = simulate(ROBOT, walk, KinematicBackend(ROBOT, dt=0.005))
    assert slip(run, walk, ROBOT).largest < 2e-5  # a hair's turn of a sole that is not yet on its edge
    moved = {tip: T + 0.0 for tip, T in walk.T_world_tip.items()}
    row = int(np.flatnonzero(np.abs(moved["left_foot"][:, 2, 0]) > 0.1)[1])
    moved["left_foot"][row, 0, 3] += 0.001
    assert any(
        "left_foot moves while" in fault for fault in motion_faults(ROBOT, replace(walk, T_world_tip=moved))
    )


def test_an_edge_that_slides_slips(walk: sk.Trajectory) -> None:
    """At a moment at which the left foot turns about its front edge."""
    run = simulate(ROBOT, walk, KinematicBackend(ROBOT, dt=0.005))
    i, T = walk.feet.index("left_foot"), run.T_world_foot.copy()
    rows = walk.contact[:, i] & (walk.T_world_tip["left_foot"][:, 2, 0] < -0.1)
    T[:, 1, 0, 3] += 0.01 * (run.time > walk.time[int(rows.argmax())])
    assert slip(replace(run, T_world_foot=T), walk, ROBOT).total == pytest.approx(0.01, abs=1e-4)


def test_feet_that_turn_carry_their_load_on_their_edge(walk: sk.Trajectory) -> None:
    """Balance points go there without a jump, and the load on them acts near the ZMP."""
    points = balance_points(ROBOT, walk)
    away = pressed_points(ROBOT, walk.feet, walk.T_world_tip)
    for i, foot in enumerate(walk.feet):
        T = walk.T_world_tip[foot]
        own = np.einsum("tji,tj->ti", T[:, :3, :3], points[:, i] - T[:, :3, 3])
        middle = 0.5 * sum(EDGES[foot])
        turned = walk.contact[:, i] & (np.abs(T[:, 2, 0]) * (EDGES[foot][1] - EDGES[foot][0]) > 1.01 * TOUCH)
        edge = np.where(T[turned, 2, 0] < 0, EDGES[foot][1], EDGES[foot][0])
        assert own[turned, 0] == pytest.approx(edge - middle, abs=1e-9)
        assert away[turned, i, 0] == pytest.approx(edge - middle, abs=1e-9)
        stands = walk.contact[1:, i] & walk.contact[:-1, i]
        assert np.abs(np.diff(own[:, 0]))[stands].max() < 0.01
    shares = load_distribution(walk, points)
    both = walk.contact.all(axis=1) & (shares.min(axis=1) > 0.05)
    on_line = (shares[..., None] * points[..., :2]).sum(axis=1)
    assert np.linalg.norm(on_line - walk.zmp, axis=1)[both].max() < 0.02
    torque = walking_torques(ROBOT, walk)
    assert np.abs(np.diff(torque, axis=0)).max() < 0.3 * np.abs(torque).max()


def test_steps_that_go_no_way_ahead_stay_level_and_so_does_the_last_landing() -> None:
    phases = np.linspace(0.0, 4.0, 300)
    for changes in ({"stride": -0.06}, {"stride": 0.0, "side": 0.03, "footholds": "close"}):
        feet, _ = feet_of(PREVIEW.replace(toe=0.3, heel=0.3, **changes), 4, phases)
        assert not any(motion.value[:, 4].any() for motion in feet.values())
    gait = PREVIEW.replace(toe=0.3, heel=0.3, footholds="alternate")
    feet, _ = feet_of(gait, 4, phases)
    assert not any(motion.value[-1, 4] for motion in feet.values())
    assert all(np.ptp(motion.value[:, 4]) > 0.3 for motion in feet.values())


def test_legs_that_keep_soles_level_refuse_by_the_keys_name() -> None:
    gait = PREVIEW.replace(toe=0.2, heel=0.1)
    with pytest.raises(GaitError, match=r"key heel: .*no joint pitches left_foot(.|\n)*key toe"):
        refuse_level_legs(gait, ("left_foot",), {"left_foot": ("ry",)})
    refuse_level_legs(PREVIEW, ("left_foot",), {"left_foot": ("ry",)})
    refuse_level_legs(gait, ("left_foot",), {"left_foot": ("rx", "rz")})


@pytest.mark.parametrize("key", ["toe", "heel"])
def test_other_gaits_stabilisers_and_shares_of_forces_refuse_angles_by_their_name(
    key: str, walk: sk.Trajectory
) -> None:
    with pytest.raises(GaitError, match=key):
        sk.load_gait("walk").replace(**{key: 0.2})
    with pytest.raises(GaitError, match=key):
        PREVIEW.replace(**{key: -0.1})
    with pytest.raises(InputError, match=key):
        stabilised(ROBOT, walk)
    with pytest.raises(InputError, match=key):
        forces_of(account_of(ROBOT, walk), None)
