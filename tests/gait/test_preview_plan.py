"""Preview gaits: phases, references, and a CoM that follows its cart in all three derivatives."""

from __future__ import annotations

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import GaitError, InputError, NoSolutionError
from screwkin.gait.footsteps import footholds
from screwkin.gait.plan import plan
from screwkin.gait.preview import follow_reference, preview_gains
from screwkin.gait.preview_plan import preview_plan, zmp_reference
from screwkin.gait.stance import stance_of
from screwkin.model.library import find_robot
from screwkin.model.table import parse_robot


@pytest.fixture(scope="module")
def robot() -> sk.Robot:
    return sk.load_robot("poppy12")


@pytest.fixture(scope="module")
def gait() -> sk.Gait:
    return sk.load_gait("paper-poppy12")


@pytest.fixture(scope="module")
def walked(robot: sk.Robot, gait: sk.Gait) -> sk.Trajectory:
    return sk.walk(robot, gait, steps=3)


def test_fifteen_phases_of_a_second_are_750_samples(robot: sk.Robot, gait: sk.Gait) -> None:
    made = preview_plan(sk.closed_mechanism(robot), gait.replace(com="waist"), stance_of(robot), 13)
    assert len(made.time) == 750
    assert made.time[-1] == pytest.approx(14.98)
    assert made.contact[:50].all()
    assert made.contact[-50:].all()
    assert [made.contact[50 * n + 30].tolist() for n in (1, 2, 3)] == [
        [False, True],
        [True, False],
        [False, True],
    ]
    start, end = made.T_world_base[[0, -1], 0, 3]
    assert end - start == pytest.approx(0.68, abs=2e-3)


def test_the_reference_ramps_between_soles_and_rests_in_the_middle(robot: sk.Robot, gait: sk.Gait) -> None:
    stance, time = stance_of(robot), np.arange(750) / 50
    reference = zmp_reference(gait, stance, footholds(gait, stance, 13), 13, time)
    assert np.abs(reference[:51]).max() < 1e-12
    side = reference[:, 1]
    assert side[60] == pytest.approx(-0.048)
    assert side[99] == pytest.approx(-0.048)
    assert side[105] == pytest.approx(0.0, abs=1e-12)
    assert side[110:150] == pytest.approx(0.048)
    assert reference[700:710, 1] == pytest.approx(np.linspace(side[699], 0, 11)[:10])
    assert reference[110:150, 0] == pytest.approx(0.68 / 12)


def test_the_com_of_all_links_follows_the_cart_with_rates_and_accelerations(
    robot: sk.Robot, gait: sk.Gait, walked: sk.Trajectory
) -> None:
    stance, time = stance_of(robot), walked.time
    reference = zmp_reference(gait, stance, footholds(gait, stance, 3), 3, time)
    cart = follow_reference(preview_gains(0.02, walked.com[0, 2], 1.6), reference)
    np.testing.assert_allclose(walked.com[:, :2], cart.com, atol=1e-8)
    J = sk.com_jacobian(robot, sk.State(walked.T_world_base, walked.q))
    velocity = (J @ np.concatenate([walked.base_twist, walked.qd], axis=1)[..., None])[:, :2, 0]
    np.testing.assert_allclose(velocity, cart.velocity, atol=1e-9)
    force = sk.zmp(robot, walked).wrench[:, 3:5]
    np.testing.assert_allclose(force / robot.mass, cart.acceleration, atol=1e-8)


def test_the_naive_plan_leaves_the_soles_in_single_support_where_the_true_com_keeps_well_inside(
    robot: sk.Robot, gait: sk.Gait, walked: sk.Trajectory
) -> None:
    """At the gait's own numbers, and at those of the paper: steps of 6 cm, waist at 0.43 m, lift of 5 cm."""
    assert sk.zmp(robot, walked).margin.min() > 0.015
    for change in ({}, {"stride": 0.12, "waist_height": 0.43, "lift": 0.05}):
        naive = sk.walk(robot, gait.replace(com="waist", **change))
        outside = sk.zmp(robot, naive).margin < -1e-3
        assert outside.mean() > 0.1
        assert not outside[naive.contact.all(axis=1)].any()


