"""Pictures of the motion: feet, waist and joint angles."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.analysis.account import Account
from screwkin.model.robot import Limb, Robot
from screwkin.report.style import (
    LINES,
    WAIST,
    Axes,
    Figure,
    finished,
    foot_colours,
    shown,
    time_figure,
)

AXES = ("x", "y", "z")
_STILL = 1e-3  # m: a channel that moves less is not worth a picture of its own


def feet_along_x(account: Account) -> Figure:
    """Feet against time along x, and along y where they move sideways."""
    T = account.trajectory.T_world_tip
    sideways = any(np.ptp(T[foot][:, 1, 3]) > _STILL for foot in account.trajectory.feet)
    axes_shown = (0, 1) if sideways else (0,)
    figure, _ = time_figure(account, 1.2 + 1.9 * len(axes_shown), len(axes_shown))
    for axis, one in zip(axes_shown, figure.axes, strict=True):
        _feet(account, one, axis, 1.0)
        one.set_ylabel(f"{AXES[axis]} of the feet [m]")
    return finished(figure, account)


def feet_along_z(account: Account) -> Figure:
    """Height of the feet against time."""
    figure, axes = time_figure(account, 2.8)
    _feet(account, axes, 2, 1e3)
    axes.set_ylabel("height of the feet [mm]")
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    return finished(figure, account)


def _feet(account: Account, axes: Axes, axis: int, scale: float, **style: Any) -> None:
    for foot, colour in foot_colours(account).items():
        value = scale * account.trajectory.T_world_tip[foot][:, axis, 3]
        axes.plot(account.trajectory.time, value, color=colour, label=shown(foot), **style)


def waist_along_x(account: Account) -> Figure:
    """The waist against time along x, and its speed."""
    trajectory = account.trajectory
    figure, (place, speed) = time_figure(account, 3.9, 2, height_ratios=(3, 2))
    place.plot(trajectory.time, trajectory.T_world_base[:, 0, 3], color=WAIST, label="waist")
    place.set_ylabel("x of the waist [m]")
    speed.plot(trajectory.time, 1e3 * trajectory.base_twist[:, 3], color=WAIST, linewidth=1.1)
    speed.set_ylabel("its speed [mm/s]")
    return finished(figure, account)


def waist_along_y(account: Account) -> Figure:
    """The waist's sway against time, with the feet between which it sways."""
    trajectory = account.trajectory
    figure, axes = time_figure(account, 2.8)
    _feet(account, axes, 1, 1e3, linewidth=1.0, linestyle="--")
    axes.plot(trajectory.time, 1e3 * trajectory.T_world_base[:, 1, 3], color=WAIST, label="waist")
    axes.set_ylabel("y of waist and feet [mm]")
    return finished(figure, account)


def joint_angles(account: Account, kind: str = "leg") -> Figure | None:
    """Joint angles of all legs (or arms), one panel per limb with the same scale; None without such limbs."""
    robot, trajectory = account.robot, account.trajectory
    limbs = [limb for limb in robot.limbs if limb.kind == kind]
    if not limbs:
        return None
    figure, _ = time_figure(account, 0.9 + 2.3 * len(limbs), len(limbs), sharey=True)
    for limb, one in zip(limbs, figure.axes, strict=True):
        for k, (i, name, colour) in enumerate(joints_shown(robot, limb)):
            revolute = robot.joints[i].type != "prismatic"
            value = np.degrees(trajectory.q[:, i]) if revolute else 1e3 * trajectory.q[:, i]
            one.plot(trajectory.time, value, color=colour, linestyle=LINES[k % 2], label=name)
        one.set_ylabel(f"{shown(limb.name)} [deg]")
    return finished(figure, account, columns=4)


HUES = ("#222222", "#56B4E9", "#CC79A7", "#009E73", "#E69F00", "#0072B2")


def joints_shown(robot: Robot, limb: Limb) -> list[tuple[int, str, str]]:
    """Index, name without the limb's side, and colour of every joint of a limb."""
    path = [i for i in robot.path_to(limb.link) if i < len(robot.joints)]
    common = len(common_prefix([robot.joint_names[i] for i in path]))
    return [(i, shown(robot.joint_names[i][common:]), HUES[k % len(HUES)]) for k, i in enumerate(path)]


def common_prefix(names: list[str]) -> str:
    """What all names begin with, up to an underscore: ``right_`` of right_knee and right_hip."""
    if len(names) < 2:
        return ""
    first, last = min(names), max(names)
    same = next(
        (i for i, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), min(map(len, names))
    )
    return first[: first.rfind("_", 0, same) + 1]
