"""The picture of axes going out of line is drawn from the series, and the same again from the same series."""

from __future__ import annotations

import numpy as np

from screwkin.analysis.chains import chains_of
from screwkin.analysis.misalignment import misalignment
from screwkin.model.table import load_robot
from screwkin.report.misalignment import misalignment_plot, save_misalignment


def test_the_picture_shows_the_series_on_logarithmic_axes(tmp_path):
    series = misalignment(chains_of(load_robot("poppy12")))
    assert series is not None
    change, error = misalignment_plot(series).axes
    drawn = [line.get_ydata() for line in change.lines]
    for expected, found in zip((series.dh_length, series.dh_angle, series.screw_change), drawn, strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(error.lines[1].get_ydata(), series.parallel_error)
    assert {axes.get_xscale() for axes in (change, error)} == {"log"}
    first, second = (save_misalignment(series, tmp_path / name).read_bytes() for name in ("a.png", "b.png"))
    assert first == second
    assert first.startswith(b"\x89PNG")
