"""Picture of two parallel axes going out of line: how the numbers of DH tables and of screws answer."""

from __future__ import annotations

from pathlib import Path

from screwkin.analysis.misalignment import Misalignment
from screwkin.model.dh_derive import PARALLEL
from screwkin.report.style import PLAIN, SIDES, Figure, new_figure, save_figure, shown, styled

_DH, _SCREW = SIDES[0], SIDES[1]


def misalignment_plot(series: Misalignment) -> Figure:
    """Change of the tables against the tilt, and the error of the tip that a DH table cannot avoid."""
    figure, (change, error) = new_figure(3.9, 1, 2)
    tilt = series.tilt
    change.loglog(
        tilt, series.dh_length, "o-", color=_DH, markersize=4, label="DH: largest change of a, d [m]"
    )
    change.loglog(tilt, series.dh_angle, "s--", color=_DH, markersize=4, label="DH: of alpha, offset [rad]")
    change.loglog(
        tilt, series.screw_change, "D-", color=_SCREW, markersize=4, label="screws: of any number [1 or m]"
    )
    change.set_ylabel("change of the table's numbers")
    error.loglog(
        tilt,
        series.dh_error,
        "o-",
        color=_DH,
        markersize=4,
        label="normal where it is: rounding of far origins",
    )
    error.loglog(
        tilt,
        series.parallel_error,
        "s--",
        color=_DH,
        markersize=4,
        label="axes taken as parallel: tilt left out",
    )
    error.axvline(PARALLEL, color=PLAIN, linewidth=0.9, linestyle=":", label="below: taken as parallel here")
    error.set_ylabel("error of the tip by DH [m and 1]")
    for axes in (change, error):
        axes.set_xlabel(f"tilt of {shown(series.joints[1])} [rad]")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
        axes.grid(True, axis="both")
    return figure


def save_misalignment(series: Misalignment, path: Path) -> Path:
    """Draw and write the picture as PNG.

    Raises:
        OutputError: it cannot be written.
    """
    with styled():
        return save_figure(misalignment_plot(series), path)
