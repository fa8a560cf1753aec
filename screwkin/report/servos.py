"""The picture of a play on servos: commanded against measured."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.account import Account
from screwkin.report.motion import joints_shown
from screwkin.report.style import PLAIN, Axes, Figure, legend_above, shown, time_figure
from screwkin.servo.log import PlayLog


def tracking(account: Account, log: PlayLog) -> Figure:
    """Commands and readings of the legs' joints, one panel a leg, and the tracking error of all joints."""
    robot = account.robot
    legs = [limb for limb in robot.limbs if limb.kind == "leg"]
    start = log.start if np.isfinite(log.start) else 0.0
    time, read = log.time - start, log.read_at - start
    rows = len(legs) + 1
    figure, _ = time_figure(account, 0.9 + 2.3 * rows, rows)
    *panels, last = figure.axes
    for limb, one in zip(legs, panels, strict=True):
        for i, name, colour in joints_shown(robot, limb):
            one.plot(time, np.degrees(log.command[:, i]), color=colour, linewidth=0.9)
            one.plot(
                read[:, i], np.degrees(log.position[:, i]), ".", color=colour, markersize=2.6, label=name,
            )  # fmt: skip
        one.set_ylabel(f"{shown(limb.name)} [deg]")
    _errors(last, log, read)
    last.set_xlim(time[0] if len(time) else 0.0, time[-1] if len(time) else 1.0)
    last.set_xlabel("time of the walk [s]; before 0 the soft start")
    legend_above(figure, figure.axes, columns=4)
    return figure


def _errors(axes: Axes, log: PlayLog, read: Array) -> None:
    """How far each joint is from its last goal; the worst one by name."""
    error = np.degrees(np.abs(log.position - log.command))
    worst = int(np.argmax(np.nanmax(error, axis=0, initial=0.0)))
    for i, name in enumerate(log.joint_names):
        seen = np.isfinite(error[:, i])
        bold = i == worst
        axes.plot(
            read[seen, i], error[seen, i], color="#B00020" if bold else PLAIN, linewidth=1.1 if bold else 0.5,
            alpha=1.0 if bold else 0.35, label=f"{shown(name)}, the worst" if bold else None, zorder=2 + bold,
        )  # fmt: skip
    axes.set_ylabel("off its goal [deg]")
    axes.set_ylim(bottom=0.0)
