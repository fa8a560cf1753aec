"""A singular posture drawn: its links, the screw by which one moves freely, and the free wrench."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.kinematics.body import frame_pose, link_poses
from screwkin.kinematics.positions import joint_screws, link_displacements
from screwkin.mechanism.screw_text import ScrewLine
from screwkin.mechanism.singularity import LimbSingularity
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.report.style import SIDES, Axes, Figure, new_figure, save_figure, shown, styled

GREY = "#8A8F98"
MOTION, WRENCH = SIDES[0], SIDES[1]
TURNS, SAMPLES = 2.0, 120


def save_singularities(
    robot: Robot, state: State, entries: Sequence[LimbSingularity], folder: Path
) -> list[Path]:
    """Draw and write one picture for every singular limb or loop; returns the files.

    Raises:
        OutputError: a file cannot be written.
    """
    near = [entry for entry in entries if entry.free is not None]
    paths = []
    for k, entry in enumerate(near):
        name = "singularity" if len(near) == 1 else f"singularity_{k + 1}"
        with styled():
            paths.append(save_figure(singular_figure(robot, state, entry), folder / f"{name}.png"))
    return paths


def singular_figure(robot: Robot, state: State, entry: LimbSingularity) -> Figure:
    """The robot's links as lines between its joints, with the free motion and the free wrench of an entry."""
    figure, axes = new_figure(5.6, subplot_kw={"projection": "3d"})
    figure.subplots_adjust(left=0.02, right=0.98, bottom=0.02, top=0.86)
    base = np.asarray(state.T_world_base)
    ends = _ends(robot, state)
    for name, points in ends.items():
        moving = entry.free is not None and name == entry.free.body
        for a, b in _strokes(points):
            axes.plot(*zip(a, b, strict=True), color=MOTION if moving else GREY, lw=2.4 if moving else 1.3)
    every = np.concatenate([np.array(points) for points in ends.values() if points])
    size = float(np.ptp(every, axis=0).max()) or 1.0
    if entry.free is not None:
        motion, wrench = entry.free.motion, entry.free.wrench
        _line(axes, wrench, base, 0.75 * size, WRENCH, f"free wrench: {wrench.text}")
        _line(axes, motion, base, 0.55 * size, MOTION, f"{shown(entry.free.body)} moves: {motion.text}")
        _helix(axes, motion, base, size)
    middle = (every.max(axis=0) + every.min(axis=0)) / 2
    for k, set_limits in enumerate((axes.set_xlim, axes.set_ylim, axes.set_zlim)):
        set_limits(middle[k] - 0.6 * size, middle[k] + 0.6 * size)
    axes.set_box_aspect((1, 1, 1))
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    figure.suptitle(
        f"{robot.name}, {shown(entry.limb)[:60]}: smallest singular value {entry.sigma:.2g}", y=0.985
    )
    figure.legend(loc="upper center", bbox_to_anchor=(0.5, 0.955), ncols=1)
    return figure


def _ends(robot: Robot, state: State) -> dict[str, list[Array]]:
    """By the name of every link the points of its joints, closures and tips, in the world."""
    D = link_displacements(robot, list(np.asarray(state.q)))
    T = np.asarray(state.T_world_base)
    ends: dict[str, list[Array]] = {name: [] for name in robot.link_names}
    for joint, screw in zip(robot.tree, joint_screws(robot, D), strict=True):
        point = T[:3, :3] @ np.array(as_array(screw.s0), dtype=float) + T[:3, 3]
        ends[joint.parent].append(point)
        ends[joint.child].append(point)
    poses = np.asarray(link_poses(robot, state))
    for closure in robot.closures:
        for name, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
            if name in ends:
                link = robot.links[robot.link_names.index(name)]
                own = link.frame.inverse @ frame
                pose = poses[robot.link_names.index(name)]
                ends[name].append(pose[:3, :3] @ np.array(as_array(own.p), dtype=float) + pose[:3, 3])
    for limb in robot.limbs:
        if len(ends[limb.link]) < 2:
            ends[limb.link].append(np.asarray(frame_pose(robot, state, limb.tip))[:3, 3])
    return ends


def _strokes(points: Sequence[Array]) -> list[tuple[Array, Array]]:
    """A link's lines: between two points, or of more around them and closed."""
    return [(a, points[k + 1]) for k, a in enumerate(points[:-1])] + (
        [(points[-1], points[0])] if len(points) > 2 else []
    )


def _line(axes: Axes, screw: ScrewLine, base: Array, reach: float, colour: str, label: str) -> None:
    """The axis of a screw, through its point."""
    point, axis = base[:3, 3] + np.array(screw.point), np.array(screw.axis)
    a, b = point - reach * axis, point + reach * axis
    axes.plot(
        *zip(a, b, strict=True), color=colour, ls="-" if colour == MOTION else "--", lw=1.8, label=label
    )


def _helix(axes: Axes, screw: ScrewLine, base: Array, size: float) -> None:
    """How points about the axis move: a helix with the screw's pitch, of a rotation a circle."""
    if np.isinf(screw.pitch):
        return
    axis = np.array(screw.axis)
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    u /= np.linalg.norm(u)
    reach = 2 * np.pi * TURNS if screw.pitch == 0 else min(2 * np.pi * TURNS, 0.8 * size / abs(screw.pitch))
    angle = np.linspace(-reach / 2, reach / 2, SAMPLES)[:, None]
    around = 0.12 * size * (np.cos(angle) * u + np.sin(angle) * np.cross(axis, u))
    path = base[:3, 3] + np.array(screw.point) + around + angle * screw.pitch * axis
    axes.plot(*path.T, color=MOTION, lw=1.0)
