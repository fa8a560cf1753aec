"""Pictures of the balance: GCoM against ZMP, the margin, and the walk seen from above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.account import Account
from screwkin.analysis.placed_soles import placed_soles, support_polygons
from screwkin.dynamics.support import Spike
from screwkin.mechanism.singularity import NEAR
from screwkin.report.style import (
    GCOM,
    PLAIN,
    SIDES,
    ZMP,
    Axes,
    Figure,
    finished,
    foot_colours,
    legend_above,
    mark_steps,
    new_figure,
    shade_swings,
    shown,
    spans,
    time_figure,
)

_AXES = ("x", "y")
_APART = 0.018  # of the duration: labels of spikes nearer than that would overlap


def zmp_against_gcom(account: Account, axis: int) -> Figure:
    """GCoM and ZMP against time along x (0) or y (1), and how far they are apart, with the spikes' times."""
    time, balance = account.trajectory.time, account.balance
    scale, unit = (1.0, "m") if np.ptp(balance.com[:, axis]) > 0.3 else (1e3, "mm")
    figure, (place, apart) = new_figure(4.6, 2, sharex=True, height_ratios=(3, 2))
    low, high = _extent(account, axis)
    place.fill_between(
        time, scale * low, scale * high, step="post", color="#EFEFEA", linewidth=0, label="support polygon"
    )
    place.plot(time, scale * balance.com[:, axis], color=GCOM, label="GCoM")
    place.plot(time, scale * balance.zmp[:, axis], color=ZMP, linewidth=1.2, label="ZMP")
    mark_steps(place, account)
    place.set_ylabel(f"{_AXES[axis]} of GCoM and ZMP [{unit}]")
    difference = 1e3 * (balance.zmp - balance.com[:, :2])[:, axis]
    shade_swings(apart, account)
    apart.plot(time, difference, color=PLAIN, linewidth=1.1, label="ZMP - GCoM")
    apart.axhline(0.0, color="#999999", linewidth=0.7)
    _label_spikes(apart, balance.spikes, time, difference)
    apart.set_ylabel("ZMP - GCoM [mm]")
    return finished(figure, account, columns=4)


def _extent(account: Account, axis: int) -> tuple[Array, Array]:
    """Least and largest coordinate (T,) of the support polygon."""
    low, high = (np.full(account.trajectory.samples, np.nan) for _ in range(2))
    for begin, end, polygon in support_polygons(account):
        low[begin : end + 1], high[begin : end + 1] = polygon[:, axis].min(), polygon[:, axis].max()
    return low, high


def margin_over_time(account: Account) -> Figure:
    """The ZMP's margin, and its distance from the GCoM with the spikes and their times."""
    time, balance = account.trajectory.time, account.balance
    figure, (inside, distance) = time_figure(account, 4.6, 2)
    margin = 1e3 * balance.margin
    inside.plot(time, margin, color=ZMP, label="margin of the ZMP")
    inside.axhline(0.0, color="#B00020", linewidth=1.0, label="border of the support polygon")
    for begin, end in spans(account.outside):
        inside.axvspan(time[begin], time[end], color="#B00020", alpha=0.25, linewidth=0, label=None)
    worst = int(margin.argmin())
    inside.plot(time[worst], margin[worst], "o", color=ZMP, markersize=4)
    inside.annotate(
        f"{margin[worst]:.1f} mm at {time[worst]:.2f} s",
        (time[worst], margin[worst]),
        xytext=(8, -3),
        textcoords="offset points",
        va="top",
        fontsize=8,
        color=ZMP,
    )
    inside.set_ylim(min(0.0, margin.min()) - 0.16 * np.ptp(margin), None)
    inside.set_ylabel("margin [mm]")
    apart = 1e3 * balance.distance
    distance.plot(time, apart, color=PLAIN, linewidth=1.1, label="|GCoM - ZMP|")
    threshold = 2.0 * float(np.median(apart))
    distance.axhline(threshold, color=PLAIN, linewidth=0.8, linestyle=":", label="twice its median")
    _label_spikes(distance, balance.spikes, time, apart)
    distance.set_ylabel("|GCoM - ZMP| [mm]")
    return finished(figure, account, columns=4)


