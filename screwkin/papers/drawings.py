"""Figures of papers drawn again, by name: each takes the bench and named arguments, and returns a figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from screwkin.analysis.compliance import Trial
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.errors import InputError
from screwkin.papers.bench import Bench
from screwkin.papers.measures_leg import FINE, compensated_of, foot_from_waist, map_of, sinking_of, zmp_lines
from screwkin.papers.measures_springs import trial_of
from screwkin.report import balance, frames, maps, motion
from screwkin.report.graph import mechanism_graph
from screwkin.report.style import (
    LINES,
    MEASURED,
    PLAIN,
    SIDES,
    ZMP,
    Figure,
    finished,
    legend_above,
    new_figure,
    shown,
    time_figure,
)
from screwkin.sim.measure import ZmpRecord

Drawing = Callable[..., Figure]


def _of_walk(draw: Callable[..., Figure | None], **options: object) -> Drawing:
    """A report's picture of a walk's account as a drawing of a paper."""

    def drawing(bench: Bench, gait: str, steps: int | None = None) -> Figure:
        figure = draw(bench.account(gait, steps), **options)
        if figure is None:
            raise InputError(f"{bench.robot.name} has no legs, so there are no joint angles to draw")
        return figure

    drawing.__doc__ = draw.__doc__
    return drawing


def walking(bench: Bench, gait: str, steps: int | None = None, cycles: bool = False) -> Figure:
    """Frames of the simulated walk: within a gait cycle, or where the ``cycles`` begin and end."""
    account = bench.account(gait, steps)
    times = frames.cycle_times(account) if cycles else None
    return frames.frames_of_run(account, bench.validation(account).run, times)


def mechanism(bench: Bench, robot: str = "") -> Figure:
    """The graph of the closed mechanism of a robot; default: the paper's."""
    return mechanism_graph(bench.facts(robot).mechanism)


def reach_maps(bench: Bench, limb: str, heights: Sequence[float], resolution: float = FINE) -> Figure:
    """What cuts the reach, and the inverse condition number, at several heights."""
    places = [map_of(bench, limb, height, resolution) for height in heights]
    most = max(float(np.nanmax(place.inverse_condition, initial=0.0)) for place in places)
    return maps.workspace_overview(bench.robot, places, most)


def deflection_maps(bench: Bench, limb: str, heights: Sequence[float], stiffness: float = 1.0) -> Figure:
    """Length of the deflection at several heights."""
    sunk = [sinking_of(bench, limb, height, stiffness) for height in heights]
    return maps.deflection_overview(bench.robot, sunk)


def deflection_parts(bench: Bench, limb: str, height: float, stiffness: float = 1.0) -> Figure:
    """Components of the deflection at a height."""
    sunk = sinking_of(bench, limb, height, stiffness)
    return maps.deflection_picture(bench.robot, sunk)


def preview(bench: Bench, gait: str, steps: int | None = None) -> Figure:
    """Wanted ZMP, that of the cart and of all links, and the CoM, along x and y."""
    account = bench.account(gait, steps)
    wanted, cart, whole = zmp_lines(bench, gait, steps)
    time = account.trajectory.time
    figure, axes = time_figure(account, 5.2, 2)
    for k, one in enumerate(axes):
        one.plot(time, 1e3 * cart[:, k], color=MEASURED, linewidth=3.0, alpha=0.6, label="ZMP of the cart")
        one.plot(time, 1e3 * wanted[:, k], color="#222222", linewidth=0.9, label="ZMP wanted")
        one.plot(time, 1e3 * whole[:, k], color=ZMP, linewidth=1.0, linestyle="--", label="ZMP of all links")
        one.plot(time, 1e3 * account.balance.com[:, k], color=SIDES[2], label="CoM")
        one.set_ylabel(f"{'xy'[k]} [mm]")
    return finished(figure, account)


def compensated_joints(bench: Bench, gait: str, limb: str, stiffness: float) -> Figure:
    """Joint angles of a limb as planned, and what compensation adds to them."""
    account = bench.account(gait)
    table, time = account.robot, account.trajectory.time
    change = np.degrees(compensated_of(bench, gait, stiffness).q - account.trajectory.q)
    figure, (angle, added) = time_figure(account, 5.2, 2)
    for k, i in enumerate(table.path_to(table.limb(limb).link)):
        style = {"color": SIDES[k % len(SIDES)], "linestyle": LINES[k % 2], "linewidth": 1.2}
        name = shown(table.joint_names[i])
        angle.plot(time, np.degrees(account.trajectory.q[:, i]), label=name, **style)
        added.plot(time, change[:, i], label=name, **style)
    angle.set_ylabel("intended [deg]")
    added.set_ylabel("added by compensation [deg]")
    return finished(figure, account, columns=4)


def commanded_foot(bench: Bench, gait: str, limb: str, stiffness: float) -> Figure:
    """The foot seen from the waist along x, y and z, as planned and as compensation commands it."""
    account = bench.account(gait)
    planned, commanded = foot_from_waist(bench, gait, limb, stiffness)
    figure, axes = time_figure(account, 6.0, 3)
    for k, one in enumerate(axes):
        one.plot(account.trajectory.time, 1e3 * planned[:, k], color=PLAIN, label="intended")
        one.plot(account.trajectory.time, 1e3 * commanded[:, k], "--", color=SIDES[0], label="commanded")
        one.set_ylabel(f"{'xyz'[k]} [mm]")
    return finished(figure, account)


