"""One answer of statics: a sample alone is the sample in any batch, after any history, on every path."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from screwkin.dynamics.margin import support_margin

BATCHES = (7, 999, 5000)
seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, feet=st.integers(1, 3), corners=st.integers(1, 5), grid=st.sampled_from([None, 0.05]))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_a_margin_does_not_depend_on_its_neighbours(seed, feet, corners, grid):
    """Soles of any outline, also on a coarse grid, where corners coincide and lie in one line."""
    rng = np.random.default_rng(seed)
    zmp, soles = rng.uniform(-0.2, 0.2, (5000, 2)), rng.uniform(-0.15, 0.15, (5000, feet, corners, 2))
    if grid:
        zmp, soles = grid * np.round(zmp / grid), grid * np.round(soles / grid)
    contact = rng.random((5000, feet)) > 0.3
    together = support_margin(zmp, soles, contact)
    for count in BATCHES[:-1]:
        np.testing.assert_array_equal(
            support_margin(zmp[:count], soles[:count], contact[:count]), together[:count]
        )
    for k in range(20):
        alone = support_margin(zmp[k : k + 1], soles[k : k + 1], contact[k : k + 1])
        np.testing.assert_array_equal(alone, together[k : k + 1])
