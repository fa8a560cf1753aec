"""The plan: published waist and hands, derivatives against differences, rest at both ends, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from screwkin.errors import GaitError, InputError, ShapeError
from screwkin.gait.files import load_gait
from screwkin.gait.plan import plan
from screwkin.gait.record import gait_from_dict
from screwkin.gait.stance import Foot, Stance

PRESETS = ("backwards", "paper", "sideways", "step-in-place", "turn", "walk")


def yaw_of(pose):
    return np.unwrap(np.arctan2(pose[:, 1, 0], pose[:, 0, 0]))


def at_phases(gait, stance, steps, phases):
    made = plan(gait.replace(Tc=1.0, ramp=0, rate=1000.0), stance, steps)
    rows = [int(np.argmin(np.abs(made.phase - phase))) for phase in phases]
    assert np.abs(made.phase[rows] - phases).max() < 1e-9
    return made, rows


def test_waist_follows_equation_23_with_its_missing_row(stance):
    phases = [n + f for n in range(4) for f in (0, 0.1, 0.5, 0.9)] + [4]
    made, rows = at_phases(load_gait("paper"), stance, 4, phases)
    printed = 0.05 + 0.025 * np.arange(17)
    assert made.T_world_base[rows, 0, 3] == pytest.approx(printed, abs=1e-12)
    assert made.T_world_base[:, 2, 3] == pytest.approx(np.full(len(made.time), 0.15))


def test_waist_follows_equation_24_towards_the_supporting_foot(stance):
    phases = [n + f for n in range(4) for f in (0, 0.1, 0.5, 0.9)]
    made, rows = at_phases(load_gait("paper"), stance, 4, phases)
    printed = np.outer([1, -1, 1, -1], [0, 0.027, 0.042, 0.027]).ravel()
    assert made.T_world_base[rows, 1, 3] == pytest.approx(printed, abs=1e-12)
    middle = made.phase % 1 == 0.5
    for foot, sign in (("left_foot", 1), ("right_foot", -1)):
        supports = ~made.contact[:, made.feet.index("right_foot" if sign == 1 else "left_foot")] & middle
        assert (np.sign(made.T_world_base[supports, 1, 3]) == sign).all(), foot


def test_hands_follow_equations_16_to_18_below_their_shoulders(stance):
    phases = [n + f for n in range(4) for f in (0, 0.1, 0.5, 0.8)]
    made, rows = at_phases(load_gait("paper"), stance, 4, phases)
    g = np.repeat([1, -1, 1, -1], 4)
    forward = 0.03 * np.tile([-1, -1, 0, 1], 4)
    for hand, side in (("right_hand", -1), ("left_hand", 1)):
        relative = made.hand_position[hand][rows] - made.T_world_base[rows, :3, 3]
        assert relative[:, 0] == pytest.approx(-side * g * forward, abs=1e-12)
        assert relative[:, 1] == pytest.approx(np.full(16, side * 0.064646))
        raised = 0.0187 * np.tile([1, 1, 0, 1], 4)
        assert relative[:, 2] == pytest.approx(0.121451 - 0.113 + raised, abs=1e-12)


def test_hands_rest_at_their_ends_as_equations_16_to_18_print_it(stance):
    """From 0 to .1 and from .8 to 1 Tc of every step nothing moves; in between no hand leaves its range."""
    made = plan(load_gait("paper").replace(ramp=0, rate=1000.0), stance, 4)
    part, n = made.phase % 1, np.floor(made.phase)
    resting = (part < 0.1) | (part >= 0.8)
    raised = 0.121451 - 0.113 + 0.0187
    for hand, side in (("right_hand", -1), ("left_hand", 1)):
        relative = made.hand_position[hand] - made.T_world_base[:, :3, 3]
        end = -side * (-1) ** n * np.where(part < 0.5, -0.03, 0.03)
        assert relative[resting, 0] == pytest.approx(end[resting], abs=1e-12)
        assert relative[resting, 2] == pytest.approx(np.full(resting.sum(), raised), abs=1e-12)
        assert np.abs(relative[:, 0]).max() < 0.03 + 1e-12
        assert relative[:, 2].max() < raised + 1e-12
        rate = made.hand_velocity[hand] - made.base_twist[:, 3:]
        assert np.abs(rate[resting][:, [0, 2]]).max() < 1e-12


@pytest.mark.parametrize("preset", PRESETS)
def test_hands_never_come_near_the_reach_of_the_arm(stance, preset):
    made = plan(load_gait(preset), stance, 4)
    for hand in stance.hands:
        shoulder = made.T_world_base @ np.array([*hand.shoulder, 1.0])
        distance = np.linalg.norm(made.hand_position[hand.name] - shoulder[:, :3], axis=1)
        assert distance.max() < 0.1135  # the arm reaches 0.12109
        assert distance.min() > 0.095


@pytest.mark.parametrize("preset", PRESETS)
def test_rates_and_accelerations_agree_with_differences_of_the_positions(stance, preset):
    """Central differences at a fine rate; samples next to a knot, where the jerk jumps, are left out."""
    gait = load_gait(preset).replace(rate=2000.0, turn=load_gait(preset).turn + 0.05, stride=0.05)
    made = plan(gait, stance, 3)
    dt = made.time[1] - made.time[0]
    knots = np.concatenate([channel.at for channel in gait.channels.values()])
    smooth = np.abs((made.phase[:, None] - knots + 0.5) % 1 - 0.5).min(axis=1) > 0.003
    inner = smooth[1:-1]
    bodies = {"base": (made.T_world_base, made.base_twist, made.base_acceleration)}
    bodies |= {
        foot: (made.T_world_tip[foot], made.tip_twist[foot], made.tip_acceleration[foot])
        for foot in made.feet
    }
    for pose, twist, acceleration in bodies.values():
        told = np.column_stack([np.zeros((len(pose), 2)), yaw_of(pose), pose[:, :3, 3]])
        slope = (told[2:] - told[:-2]) / (2 * dt)
        bend = (told[2:] - 2 * told[1:-1] + told[:-2]) / dt**2
        np.testing.assert_allclose(slope[inner], twist[1:-1][inner], atol=2e-5)
        np.testing.assert_allclose(bend[inner], acceleration[1:-1][inner], atol=2e-4)
    for hand in made.hand_position:
        p = made.hand_position[hand]
        np.testing.assert_allclose(
            ((p[2:] - p[:-2]) / (2 * dt))[inner], made.hand_velocity[hand][1:-1][inner], atol=2e-5
        )
        bend = (p[2:] - 2 * p[1:-1] + p[:-2]) / dt**2
        np.testing.assert_allclose(bend[inner], made.hand_acceleration[hand][1:-1][inner], atol=2e-4)


@pytest.mark.parametrize("preset", PRESETS)
def test_waist_and_hands_have_continuous_accelerations(stance, preset):
    """A jump keeps its size when the samples get denser; a continuous acceleration steps less and less.

    Hands of ``paper`` rest at their ends, so that their accelerations jump there, as those of its feet do.
    """
    coarse, fine = (plan(load_gait(preset).replace(rate=rate), stance, 3) for rate in (500.0, 4000.0))
    hands = [] if preset == "paper" else [lambda p: p.hand_acceleration["left_hand"]]
    for of in (lambda p: p.base_acceleration, *hands):
        steps = [np.abs(np.diff(of(made), axis=0)).max() for made in (coarse, fine)]
        assert steps[1] < steps[0] / 6


def test_minimum_jerk_feet_have_continuous_accelerations_and_cubic_ones_do_not(stance):
    def largest_step(preset, rate):
        made = plan(load_gait(preset).replace(rate=rate, Tc=1.0), stance, 3)
        return np.abs(np.diff(made.tip_acceleration["right_foot"], axis=0)).max()

    assert largest_step("walk", 4000.0) < largest_step("walk", 500.0) / 6
    assert largest_step("paper", 4000.0) > largest_step("paper", 500.0) / 2


@pytest.mark.parametrize("preset", PRESETS)
def test_everything_starts_and_ends_at_rest(stance, preset):
    made = plan(load_gait(preset), stance, 4)
    rates = [
        made.base_twist,
        made.base_acceleration,
        *made.tip_twist.values(),
        *made.tip_acceleration.values(),
    ]
    rates += [*made.hand_velocity.values(), *made.hand_acceleration.values()]
    for rate in rates:
        assert np.abs(rate[[0, -1]]).max() < 1e-9


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_plans_any_number_of_steps(stance, preset):
    for steps in (1, 2, 3, 20):
        made = plan(load_gait(preset), stance, steps)
        gait = made.gait
        assert made.duration == pytest.approx((steps + min(2, steps)) * gait.Tc)
        assert len(made.boundaries) == steps + 1
        assert len(made.footholds) == steps + 2
        assert made.phase[-1] == pytest.approx(steps)
        assert ("few" in " ".join(made.notes)) == (steps == 1)


def test_boundaries_are_where_the_waist_stands_between_its_feet(stance):
    made = plan(load_gait("walk").replace(rate=1000.0), stance, 4)
    rows = [int(np.argmin(np.abs(made.time - t))) for t in made.boundaries]
    between = sum(made.T_world_tip[foot][rows, :2, 3] for foot in made.feet) / 2
    assert made.T_world_base[rows, :2, 3] == pytest.approx(between, abs=1e-6)


def test_walking_backwards_is_walking_forwards_seen_in_a_mirror(stance):
    ahead = plan(load_gait("backwards").replace(stride=0.075, hand_swing=0.03), stance, 4)
    back = plan(load_gait("backwards"), stance, 4)
    mirror = np.array([-1.0, 1.0, 1.0])
    pairs = [(ahead.T_world_base[:, :3, 3], back.T_world_base[:, :3, 3])]
    pairs += [(ahead.T_world_tip[foot][:, :3, 3], back.T_world_tip[foot][:, :3, 3]) for foot in ahead.feet]
    pairs += [(ahead.hand_position[hand], back.hand_position[hand]) for hand in ahead.hand_position]
    for forwards, backwards in pairs:
        np.testing.assert_allclose(forwards * mirror, backwards, atol=1e-15)
    assert back.T_world_base[-1, 0, 3] < -0.15


def test_starting_with_the_other_foot_mirrors_left_and_right(stance):
    right, left = (plan(load_gait("walk").replace(first=first), stance, 3) for first in ("right", "left"))
    mirror = np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(right.T_world_base[:, :3, 3] * mirror, left.T_world_base[:, :3, 3], atol=1e-15)
    for a, b in (("right", "left"), ("left", "right")):
        foot = right.T_world_tip[f"{a}_foot"][:, :3, 3] * mirror
        np.testing.assert_allclose(foot, left.T_world_tip[f"{b}_foot"][:, :3, 3], atol=1e-15)
        hand = right.hand_position[f"{a}_hand"] * mirror
        np.testing.assert_allclose(hand, left.hand_position[f"{b}_hand"], atol=1e-15)


def test_sway_scales_the_lateral_motion_and_nothing_else(stance):
    full, none = (plan(load_gait("walk").replace(sway=sway), stance, 3) for sway in (1, 0))
    assert not none.T_world_base[:, 1, 3].any()
    np.testing.assert_array_equal(full.T_world_base[:, 0, 3], none.T_world_base[:, 0, 3])


def test_the_waist_turns_with_its_path(stance):
    made = plan(load_gait("turn"), stance, 6)
    assert np.degrees(yaw_of(made.T_world_base)[-1]) == pytest.approx(30)
    assert np.degrees(yaw_of(made.T_world_tip["right_foot"])[-1]) == pytest.approx(30)
    assert np.abs(made.T_world_base[:, :2, 3]).max() < 0.05


def test_sideways_the_waist_waits_over_the_supporting_foot(stance):
    made = plan(load_gait("sideways"), stance, 6)
    for foot, other in (("right_foot", "left_foot"), ("left_foot", "right_foot")):
        alone = ~made.contact[:, made.feet.index(other)]
        away = np.abs(made.T_world_base[:, 1, 3] - made.T_world_tip[foot][:, 1, 3])[alone]
        assert away.max() < 0.033 - 0.009


def test_a_free_waist_path_is_the_sum_its_coefficients_say(stance):
    """Differences, rest at both ends, and a path without coefficients for the ends compared by hand."""
    document = load_gait("walk").to_dict()
    document["waist"] = {"forward": [0.02, 0.01], "side": [0.04, 0.0, 0.0, 0.005]}
    made = plan(gait_from_dict(document), stance, 4)
    p = made.phase
    progress = p + 0.02 * np.sin(2 * np.pi * p) + 0.01 * np.cos(2 * np.pi * p)
    np.testing.assert_allclose(made.T_world_base[:, 0, 3], 0.05 + 0.1 * progress, atol=1e-12)
    side = 0.04 * np.sin(np.pi * p) + 0.005 * np.cos(3 * np.pi * p)
    np.testing.assert_allclose(made.T_world_base[:, 1, 3], side, atol=1e-12)


def test_start_and_stop_of_a_free_waist_path_vanish_smoothly_and_mirror_each_other(stance):
    document = load_gait("walk").to_dict()
    document["gait"]["rate"] = 2000.0
    base = document["waist"] = {"side": [0.04, 0.0]}
    plain = plan(gait_from_dict(document), stance, 4)
    bumps = [0.003, -0.002, 0.001]
    document["waist"] = {**base, "start_side": bumps, "stop_side": bumps, "span": 0.8}
    document["waist"] |= {"start_forward": [0.05], "stop_forward": [-0.2, 0.1]}
    made = plan(gait_from_dict(document), stance, 4)
    extra = made.T_world_base[:, 1, 3] - plain.T_world_base[:, 1, 3]
    inside = (made.phase < 0.8) | (made.phase > 3.2)
    assert np.abs(extra[inside]).max() > 5e-4
    assert np.abs(extra[~inside]).max() < 1e-15
    # The first step is supported by the left foot and the last by the right one.
    np.testing.assert_allclose(extra, -extra[::-1], atol=1e-12)
    dt = made.time[1] - made.time[0]
    way = made.T_world_base[:, :2, 3]
    np.testing.assert_allclose((way[2:] - way[:-2]) / (2 * dt), made.base_twist[1:-1, 3:5], atol=1e-5)
    bend = (way[2:] - 2 * way[1:-1] + way[:-2]) / dt**2
    np.testing.assert_allclose(bend, made.base_acceleration[1:-1, 3:5], atol=3e-3)
    assert np.abs(np.diff(made.base_acceleration, axis=0)).max() < 0.01


def test_a_robot_without_arms_has_no_hands_in_its_plan(stance):
    made = plan(load_gait("walk"), Stance(stance.foot_y, stance.feet), 2)
    assert not made.hand_position


def test_a_plan_cannot_be_changed(stance):
    made = plan(load_gait("walk"), stance, 1)
    with pytest.raises(ValueError, match="read-only"):
        made.T_world_tip["left_foot"][0, 0, 3] = 1.0


@pytest.mark.parametrize("steps", [0, -1, 1.5, 2.0, True, "3", None])
def test_a_number_of_steps_that_is_none_is_refused(stance, steps):
    with pytest.raises(InputError, match="whole number, at least 1"):
        plan(load_gait("walk"), stance, steps)


@pytest.mark.parametrize("rate", [1e9, 1e-3])
def test_too_many_or_too_few_samples_are_refused(stance, rate):
    with pytest.raises(GaitError, match="samples"):
        plan(load_gait("walk").replace(rate=rate), stance, 3)


def test_absurd_sizes_are_refused_in_words(stance):
    with pytest.raises(GaitError, match="beyond all numbers"):
        plan(load_gait("walk").replace(stride=1e308), stance, 3)


def test_a_preview_gait_is_not_planned_from_key_points(stance):
    with pytest.raises(GaitError, match="preview"):
        plan(load_gait("walk").replace(kind="preview"), stance, 3)


def test_a_stance_tells_all_its_faults(stance):
    one = Foot("right_foot", -1, ((0.0, 0.0), (1.0, 0.0)))
    with pytest.raises(ShapeError, match=r"one \+1 \(left\).*foot_y is nan.*sole of right_foot"):
        Stance(float("nan"), (one, one))


@pytest.mark.parametrize("preset", ["walk", "turn", "smooth"])
def test_a_rate_that_cannot_show_the_swing_is_refused(preset: str, stance) -> None:
    gait = load_gait(preset)
    with pytest.raises(
        GaitError, match=r"key rate: 50 per second is 0\.\d+ samples in a swing of .* raise rate"
    ):
        plan(gait.replace(Tc=0.01), stance, 2)
    made = plan(gait.replace(Tc=0.01, rate=320), stance, 2)
    assert not made.contact.all()
