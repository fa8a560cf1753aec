"""Figures of papers drawn again, by name: each takes the bench and named arguments, and gives a figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from screwkin.analysis.bench import Bench
from screwkin.errors import InputError
from screwkin.report import balance, frames, motion
from screwkin.report.style import Figure

Drawing = Callable[..., Figure]


def feet_along_x(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """Feet against time along x."""
    return motion.feet_along_x(bench.account(gait, steps, robot))


def feet_along_z(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """Height of the feet against time."""
    return motion.feet_along_z(bench.account(gait, steps, robot))


def waist_along_x(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """Waist against time along x."""
    return motion.waist_along_x(bench.account(gait, steps, robot))


def waist_along_y(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """Waist and feet against time along y."""
    return motion.waist_along_y(bench.account(gait, steps, robot))


def joint_angles(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """Joint angles of the legs."""
    figure = motion.joint_angles(bench.account(gait, steps, robot))
    if figure is None:
        raise InputError(f"{bench.robot(robot).name} has no legs, so there are no joint angles to draw")
    return figure


def walking(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """Frames of the simulated walk."""
    account = bench.account(gait, steps, robot)
    return frames.frames_of_run(account, bench.validation(account).run)


def zmp_along_x(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """GCoM and ZMP against time along x."""
    return balance.zmp_against_gcom(bench.account(gait, steps, robot), 0)


def zmp_along_y(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """GCoM and ZMP against time along y."""
    return balance.zmp_against_gcom(bench.account(gait, steps, robot), 1)


def seen_from_above(bench: Bench, gait: str, steps: int | None = None, robot: str = "") -> Figure:
    """Soles, support polygons, GCoM and ZMP from above."""
    return balance.seen_from_above(bench.account(gait, steps, robot))


_ALL: tuple[Drawing, ...] = (
    feet_along_x,
    feet_along_z,
    waist_along_x,
    waist_along_y,
    joint_angles,
    walking,
    zmp_along_x,
    zmp_along_y,
    seen_from_above,
)

DRAWINGS: Mapping[str, Drawing] = {drawing.__name__: drawing for drawing in _ALL}
