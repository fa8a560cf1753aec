"""Soles of legs without ankle roll: level while they carry the weight, else on their inner edges."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.anatomy.humanoid import humanoid
from screwkin.dynamics.support import sole_corners
from screwkin.gait.bearing import bearing, leans_of, supports
from screwkin.gait.follow import follow
from screwkin.gait.lengths import fitted
from screwkin.gait.paces import STEP_SIZES, usual_pace
from screwkin.gait.stance import stance_of
from screwkin.mechanism.choice import closed_mechanism
from screwkin.model.urdf_in import parse_urdf
from tests.anatomy.bodies import biped

NO_ANKLE_ROLL = ("hip_yaw", "hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch")
NEITHER = ("hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch")
QUICK = {"period": 2.0, "stand": 2.0, "stride": "0.2*leg", "lift": "0.04*leg", "lateral": "lean"}


def walker(joints: tuple[str, ...], wide: float = 0.1) -> sk.Robot:
    return humanoid(parse_urdf(biped(leg=joints, wide=wide).text()).robot)


@pytest.fixture(scope="module", params=[NO_ANKLE_ROLL, NEITHER], ids=["five", "four"])
def robot(request: pytest.FixtureRequest) -> sk.Robot:
    return walker(request.param)


def leaning(robot: sk.Robot, **keys: float) -> sk.Gait:
    return fitted(sk.load_gait("auto"), robot).replace(**QUICK, **keys)


def test_a_sole_that_stands_alone_is_level_and_the_other_one_is_not(robot: sk.Robot) -> None:
    walk = sk.walk(robot, leaning(robot), steps=3)
    sines = np.stack([walk.T_world_tip[foot][:, 2, 1] for foot in walk.feet], axis=1)
    alone = walk.contact & ~walk.contact[:, ::-1]
    assert alone.any(axis=0).all()
    assert np.abs(sines[alone]).max() < 1e-8
    assert np.abs(sines[alone[:, ::-1]]).max() > 1e-3  # hips come nearer to each other


def test_soles_touch_the_floor_and_do_not_enter_it(robot: sk.Robot) -> None:
    """The lowest corner, where the foot leans too: an edge below the floor would lift the robot."""
    walk = sk.walk(robot, leaning(robot), steps=3)
    for k, foot in enumerate(walk.feet):
        T = walk.T_world_tip[foot]
        corners = np.einsum("tij,kj->tki", T[:, :3, :3], sole_corners(robot, foot)) + T[:, None, :3, 3]
        lowest = corners[..., 2].min(axis=1)
        np.testing.assert_allclose(lowest[walk.contact[:, k]], 0, atol=5e-6)
        assert lowest.min() > -5e-6


def test_leans_and_their_derivatives_are_those_of_the_poses(robot: sk.Robot) -> None:
    """Against central differences of the planned poses, at their own order of accuracy."""
    gait = leaning(robot, rate=400.0)
    done = follow(robot, gait, 2)
    q, motion = done.solution.state.q, done.motion
    leans = leans_of(done.mechanism.robot, done.planned, q, motion.qd, motion.qdd)
    walk, h = sk.walk(robot, gait, steps=2), 1 / gait.rate
    sines = np.stack([walk.T_world_tip[foot][:, 2, 1] for foot in done.planned.feet], axis=1)
    np.testing.assert_allclose(leans.value, sines, atol=1e-9)
    np.testing.assert_allclose(leans.rate[1:-1], (sines[2:] - sines[:-2]) / (2 * h), atol=2e-3)
    smooth = slice(None, round((gait.numbers["stand"] - 0.6) * gait.Tc * gait.rate))  # before the weight goes
    slope = (leans.rate[2:] - leans.rate[:-2]) / (2 * h)
    np.testing.assert_allclose(leans.acceleration[1:-1][smooth], slope[smooth], atol=2e-3)


def test_weight_goes_where_supports_say_and_its_rates_are_its_derivatives(robot: sk.Robot) -> None:
    gait, stance, steps = leaning(robot), stance_of(robot), 3
    time = np.arange(0, (steps + 4) * gait.Tc, 1e-4)
    shares = bearing(closed_mechanism(robot), gait, stance, steps, time)
    assert shares is not None
    np.testing.assert_allclose(shares.value.sum(axis=1), 1, atol=1e-12)
    names, phase = [foot.name for foot in stance.feet], time / gait.Tc - 1
    for begin, foot, _ in supports(gait, stance, steps):
        held = (phase > begin + gait.numbers["dsp"]) & (phase < begin + 0.5)
        wanted = [0.5, 0.5] if not foot else [float(name == foot) for name in names]
        np.testing.assert_allclose(shares.value[held], np.tile(wanted, (held.sum(), 1)), atol=1e-12)
    for below, above in ((shares.value, shares.rate), (shares.rate, shares.acceleration)):
        slope = (below[2:] - below[:-2]) / 2e-4
        np.testing.assert_allclose(
            above[1:-1], slope, atol=1e-2 * np.abs(slope).max()
        )  # jerk jumps at the ends


@pytest.mark.parametrize("lateral", ["shift", "tilt"])
def test_no_sole_is_kept_level_where_the_waist_does_more_than_lean(robot: sk.Robot, lateral: str) -> None:
    gait = leaning(robot).replace(lateral=lateral)
    assert bearing(closed_mechanism(robot), gait, stance_of(robot), 2, np.arange(10.0)) is None


def test_ankles_that_roll_keep_soles_level_by_themselves() -> None:
    robot = walker((*NO_ANKLE_ROLL, "ankle_roll"))
    mechanism, time = closed_mechanism(robot), np.arange(10.0)
    assert bearing(mechanism, leaning(robot), stance_of(robot), 2, time) is None


def test_contact_forces_are_where_the_plan_has_them() -> None:
    """The judge is a simulator that knows no plan: a sole on its edge would carry the weight on that edge."""
    robot = walker(NO_ANKLE_ROLL)
    walk = sk.walk(robot, leaning(robot), steps=4)
    check = sk.validate(robot, walk, engine="mujoco", servo="rigid")
    assert check.passed
    now = np.rint(check.zmp.time * 50).astype(int).clip(2, walk.samples - 3)
    alone = np.all([walk.contact[now + k].sum(axis=1) == 1 for k in range(-2, 3)], axis=0)
    assert alone.sum() > 500
    assert np.abs(check.zmp.contact - check.zmp.planned)[alone].max() < 5e-3  # of a sole 100 mm wide


@pytest.mark.parametrize("wide", [0.1, 0.03])
def test_the_pace_that_is_tried_first_holds_on_blades(wide: float) -> None:
    """No ankle rights a sole that tips, so that its ZMP must be led where all links have it."""
    robot = walker(NO_ANKLE_ROLL, wide)
    size = STEP_SIZES[1]
    gait = usual_pace(robot).replace(stride=f"{size.stride}*leg", lift=f"{size.lift}*leg")
    walk = sk.walk(robot, gait, steps=4)
    assert walk.margin.min() > 0.2 * wide
    assert sk.validate(robot, walk, engine="mujoco", servo="rigid").passed