def compensated_foot(bench: Bench, gait: str, limb: str, stiffness: float) -> Figure:
    """By how much compensation moves the commanded foot, seen from the waist."""
    account = bench.account(gait)
    planned, commanded = foot_from_waist(bench, gait, limb, stiffness)
    figure, axes = time_figure(account, 3.0)
    for k, colour in enumerate((SIDES[0], SIDES[1], PLAIN)):
        moved = 1e3 * (commanded - planned)[:, k]
        axes.plot(account.trajectory.time, moved, color=colour, label="xyz"[k], linestyle=LINES[k])
    axes.set_ylabel(f"{shown(account.robot.limb(limb).tip)} moved by [mm]")
    return finished(figure, account)


def sprung_zmp(bench: Bench, gait: str, treatments: Sequence[str], stiffness: float) -> Figure:
    """ZMP against time of a walk on elastic joints, simulated: wanted, and with every treatment."""
    account = bench.account(gait)
    wanted = zmp_lines(bench, gait)[0]
    figure, axes = time_figure(account, 5.6, 2)
    for k, one in enumerate(axes):
        for treatment, style in zip(treatments, _TREATED, strict=False):
            trial, zmp = _run_of(bench, gait, treatment, stiffness)
            one.plot(zmp.time, 1e3 * zmp.contact[:, k], label=_treated(trial), **style)
        one.plot(
            account.trajectory.time, 1e3 * wanted[:, k], color="#222222", linewidth=0.9, label="ZMP wanted"
        )
        one.set_ylabel(f"{'xy'[k]} [mm]")
    return finished(figure, account, columns=4)


def sprung_zmp_above(bench: Bench, gait: str, treatments: Sequence[str], stiffness: float) -> Figure:
    """The same from above, one panel for each treatment, with the soles where the plan puts them."""
    account = bench.account(gait)
    trajectory = account.trajectory
    soles = soles_on_floor(account.robot, trajectory.feet, trajectory.T_world_tip)
    wanted = zmp_lines(bench, gait)[0]
    figure, _ = new_figure(0.8 + 1.55 * len(treatments), len(treatments), sharex=True, sharey=True)
    for one, treatment, style in zip(figure.axes, treatments, _TREATED, strict=False):
        balance.draw_soles(one, account, soles)
        trial, zmp = _run_of(bench, gait, treatment, stiffness)
        one.plot(*zmp.contact.T, label=_treated(trial), **style)
        one.plot(*wanted.T, color="#222222", linewidth=0.9, label="ZMP wanted")
        one.set_aspect("equal")
        one.set_ylabel("y [m]")
    figure.axes[-1].set_xlabel("x [m]")
    legend_above(figure, figure.axes, columns=3)
    return figure


_TREATED = (
    {"color": MEASURED, "linewidth": 1.0},
    {"color": SIDES[3], "linewidth": 1.0},
    {"color": SIDES[2], "linewidth": 1.0, "linestyle": "--"},
)
"""Lines of a figure's treatments, in their order."""


def _run_of(bench: Bench, gait: str, treatment: str, stiffness: float) -> tuple[Trial, ZmpRecord]:
    trial = trial_of(bench, gait, treatment, stiffness)
    if trial.zmp is None:
        raise InputError(f"the run with treatment {treatment} has no ZMP")
    return trial, trial.zmp


def _treated(trial: Trial) -> str:
    names = {
        "none": "without compensation",
        "swing": "swing foot compensated",
        "joint": "joints compensated",
    }
    fell = "" if trial.fell_at is None else f", falls at {trial.fell_at:.1f} s"
    return names.get(trial.treatment, "joints led by the walk's torques") + fell


DRAWINGS: Mapping[str, Drawing] = {
    "feet_along_x": _of_walk(motion.feet_along_x),
    "feet_along_z": _of_walk(motion.feet_along_z),
    "waist_along_x": _of_walk(motion.waist_along_x),
    "waist_along_y": _of_walk(motion.waist_along_y),
    "joint_angles": _of_walk(motion.joint_angles),
    "walking": walking,
    "mechanism": mechanism,
    "planned": _of_walk(frames.frames_drawn),
    "zmp_along_x": _of_walk(balance.zmp_against_gcom, axis=0),
    "zmp_along_y": _of_walk(balance.zmp_against_gcom, axis=1),
    "seen_from_above": _of_walk(balance.seen_from_above),
    "reach_maps": reach_maps,
    "deflection_maps": deflection_maps,
    "deflection_parts": deflection_parts,
    "preview": preview,
    "compensated_joints": compensated_joints,
    "foot_from_waist": commanded_foot,
    "compensated_foot": compensated_foot,
    "sprung_zmp": sprung_zmp,
    "sprung_zmp_above": sprung_zmp_above,
}
"""Every drawing by the name that papers use."""