def _label_spikes(axes: Axes, spikes: Sequence[Spike], time: Array, value: Array) -> None:
    """Mark every spike, and write the time of the largest one wherever several stand close together."""
    duration = time[-1] - time[0]
    at = [int(np.abs(time - spike.time).argmin()) for spike in spikes]
    if at:
        axes.plot(time[at], value[at], "o", color=ZMP, markersize=3, label="spike, with its time [s]")
    chosen: list[Spike] = []
    for spike, i in sorted(zip(spikes, at, strict=True), key=lambda pair: -pair[0].distance):
        if all(abs(spike.time - other.time) > _APART * duration for other in chosen):
            chosen.append(spike)
            up = value[i] >= 0
            axes.annotate(
                f"{spike.time:.2f}",
                (time[i], value[i]),
                xytext=(0, 4 if up else -4),
                textcoords="offset points",
                ha="center",
                va="bottom" if up else "top",
                fontsize=6.5,
                color=ZMP,
                rotation=90,
            )
    low, high = min(0.0, float(value.min())), max(0.0, float(value.max()))
    room = 0.32 * (high - low or 1.0)
    axes.set_ylim(low - (room if low < 0 else 0), high + (room if high > 0 else 0))


def seen_from_above(account: Account) -> Figure:
    """Soles where they stand, support polygons, and the paths of GCoM and ZMP."""
    balance, soles = account.balance, placed_soles(account)
    everything = np.concatenate([soles.reshape(-1, 2), balance.zmp, balance.com[:, :2]])
    size = np.ptp(everything, axis=0)
    figure, axes = new_figure(1.0 + float(np.clip(8.0 * size[1] / size[0], 1.2, 5.5)))
    for polygon in _different([polygon for _, _, polygon in support_polygons(account)]):
        axes.fill(*polygon.T, facecolor="#77777712", edgecolor="#77777755", linewidth=0.6)
    draw_soles(axes, account, soles)
    axes.fill([], [], facecolor="#77777722", edgecolor="#77777777", label="support polygons")
    axes.plot(*balance.com[:, :2].T, color=GCOM, label="GCoM")
    axes.plot(*balance.zmp.T, color=ZMP, linewidth=1.1, label="ZMP")
    out = account.outside
    if out.any():
        axes.plot(*balance.zmp[out].T, ".", color="#B00020", markersize=4, label="ZMP outside")
    axes.set_aspect("equal")
    axes.grid(True, axis="both")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    legend_above(figure, [axes], columns=6)
    return figure


def draw_soles(axes: Axes, account: Account, soles: Array) -> None:
    """Outlines of the soles (T, feet, corners, 2) [m], once in every place where one stands."""
    for k, (foot, colour) in enumerate(foot_colours(account).items()):
        for n, at in enumerate(_placements(soles[:, k], account.trajectory.contact[:, k])):
            label = f"{shown(foot)} on the floor" if n == 0 else None
            corners = np.vstack([soles[at, k], soles[at, k, :1]])
            axes.plot(*corners.T, color=colour, linewidth=1.3, label=label)


def _different(polygons: Sequence[Array]) -> list[Array]:
    """Every polygon once, however often it recurs."""
    return list({tuple(np.sort(polygon.round(6), axis=0).ravel()): polygon for polygon in polygons}.values())


def _placements(corners: Array, contact: Array) -> list[int]:
    """Samples amid the spans in which a sole stands in one place, each place once."""
    places: list[int] = []
    for begin, end in spans(contact):
        middle = (begin + end) // 2
        if not any(np.abs(corners[middle] - corners[other]).max() < 1e-6 for other in places):
            places.append(middle)
    return places


def singular_values_over_time(account: Account) -> Figure | None:
    """The least singular value of every limb along the motion; None for a robot without limbs."""
    if not account.sigma:
        return None
    colours = {limb.name: limb.kind for limb in account.robot.limbs}
    figure, axes = new_figure(2.8)
    mark_steps(axes, account)
    for k, (name, sigma) in enumerate(account.sigma.items()):
        style = "--" if colours.get(name) == "arm" else "-"
        axes.plot(account.trajectory.time, sigma, color=SIDES[k % 2], linestyle=style, label=shown(name))
    axes.axhline(NEAR, color="#B00020", linewidth=0.9, label="near singular below")
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("least singular value [1]")
    return finished(figure, account)