def test_the_face_of_the_foot_that_bears_decides_whether_the_naive_plan_keeps_inside(gait: sk.Gait) -> None:
    """The whole outline of table 3, 63 mm wide, would hold its ZMP; 50 mm do not. Nothing else changes."""
    table = find_robot("poppy12").read_text(encoding="utf-8")
    whole = parse_robot(table.replace('sole_edge = "6.5*mm"', "sole_edge = 0.0"))
    naive = sk.walk(whole, gait.replace(com="waist"))
    least = sk.zmp(whole, naive).margin.min()
    narrower = sk.zmp(sk.load_robot("poppy12"), naive).margin.min()
    assert 0.003 < least < 0.006
    assert narrower == pytest.approx(least - 0.0065, abs=1e-9)


@pytest.mark.parametrize("roll", [0.0, 0.02])
def test_the_wanted_zmp_rolls_over_each_sole_from_where_the_other_foot_leaves_to_where_it_lands(
    roll: float,
) -> None:
    gait = sk.load_gait("preview").replace(roll=roll)
    stance, steps = stance_of(sk.load_robot("bioloid")), 4
    holds = footholds(gait, stance, steps)
    time = np.arange(0, (steps + 2) * gait.Tc, 0.01)
    wanted = zmp_reference(gait, stance, holds, steps, time)
    assert np.abs(np.diff(wanted, axis=0)).max() < 0.01  # without a jump
    stood = holds[3]  # the left foot, on which the robot stands while the right one makes its second step
    single = (time > 3 * gait.Tc + 0.2 * gait.Tc + 1e-9) & (time < 4 * gait.Tc - 1e-9)
    at = wanted[single] - [stood.x, stood.y]
    np.testing.assert_allclose(at[:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(at[[0, -1], 0], [-roll, roll], atol=6e-4)
    assert (np.diff(at[:, 0]) >= -1e-12).all()


def test_feet_may_not_overlap_even_where_their_soles_do_not(robot: sk.Robot, gait: sk.Gait) -> None:
    """Feet of 63 mm touch 31.5 mm from the middle; what bears is 50 mm wide."""
    with pytest.raises(NoSolutionError, match=r"left_foot and right_foot overlap .* by up to 1\.0 mm"):
        sk.walk(robot, gait.replace(spread=0.031 - 0.048))


def test_another_robot_with_arms_walks_by_preview_too() -> None:
    robot = sk.load_robot("bioloid")
    walked = sk.walk(robot, sk.load_gait("preview"), steps=4)
    assert sk.zmp(robot, walked).margin.min() > 0.02
    travelled = walked.T_world_base[-1, 0, 3] - walked.T_world_base[0, 0, 3]
    assert travelled == pytest.approx(3 * 0.06, abs=2e-3)


def test_feet_side_by_side_at_the_start_and_at_the_end(robot: sk.Robot, gait: sk.Gait) -> None:
    holds = footholds(gait.replace(stride=0.12), stance_of(robot), 3)
    assert [hold.x for hold in holds] == pytest.approx([0, 0, 0.06, 0.12, 0.12])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"horizon": 0.5}, "shorter than a step"),
        ({"R": 0}, "R: 0 is out of range"),
        ({"Qe": -1}, "Qe: -1 is out of range"),
        ({"com": "torso"}, "Valid: true, waist"),
        ({"lateral": "sway"}, "Valid: shift, lean, tilt"),
    ],
)
def test_settings_out_of_range_are_refused(
    robot: sk.Robot, gait: sk.Gait, change: dict[str, object], message: str
) -> None:
    with pytest.raises(GaitError, match=message):
        sk.walk(robot, gait.replace(**change), steps=2)


def test_steps_must_be_whole_and_a_preview_gait_is_not_made_of_key_points(
    robot: sk.Robot, gait: sk.Gait
) -> None:
    with pytest.raises(InputError, match="steps is 0"):
        sk.walk(robot, gait, steps=0)
    with pytest.raises(GaitError, match="preview"):
        plan(gait, stance_of(robot), 2)


@pytest.mark.parametrize(("robot_name", "name"), [("bioloid", "preview"), ("poppy12", "poppy12-preview")])
def test_the_zmp_of_preview_walks_stays_well_inside_the_soles(robot_name: str, name: str) -> None:
    robot = sk.load_robot(robot_name)
    assert sk.zmp(robot, sk.walk(robot, sk.load_gait(name))).margin.min() > 0.020
