"""A waist that rolls between the hips: rates and accelerations, flat soles, and a walk without ankle roll."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwkin as sk
from screwkin.algebra.se3 import as_array
from screwkin.anatomy.humanoid import humanoid
from screwkin.errors import GaitError, NoSolutionError
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.footsteps import footholds
from screwkin.gait.lengths import fitted
from screwkin.gait.plan import plan
from screwkin.gait.preview import follow_reference, preview_gains
from screwkin.gait.preview_plan import zmp_reference
from screwkin.gait.stance import stance_of
from screwkin.gait.steering import Steering
from screwkin.kinematics.landmarks import limb_root
from screwkin.model.urdf_in import parse_urdf
from tests.anatomy.bodies import biped

NO_ANKLE_ROLL = ("hip_yaw", "hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch")
QUICK = {"period": 2.0, "stand": 2.0, "stride": "0.2*leg", "lift": "0.04*leg"}


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return humanoid(parse_urdf(biped(leg=NO_ANKLE_ROLL).text()).robot)


@pytest.fixture(scope="module")
def gait(robot: sk.Robot) -> sk.Gait:
    return fitted(sk.load_gait("auto"), robot).replace(lateral="lean", **QUICK)


@pytest.mark.parametrize("name", ["walk", "turn"])
def test_rates_and_accelerations_are_those_of_the_rolled_base(
    robot: sk.Robot, gait: sk.Gait, name: str
) -> None:
    """Against finite differences of the base's pose, also while the level waist turns."""
    bioloid = sk.load_robot("bioloid")
    level = plan(fitted(sk.load_gait(name), bioloid).replace(rate=1000.0), stance_of(bioloid), 2)
    steering, t = Steering.of(robot, gait), level.time
    waves = np.array([np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)])
    by, velocity, acceleration = waves[..., None] * (0.02, 0.3)
    rolled = steering.driven(steering.moved(level, by), velocity, np.zeros_like(by))
    rolled = steering.driven(rolled, np.zeros_like(by), acceleration)
    T, twist = rolled.T_world_base, rolled.base_twist
    R, h = T[1:-1, :3, :3], t[1] - t[0]
    spin = np.einsum("tij,tkj->tik", (T[2:, :3, :3] - T[:-2, :3, :3]) / (2 * h), R)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
    np.testing.assert_allclose(omega, twist[1:-1, :3], atol=1e-4)
    np.testing.assert_allclose((T[2:, :3, 3] - T[:-2, :3, 3]) / (2 * h), twist[1:-1, 3:], atol=1e-4)
    slope = (twist[2:] - twist[:-2]) / (2 * h)
    np.testing.assert_allclose(slope, rolled.base_acceleration[1:-1], atol=2e-3)
    assert np.ptp(np.arcsin(T[:, 2, 1])) > 0.3


@pytest.mark.parametrize("lateral", ["lean", "tilt"])
def test_points_of_the_roll_s_axis_stay_where_they_are(robot: sk.Robot, gait: sk.Gait, lateral: str) -> None:
    bioloid = sk.load_robot("bioloid")
    level = plan(fitted(sk.load_gait("turn"), bioloid), stance_of(bioloid), 2)
    steering = Steering.of(robot, gait.replace(lateral=lateral))
    assert steering.axis is not None
    R, point = steering.axis
    rolled = steering.moved(level, np.linspace(0, 0.4, len(level.time))[:, None] * (0.0, 1.0))
    for at in (point, point + R[:, 0]):
        before, after = (T[:, :3, :3] @ at + T[:, :3, 3] for T in (level.T_world_base, rolled.T_world_base))
        np.testing.assert_allclose(after, before, atol=1e-12)


@pytest.mark.parametrize("pivot", [0.0, 0.05, 0.1])
def test_a_waist_tilts_about_a_line_at_its_height_above_the_floor(pivot: float) -> None:
    """The middle between the hips goes aside as far as a point turns that lies as high above the line."""
    bioloid = sk.load_robot("bioloid")
    gait = fitted(sk.load_gait("auto"), bioloid).replace(lateral="tilt", pivot=pivot)
    walk, height = sk.walk(bioloid, gait, steps=2), gait.lengths["leg"] * gait.numbers["bend"]
    angle = np.arcsin(walk.T_world_base[:, 2, 1])
    legs = [limb.name for limb in bioloid.limbs if limb.kind == "leg"]
    middle = np.mean([as_array(limb_root(bioloid, leg)).astype(float) for leg in legs], axis=0)
    assert np.ptp(angle) > 0.05
    aside = (walk.T_world_base[:, :3, :3] @ middle + walk.T_world_base[:, :3, 3])[:, 1]
    np.testing.assert_allclose(aside - aside[0], -(height - pivot) * np.sin(angle), atol=2e-3)


def test_soles_stay_flat_and_the_zmp_within_them(robot: sk.Robot, gait: sk.Gait) -> None:
    walks = {key: sk.walk(robot, gait.replace(lateral=key), steps=2) for key in ("shift", "lean")}
    sines = {
        key: max(float(np.abs(walk.T_world_tip[foot][:, 2, 1]).max()) for foot in walk.feet)
        for key, walk in walks.items()
    }
    lean = {key: np.degrees(np.arcsin(sine)) for key, sine in sines.items()}
    assert lean["shift"] > 5
    assert lean["lean"] < 1
    assert walks["shift"].margin.min() < 0
    assert walks["lean"].margin.min() > 0.02
    rolled = walks["lean"]
    assert np.abs(rolled.T_world_base[[0, -1], 2, 1]).max() < 0.02  # it begins and ends upright
    assert np.abs(rolled.qd[-1]).max() < 0.1


