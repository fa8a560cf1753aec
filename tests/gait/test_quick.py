"""Quick walks: the ZMP of all links is led, hips turn along, servos stay within their limits."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import screwkin as sk
from screwkin.errors import GaitError
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.footsteps import Foothold, footholds
from screwkin.gait.over_feet import headings
from screwkin.gait.preview import follow_reference, preview_gains
from screwkin.gait.preview_plan import zmp_reference
from screwkin.gait.record import gait_from_dict
from screwkin.gait.stance import stance_of

ROBOT = sk.load_robot("bioloid")
STANCE = stance_of(ROBOT)
QUICK = sk.load_gait("quick")


@cache
def _walk(**changes: float | str) -> sk.Trajectory:
    return sk.walk(ROBOT, QUICK.replace(**{"lead": 0, **changes}), steps=3)


def _beyond(trajectory: sk.Trajectory, gait: sk.Gait) -> float:
    """How far the ZMP of all links is from where preview control would take a cart's, RMS [m]."""
    wanted = zmp_reference(gait, STANCE, footholds(gait, STANCE, 3), 3, trajectory.time)
    gains = preview_gains(1 / gait.rate, trajectory.com[0, 2], gait.numbers["horizon"], R=gait.numbers["R"])
    away = sk.zmp(ROBOT, trajectory).zmp - follow_reference(gains, wanted).zmp
    return float(np.sqrt((away**2).sum(axis=1).mean()))


def test_the_zmp_of_all_links_goes_where_a_carts_would_and_that_of_a_cart_plan_does_not() -> None:
    gait = QUICK.replace(lead=0, rate=50)
    assert _beyond(_walk(rate=50), gait) < 2e-3
    assert _beyond(_walk(rate=50, model="cart"), gait.replace(model="cart")) > 6e-3


@given(
    st.floats(0.0, 1.0),
    st.lists(
        st.tuples(st.floats(-0.1, 0.1), st.floats(0.05, 0.1), st.floats(-0.5, 0.5)), min_size=1, max_size=6
    ),
)
def test_hips_turn_by_their_share_of_the_way_to_the_line_of_the_feet(
    twist: float, ways: list[tuple[float, float, float]]
) -> None:
    """Whatever the steps: with a share of 1 the waist's y axis points from the right foot to the left one."""
    places = [{"x": x, "y": y * (-1) ** (n + 1), "yaw": yaw} for n, (x, y, yaw) in enumerate(ways)]
    gait = sk.load_gait("preview").replace(kind="preview", twist=twist)
    listed = gait_from_dict(
        {**gait.to_dict(), "gait": {**gait.to_dict()["gait"], "kind": "footsteps"}, "foothold": places}
    )
    holds = footholds(listed, STANCE, len(ways))
    heading = headings(listed, STANCE, holds, len(ways))
    straight = headings(listed.replace(twist=0), STANCE, holds, len(ways))
    whole = headings(listed.replace(twist=1), STANCE, holds, len(ways))
    np.testing.assert_allclose(heading - straight, twist * (whole - straight), atol=1e-12)
    stand: dict[str, Foothold] = {hold.foot: hold for hold in holds[:2]}
    for yaw, hold in zip(whole[1:], holds[2:], strict=True):
        stand[hold.foot] = hold
        right, left = (stand[STANCE.foot(side).name] for side in (-1, 1))
        across = np.array([left.x - right.x, left.y - right.y])
        assert np.cos(yaw) * across[0] + np.sin(yaw) * across[1] == pytest.approx(0.0, abs=1e-12)


def test_hips_that_turn_along_spare_the_speed_of_hips() -> None:
    hips = [i for i, name in enumerate(ROBOT.joint_names) if name.endswith("hip_pitch")]
    turned, straight = (np.abs(_walk(rate=50, **change).qd[:, hips]).max() for change in ({}, {"twist": 0}))
    assert turned < 0.8 * straight


@pytest.mark.parametrize(
    ("speed", "Tc", "fastest"),
    [
        (0.2, 0.4, 4.8),
        *(pytest.param(0.15, Tc, 4.8, marks=pytest.mark.slow) for Tc in (0.3, 0.4, 0.5)),
        *(pytest.param(0.2, Tc, 6.0, marks=pytest.mark.slow) for Tc in (0.3, 0.5)),
        pytest.param(0.25, 0.4, 6.0, marks=pytest.mark.slow),
    ],
)
def test_quick_walks_stay_within_servos_of_6_rad_per_second(speed: float, Tc: float, fastest: float) -> None:
    """Six steps from home to home: the feet do not slide, and the ZMP keeps 20 mm inside."""
    walk = sk.walk(ROBOT, QUICK.replace(speed=speed, Tc=Tc), steps=6)
    assert np.abs(walk.qd).max() < fastest
    assert np.abs(walking_torques(ROBOT, walk)).max() < 1.5
    assert walk.margin.min() > 0.02
    ahead = walk.T_world_tip["right_foot"][:, 0, 3]
    landed = np.flatnonzero(np.diff(walk.contact[:, 0].astype(int)) > 0)
    assert np.diff(ahead[landed + 1])[0] / (2 * Tc) == pytest.approx(speed, rel=1e-6)


@pytest.mark.parametrize(("key", "value"), [("ease", 0.0), ("ease", 0.6), ("twist", -0.1), ("twist", 1.1)])
def test_what_is_no_share_is_refused_with_its_range(key: str, value: float) -> None:
    with pytest.raises(GaitError, match=f"key {key}: .* is not .*Give a number"):
        QUICK.replace(**{key: value})


def test_key_points_alone_do_not_turn_the_hips() -> None:
    with pytest.raises(GaitError, match="key points alone"):
        sk.load_gait("walk").replace(twist=0.2)
    assert sk.load_gait("walk").replace(swing="even", ease=0.2).ease == 0.2
