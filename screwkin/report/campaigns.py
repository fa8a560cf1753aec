"""Pictures of a campaign: how often a robot falls, and its margin, over what was varied."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.campaign.outcome import Outcome
from screwkin.campaign.plan import Campaign
from screwkin.campaign.statistics import Tally, tally
from screwkin.report.style import MEASURED, PLAIN, ZMP, Axes, Figure, new_figure, titled

Grid = Sequence[Sequence[Tally]]


def campaign_pictures(campaign: Campaign, outcomes: Mapping[int, Outcome]) -> dict[str, Callable[[], Figure]]:
    """What draws each picture, by file name; none if nothing was varied.

    The axis with most values lies across, the next one up; rows of all other settings are counted together.
    """
    across, up = _two_axes(campaign)
    if across is None:
        return {}
    grid = _grid(campaign, outcomes, across, up)
    if up is None:
        return {"falls.png": lambda: _curves(campaign, across, [row[0] for row in grid])}
    return {"falls.png": lambda: _maps(campaign, across, up, grid)}


def _two_axes(campaign: Campaign) -> tuple[str | None, str | None]:
    """The two keys with most values, the first of equals first."""
    keys = sorted(campaign.varied, key=lambda key: -len(campaign.axes[key]))
    return (keys[0] if keys else None), (keys[1] if len(keys) > 1 else None)


def _grid(campaign: Campaign, outcomes: Mapping[int, Outcome], across: str, up: str | None) -> Grid:
    """Counts by the value of the axis across, then by that of the axis up."""
    cells: dict[tuple[str, str], list[Outcome]] = {}
    for row in campaign.rows:
        if row.index in outcomes:
            place = row.values[across], row.values[up] if up else ""
            cells.setdefault(place, []).append(outcomes[row.index])
    ups = campaign.axes[up] if up else ("",)
    return [[tally(cells.get((a, b), [])) for b in ups] for a in campaign.axes[across]]


def _curves(campaign: Campaign, across: str, tallies: Sequence[Tally]) -> Figure:
    """Share of falls with its interval above, the margin below."""
    figure, (falls, margin) = new_figure(4.6, 2, sharex=True)
    values = campaign.axes[across]
    x = _places(values)
    shares = np.array([np.nan if t.share is None else 100 * t.share for t in tallies])
    bounds = np.array([(np.nan, np.nan) if t.interval is None else t.interval for t in tallies]).T * 100
    falls.errorbar(x, shares, np.abs(bounds - shares), fmt="o-", color=ZMP, capsize=3)
    falls.set_ylabel("falls [%]")
    falls.set_ylim(-3, 103)
    margin.plot(x, [np.nan if t.margin_mm is None else t.margin_mm for t in tallies], "o-", color=MEASURED)
    margin.axhline(0.0, color=PLAIN, linewidth=0.8)
    margin.set_ylabel("least planned margin [mm]")
    _label(margin, across, values, x)
    return titled(figure, 2, _title(campaign, "falls with 95 % intervals, and the plan's margin"))


def _maps(campaign: Campaign, across: str, up: str, grid: Grid) -> Figure:
    """Share of falls and margin over two axes, as cells."""
    figure, axes = new_figure(3.9, 1, 2, sharey=True)
    shares = _cells(grid, lambda t: None if t.share is None else 100 * t.share)
    margins = _cells(grid, lambda t: t.margin_mm)
    size = float(np.nanmax(np.abs(margins))) if np.isfinite(margins).any() else 1.0
    parts = (
        (shares, "magma_r", 0.0, 100.0, "falls [%]"),
        (margins, "RdBu", -size, size, "least margin [mm]"),
    )
    for axis, (values, colours, least, most, label) in zip(axes, parts, strict=True):
        shade = axis.pcolormesh(values, cmap=colours, vmin=least, vmax=most, edgecolors="white", linewidth=1)
        figure.colorbar(shade, ax=axis, label=label)
        axis.grid(False)
        _write_cells(axis, values, 60.0 if colours == "magma_r" else np.inf)
        _label(axis, across, campaign.axes[across], np.arange(len(grid)) + 0.5)
    axes[0].set_yticks(np.arange(len(campaign.axes[up])) + 0.5, campaign.axes[up])
    axes[0].set_ylabel(up)
    figure.suptitle(_title(campaign, "falls, and the plan's margin"), fontsize=10.5)
    return figure


def _cells(grid: Grid, value: Callable[[Tally], float | None]) -> Array:
    """Values (up, across) of a grid; NaN where there is none."""
    numbers = [[value(t) for t in column] for column in grid]
    return np.array([[np.nan if x is None else x for x in column] for column in numbers]).T


def _write_cells(axis: Axes, values: Array, dark: float) -> None:
    """The numbers in their cells where they fit, white beyond ``dark``."""
    if values.size > 150:
        return
    for (k, j), value in np.ndenumerate(values):
        text = "none" if np.isnan(value) else f"{value:.0f}"
        colour = "white" if value > dark else "black"
        axis.text(j + 0.5, k + 0.5, text, ha="center", va="center", fontsize=8, color=colour)


def _places(values: Sequence[str]) -> Array:
    """Where values stand on an axis: at themselves if all are numbers, else side by side."""
    try:
        return np.array([float(value) for value in values])
    except ValueError:
        return np.arange(len(values), dtype=float)


def _label(axis: Axes, key: str, values: Sequence[str], x: Array) -> None:
    axis.set_xlabel(key)
    every = max(1, len(values) // 12)
    axis.set_xticks(x[::every], values[::every])


def _title(campaign: Campaign, what: str) -> str:
    gaits = ", ".join(campaign.axes["gait"])
    return f"{gaits}: {what}; {len(campaign.seeds)} runs a setting"