def test_before_and_after_the_swings_the_zmp_is_at_the_other_foot(robot: sk.Robot, gait: sk.Gait) -> None:
    stance, steps = stance_of(robot), 3
    time = np.arange(round((steps + 4) * gait.Tc * 200)) / 200
    side = zmp_reference(gait, stance, footholds(gait, stance, steps), steps, time)[:, 1]
    phase = time / gait.Tc - 2
    y = stance.foot_y + np.mean(np.array(stance.foot(1).sole)[:, 1])
    for start, wanted in ((-2, 0), (-0.5, -y), (0, y), (1, -y), (2, y), (3, -y), (3.5, 0)):
        held = (phase > start + gait.numbers["dsp"] + 1e-6) & (phase < start + 0.5 - 1e-6)
        np.testing.assert_allclose(side[held], wanted, atol=1e-9)


def test_the_zmp_may_stay_below_the_ankles(robot: sk.Robot, gait: sk.Gait) -> None:
    stance, time = stance_of(robot), np.arange(300) / 50
    holds = footholds(gait, stance, 3)
    middle = np.mean([foot.sole for foot in stance.feet], axis=(0, 1))[0]
    whole, part = (zmp_reference(gait.replace(ahead=share), stance, holds, 3, time) for share in (1.0, 0.3))
    np.testing.assert_allclose(whole - part, np.tile([0.7 * middle, 0], (300, 1)), atol=1e-12)


def test_the_zmp_may_go_to_the_inner_half_of_the_soles(robot: sk.Robot, gait: sk.Gait) -> None:
    gait, stance, time = gait.replace(lateral="shift"), stance_of(robot), np.arange(300) / 50
    holds = footholds(gait, stance, 3)
    middle, inner = (
        zmp_reference(gait.replace(inward=share), stance, holds, 3, time) for share in (0.0, 0.5)
    )
    corners = np.array(stance.foot(1).sole)[:, 1]
    share = 0.5 * (corners.mean() - corners.min()) / (stance.foot_y + corners.mean())
    np.testing.assert_allclose(inner, middle * (1, 1 - share), atol=1e-12)
    np.testing.assert_array_equal(middle, zmp_reference(gait.replace(inward=0), stance, holds, 3, time))


def test_a_slow_step_shifts_the_weight_slowly_only_if_both_feet_stand_for_long(
    robot: sk.Robot, gait: sk.Gait
) -> None:
    """Twice the time halves the speed of the CoM; a short shift lets it fall over as fast as a pendulum."""
    gait, stance = gait.replace(lateral="shift", stand=1), stance_of(robot)
    holds, speed = footholds(gait, stance, 3), {}
    for dsp in (0.2, 0.5):
        for period in (10, 20):
            paced = gait.replace(dsp=dsp, period=period)
            time = np.arange(round(5 * paced.Tc * 50)) / 50
            gains = preview_gains(0.02, 0.6, paced.numbers["horizon"])
            cart = follow_reference(gains, zmp_reference(paced, stance, holds, 3, time))
            speed[dsp, period] = np.abs(cart.velocity[:, 1]).max()
    assert speed[0.5, 20] == pytest.approx(0.5 * speed[0.5, 10], rel=0.1)
    assert speed[0.2, 20] > 1.5 * speed[0.5, 20]


def test_a_waist_that_leans_takes_load_off_the_hips() -> None:
    bioloid = sk.load_robot("bioloid")
    gait = fitted(sk.load_gait("auto"), bioloid).replace(**QUICK)
    rolls = [i for i, joint in enumerate(bioloid.joints) if "hip_roll" in joint.name]
    assert len(rolls) == 2
    most = {
        key: np.abs(walking_torques(bioloid, sk.walk(bioloid, gait.replace(lateral=key), 1)))[:, rolls].max()
        for key in ("shift", "tilt", "lean")
    }
    assert most["lean"] < 0.9 * most["shift"]
    assert most["tilt"] < 0.97 * most["shift"]


def test_a_leg_whose_sole_may_lean_is_out_of_reach_by_its_limits_not_for_want_of_a_joint(
    robot: sk.Robot, gait: sk.Gait
) -> None:
    rolls = {robot.path_to(limb.link)[1] for limb in robot.limbs if limb.kind == "leg"}
    joints = (
        replace(joint, lower=-0.02, upper=0.02) if i in rolls else joint
        for i, joint in enumerate(robot.joints)
    )
    stiff = replace(robot, joints=tuple(joints))
    with pytest.raises(NoSolutionError, match=r"at -?1\.\d deg, limits -1\.1 to 1\.1 deg") as caught:
        sk.walk(stiff, gait, steps=1)
    assert "no joint" not in str(caught.value)


def test_a_stand_of_less_than_a_phase_is_refused(robot: sk.Robot, gait: sk.Gait) -> None:
    with pytest.raises(GaitError, match=r"stand: 0\.5 is out of range"):
        sk.walk(robot, gait.replace(stand=0.5), steps=1)


@pytest.mark.slow
def test_a_robot_without_ankle_roll_gets_a_gait_that_rolls_and_walks_in_both_engines(robot: sk.Robot) -> None:
    gait = sk.fitting_gait(robot)
    assert gait.lateral == "lean"
    walk = sk.walk(robot, gait, 6)
    for engine in ("mujoco", "pybullet"):
        check = sk.validate(robot, walk, engine=engine, servo="rigid")
        assert check.passed, check.reasons
