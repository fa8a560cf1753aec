"""Preview control: gains against known figures and an independent optimum, tracking of a reference."""

from __future__ import annotations

import numpy as np
import pytest

from screwkin.errors import InputError
from screwkin.gait.preview import follow_reference, preview_gains
from screwkin.kinematics.mass import GRAVITY


def test_gains_of_a_setting_that_others_report() -> None:
    """T .02 s, CoM .43 m, Qe 1, R 1e-6, horizon 1.6 s: the figures that others report for these values."""
    gains = preview_gains(0.02, 0.43, 1.6)
    assert gains.Ks == pytest.approx(460.4127, abs=1e-3)
    assert gains.Kx == pytest.approx([10415.39, 2460.31, 63.310], abs=6e-3)
    assert len(gains.G) == 80


def test_the_law_is_the_optimum_of_its_cost() -> None:
    """Over a long window the closed loop follows the least-squares optimum of all its jerks."""
    h, n = 0.05, 160
    gains = preview_gains(h, 0.3, 4.0, Qe=1.0, R=1e-4)
    reference = np.zeros((n, 1))
    reference[40:90], reference[90:] = 0.05, -0.02
    cart = follow_reference(gains, reference)

    # The same cost minimised directly over all increments of the jerk, which the sampled cart maps linearly.
    response = np.zeros((n, n))
    for k in range(n):
        x, jerk = np.zeros(3), 0.0
        for i in range(n):
            response[i, k] = gains.C @ x
            jerk += 1.0 if i == k else 0.0
            x = gains.A @ x + gains.B * jerk
    stacked = np.concatenate([response, 1e-2 * np.eye(n)])
    best = np.linalg.lstsq(stacked, np.concatenate([reference[:, 0], np.zeros(n)]), rcond=None)[0]
    middle = slice(5, 110)  # the window's end makes the direct optimum differ there
    np.testing.assert_allclose(cart.zmp[middle, 0], (response @ best)[middle], atol=2e-4)


def test_the_zmp_follows_steps_from_foot_to_foot() -> None:
    levels = [0.0, *(0.048 * (-1) ** n for n in range(13)), 0.0]
    knots = [0.0, *(t for n in range(1, 15) for t in (n, n + 0.2))]
    values = [0.0, *(y for n in range(1, 15) for y in levels[n - 1 : n + 1])]
    reference = np.interp(np.arange(750) * 0.02, knots, values)[:, None]
    cart = follow_reference(preview_gains(0.02, 0.43, 1.6), reference)
    assert np.abs(cart.zmp - reference).max() < 0.0033
    lift = cart.com - 0.43 / GRAVITY * cart.acceleration
    np.testing.assert_allclose(lift, cart.zmp, atol=1e-12)


def test_a_standing_reference_leaves_the_cart_at_rest_where_it_is() -> None:
    cart = follow_reference(preview_gains(0.02, 0.24, 1.6), np.full((200, 2), 0.3))
    assert np.abs(cart.com - 0.3).max() < 1e-12
    assert np.abs(cart.velocity).max() < 1e-12


def test_beyond_its_end_a_reference_stays_at_its_last_value() -> None:
    """One cut off in the middle of a step moves as one that goes on at the value it was cut at."""
    gains = preview_gains(0.02, 0.43, 1.6)
    reference = 0.05 * np.sin(np.linspace(0.0, 7.0, 120))[:, None] + [0.1, -0.2]
    on = follow_reference(gains, np.concatenate([reference, np.repeat(reference[-1:], 90, axis=0)]))
    cut = follow_reference(gains, reference)
    for name in ("com", "velocity", "acceleration", "zmp"):
        np.testing.assert_allclose(getattr(cut, name), getattr(on, name)[:120], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"period": 0.0}, "period"),
        ({"com_height": -0.2}, "com_height"),
        ({"com_height": np.nan}, "com_height"),
        ({"horizon": 0.001}, "at least one sampling period"),
        ({"R": 0.0}, "R is"),
    ],
)
def test_values_out_of_range_are_refused(values: dict[str, float], message: str) -> None:
    good = {"period": 0.02, "com_height": 0.43, "horizon": 1.6}
    with pytest.raises(InputError, match=message):
        preview_gains(**(good | values))
