"""Pictures of the robot itself: the plan seen from the side, or the simulation as a camera sees it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array, unstack
from screwkin.analysis.account import Account
from screwkin.dynamics.support import convex_hull
from screwkin.errors import InputError
from screwkin.gait.ground import ground_of
from screwkin.kinematics.positions import link_displacements
from screwkin.model.robot import Robot
from screwkin.model.shapes import box_points, link_points
from screwkin.report.style import Axes, Figure, joint_colours, new_figure
from screwkin.sim.camera import Camera
from screwkin.sim.render import pictures
from screwkin.sim.run import Run
from screwkin.sim.solids import lines_of

ROWS, COLUMNS = 2, 3
GREY = "#8A8F98"


def frame_times(account: Account) -> Array:
    """Times (6,) [s], evenly over one gait cycle of two steps in the middle of the walk, else over all."""
    boundaries, time, count = account.boundaries, account.trajectory.time, ROWS * COLUMNS
    if len(boundaries) < 5:
        return np.linspace(time[0], time[-1], count)
    middle = (len(boundaries) - 1) // 2
    begin = middle - middle % 2
    return np.linspace(boundaries[begin], boundaries[begin + 2], count, endpoint=False)


def cycle_times(account: Account) -> Array:
    """Times [s] at which gait cycles of two steps begin, and the last one ends."""
    boundaries = account.boundaries
    if len(boundaries) < 3:
        raise InputError("a walk without two steps has no gait cycle")
    return np.array(boundaries[::2])


def frames_of_run(account: Account, run: Run, times: Array | None = None) -> Figure:
    """Frames of the simulated walk; of a run that ended early, from its beginning to its end.

    Args:
        account: of the walk.
        run: its simulation.
        times: of the frames [s]; default: see ``frame_times``.
    """
    wanted = frame_times(account) if times is None else times
    if run.time[-1] < wanted[-1]:
        wanted = np.linspace(account.trajectory.time[0], run.time[-1], len(wanted))
    rows = np.clip(np.searchsorted(run.time, wanted - 1e-9), 0, len(run.time) - 1)
    shots = pictures(
        account.robot,
        run.time[rows],
        run.T_world_base[rows],
        run.q[rows],
        Camera(),
        ground_of(account.trajectory),
    )
    down = 1 if len(wanted) <= COLUMNS + 1 else -(-len(wanted) // COLUMNS)
    figure, axes = new_figure(2.45 * down, down, -(-len(wanted) // down), squeeze=False)
    for one in axes.flat[len(wanted) :]:
        one.set_axis_off()
    for one, time, shot in zip(axes.flat, run.time[rows], shots, strict=False):
        one.set_axis_off()
        one.imshow(shot)
        one.set_title(f"{time:.2f} s", fontsize=8.5, pad=3)
    return figure


def frames_drawn(account: Account) -> Figure:
    """Frames of the planned walk from the robot's right, drawn from the shapes or boxes of its table."""
    trajectory, robot = account.trajectory, account.robot
    figure, axes = new_figure(5.4, ROWS, COLUMNS, squeeze=False, sharey=True)
    samples = [int(np.abs(trajectory.time - time).argmin()) for time in frame_times(account)]
    solids = _solids(robot)
    outlines = [_outlines(robot, solids, trajectory.T_world_base[i], trajectory.q[i]) for i in samples]
    reach = max(np.abs(outline[:, 0]).max() for frame in outlines for _, _, outline in frame)
    top = max(outline[:, 1].max() for frame in outlines for _, _, outline in frame)
    of_joint = joint_colours(account, GREY)
    colours = {robot.base_link: GREY} | {j.child: of_joint.get(j.name, GREY) for j in robot.tree}
    for one, i, frame in zip(axes.flat, samples, outlines, strict=True):
        _draw(one, frame, colours)
        one.set_xlim(-1.1 * reach, 1.1 * reach)
        one.set_ylim(-0.02 * top, 1.04 * top)
        one.set_aspect("equal")
        one.set_axis_off()
        one.set_title(f"{trajectory.time[i]:.2f} s", fontsize=8.5, pad=3)
    return figure


def _draw(axes: Axes, frame: Sequence[tuple[str, float, Array]], colours: dict[str, str]) -> None:
    axes.axhline(0.0, color="#888888", linewidth=0.8)
    for link, _, outline in sorted(frame, key=lambda item: item[1], reverse=True):
        colour = colours[link]
        if len(outline) > 2:
            axes.fill(*outline.T, facecolor=colour, edgecolor="white", linewidth=0.7)
        else:
            axes.plot(*outline.T, color=colour, linewidth=2.5, solid_capstyle="round")


def _outlines(
    robot: Robot, solids: Mapping[str, Sequence[Array]], T_world_base: Array, q: Array
) -> list[tuple[str, float, Array]]:
    """Link, distance from the viewer and outline (k, 2) [m] of every solid, seen from the right of the waist.

    A link without any is the line from its joint to the joints and tips that it carries.
    """
    T = pose_from_array(T_world_base)
    poses = [T @ D for D in link_displacements(robot, unstack(q))]
    heading = np.array([T_world_base[0, 0], T_world_base[1, 0]])
    forward = np.append(heading / max(float(np.linalg.norm(heading)), 1e-9), 0.0)
    view = np.array([forward, [0.0, 0.0, 1.0], np.array([-forward[1], forward[0], 0.0])])
    origin = np.array([T_world_base[0, 3], T_world_base[1, 3], 0.0])
    sides = []
    for link, pose in zip(robot.links, poses, strict=True):
        D = as_array(pose)
        for points in solids[link.name]:
            seen = (points @ D[:3, :3].T + D[:3, 3] - origin) @ view.T
            flat = convex_hull(seen[:, :2]) if len(points) > 2 else seen[:, :2]
            sides.append((link.name, float(seen[:, 2].mean()), flat))
    return sides


def _solids(robot: Robot) -> dict[str, list[Array]]:
    """Of every link the points (N, 3) of its shapes, else of each of its boxes, else of each of its lines."""
    shaped = link_points(robot, "visual").points
    solids = {}
    for link in robot.links:
        if link.shapes and link.name in shaped:
            solids[link.name] = [shaped[link.name]]
        else:
            solids[link.name] = [box_points(box) for box in link.boxes] or lines_of(robot, link.name)
    return solids
