"""Pictures of a simulation: the floor's answer against the plan, uprightness, and the use of the servos."""

from __future__ import annotations

import numpy as np

from screwkin.analysis.account import Account
from screwkin.analysis.validate import Validation
from screwkin.report.style import (
    MEASURED,
    PLAIN,
    WAIST,
    ZMP,
    Axes,
    Figure,
    finished,
    joint_colours,
    legend_above,
    new_figure,
    shown,
    time_figure,
)

_FALLEN = 30.0  # deg


def contact_zmp(account: Account, check: Validation) -> Figure | None:
    """ZMP from contact forces and as planned, and their difference; None where nothing was measured."""
    record = check.zmp
    seen = np.isfinite(record.contact).all(axis=1) if len(record.time) else np.zeros(0, dtype=bool)
    if not seen.any():
        return None
    time, contact, planned = record.time[seen], 1e3 * record.contact[seen], 1e3 * record.planned[seen]
    figure, (side, difference) = time_figure(account, 4.6, 2, height_ratios=(3, 2))
    side.plot(time, planned[:, 1], color=ZMP, linewidth=2.6, alpha=0.45, label="planned")
    side.plot(time, contact[:, 1], color="#222222", linewidth=0.9, label="from contact forces")
    side.set_ylabel("y of the ZMP [mm]")
    difference.plot(
        time, (contact - planned)[:, 0], color=MEASURED, linewidth=1.0, label="difference along x"
    )
    difference.plot(time, (contact - planned)[:, 1], color=PLAIN, linewidth=1.0, label="difference along y")
    difference.axhline(0.0, color="#999999", linewidth=0.7)
    difference.set_ylabel("contact - planned [mm]")
    _mark_fall(difference, check)
    return finished(figure, account, columns=3)


def uprightness(account: Account, check: Validation) -> Figure:
    """Tilt of the base, and its horizontal distance from the plan."""
    run = check.run
    time = run.time
    away = run.T_world_base[:, :2, 3] - run.planned_base[:, :2, 3]
    figure, (tilt, off) = time_figure(account, 3.9, 2)
    degrees = np.degrees(run.tilt)
    tilt.plot(time, degrees, color=WAIST, linewidth=1.0, label="tilt of the base")
    if check.fell:
        tilt.axhline(_FALLEN, color="#B00020", linewidth=1.0, label="fallen")
    tilt.set_ylim(bottom=0.0)
    tilt.set_ylabel("tilt [deg]")
    off.plot(
        time, 1e3 * np.linalg.norm(away, axis=1), color=PLAIN, linewidth=1.0, label="distance from the plan"
    )
    off.set_ylim(bottom=0.0)
    off.set_ylabel("off the plan [mm]")
    off.set_xlabel("time [s]")
    off.set_xlim(min(0.0, time[0]), max(time[-1], account.trajectory.time[-1]))
    for one in (tilt, off):
        _mark_fall(one, check)
    legend_above(figure, [tilt, off], columns=4)
    return figure


def servo_use(account: Account, check: Validation) -> Figure:
    """Largest torque and speed of every joint, as shares of its servo's limits."""
    names = account.robot.joint_names
    figure, axes = new_figure(0.9 + 0.2 * len(names), 1, 2, sharey=True)
    colours = joint_colours(account)
    shares: tuple[tuple[Axes, dict[str, float], str], ...] = (
        (axes[0], check.torque_use, "torque [% of limit], largest 50 ms mean"),
        (axes[1], check.speed_use, "planned speed [% of limit]"),
    )
    for one, use, label in shares:
        values = [100 * use[name] for name in names]
        one.barh(range(len(names)), values, color=[colours[name] for name in names], height=0.7)
        one.axvline(100.0, color="#B00020", linewidth=1.0)
        one.set_xlim(0.0, max(108.0, 1.15 * max(values)))
        one.set_xlabel(label)
        one.grid(True, axis="x")
        one.grid(False, axis="y")
        for k, value in enumerate(values):
            one.text(value + 1.5, k, f"{value:.0f}", va="center", fontsize=7, color="#555555")
    axes[0].set_yticks(range(len(names)), [shown(name) for name in names], fontsize=8)
    axes[0].invert_yaxis()
    return figure


def _mark_fall(axes: Axes, check: Validation) -> None:
    if check.fell_at is not None:
        axes.axvline(check.fell_at, color="#B00020", linewidth=1.4, linestyle="--", label="fell")
