"""Do a trajectory's own numbers hang together? What a file says is computed anew from its joint positions.

Rates are checked against positions, and accelerations against rates, by the trapezoidal rule, which is exact
but for what the samples themselves bound: where accelerations a (T, n) are sampled every h, their largest
second difference d nearby says how much they bend within a step, so that

    |x' - x - h (v + v') / 2 + h^2 (a' - a) / 12| <= h^2 d / 2   and   |v' - v - h (a + a') / 2| <= h d.

A smooth motion takes a twelfth of the second bound, a jump of an acceleration between two samples half of
it. Zeroed or scaled rates and accelerations exceed them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, rotation_from_array, rotation_log
from screwkin.analysis.account import check_tips, closure_of
from screwkin.dynamics.support import sole_corners
from screwkin.gait.balance import Balance, zmp
from screwkin.gait.compensation import compensate_walk, stiffness_of, way_of
from screwkin.gait.ground import ground_of
from screwkin.gait.intended import intended
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory, check_joints

CLOSED = 1e-6
"""How far limbs may end from the recorded tips [m or rad], and points from those computed anew [m]."""
STANDS = 1e-4
"""How far the plan may move a sole in contact, in a stance or off the floor [m]."""
SAME_COMMAND = 1e-4
"""How far commands may lie from those that their compensation gives [rad]: a tick has fifty times as much."""
EVEN = 1e-3
"""Share of the time between samples by which one of them may differ."""
FAINT = 1e-3
"""Share of a column's greatest acceleration below which changes within a step are not looked into."""
_ROUNDING = 1e-9  # per unit of rate: of sums of squares of time steps


def motion_faults(robot: Robot, trajectory: Trajectory) -> tuple[str, ...]:
    """What in a trajectory of that robot contradicts itself, one line for each kind.

    Raises:
        InputError, NoSolutionError: joints or tips are not the robot's, or poses are out of its reach.
    """
    check_joints(robot, trajectory.joint_names)
    check_tips(robot, trajectory)
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite stays within no bound
        motion = intended(robot, trajectory)
        return (
            *_time_faults(trajectory.time),
            *_rate_faults(motion),
            *_closure_faults(closure_of(robot, trajectory, motion)),
            *_standing_faults(robot, trajectory),
            *_balance_faults(trajectory, zmp(robot, motion)),
            *_command_faults(robot, trajectory, motion),
        )


def _time_faults(time: Array) -> Iterator[str]:
    """Samples that are not evenly spaced, as those of plans are: a pause more is another motion."""
    gap = np.diff(time)
    uneven = np.abs(gap - np.median(gap))
    usual, i = np.median(gap), int(uneven.argmax())
    if not uneven[i] <= EVEN * usual:
        yield f"samples are {1e3 * gap[i]:.3g} ms apart at {time[i]:.2f} s, elsewhere {1e3 * usual:.3g}"


def _rate_faults(motion: Trajectory) -> Iterator[str]:
    names = motion.joint_names
    yield from _disagreements("of {}", names, motion.time, np.diff(motion.q, axis=0), motion.qd, motion.qdd)
    T, twist, change = motion.T_world_base, motion.base_twist, motion.base_acceleration
    before, after = rotation_from_array(T[:-1, :3, :3]), rotation_from_array(T[1:, :3, :3])
    turned = as_array(rotation_log(after @ before.T), (motion.samples - 1,))
    moved = np.hstack([turned, np.diff(T[:, :3, 3], axis=0)])
    places = ("about x", "about y", "about z", "along x", "along y", "along z")
    yield from _disagreements("of the base {}", places, motion.time, moved, twist, change)


def _disagreements(
    words: str, names: tuple[str, ...], time: Array, moved: Array, v: Array, a: Array
) -> Iterator[str]:
    """Columns whose steps (T - 1, n), rates and accelerations (T, n) do not belong together."""
    h = np.diff(time)[:, None]
    bend = np.zeros((len(a) + 4, a.shape[1]))  # second differences of a, and none beyond the ends
    bend[3:-3] = np.abs(np.diff(a, 2, axis=0))
    nearby = np.max([bend[i : i + len(a) - 1] for i in range(6)], axis=0)  # two samples to either side
    spread = nearby + FAINT * np.abs(a).max(axis=0)
    rounding = _ROUNDING * (1.0 + np.abs(v[:-1]) + np.abs(v[1:]))
    step = np.abs(moved - h * (v[:-1] + v[1:]) / 2 + h**2 * np.diff(a, axis=0) / 12)
    gain = np.abs(np.diff(v, axis=0) - h * (a[:-1] + a[1:]) / 2)
    for what, of, error, bound in (
        ("rates", "positions", step, h**2 * spread / 2 + rounding),
        ("accelerations", "rates", gain, h * spread + rounding / h),
    ):
        bad = ~(error <= bound)
        if bad.any():
            i, k = map(int, np.unravel_index(int(np.argmax(error - bound)), bad.shape))
            yield (
                f"{what} {words.format(names[k])} are not those of its {of}: between {time[i]:.2f} and "
                f"{time[i + 1]:.2f} s they differ by {error[i, k]:.3g}, more than the {bound[i, k]:.2g} that "
                "samples so far apart leave open"
            )


def _closure_faults(closure: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    for tip, (gap, angle) in closure.items():
        if not max(gap, angle) <= CLOSED:
            yield (
                f"the joints carry {tip} to {1e3 * gap:.3g} mm and {angle:.3g} rad from its recorded poses"
            )


def _standing_faults(robot: Robot, trajectory: Trajectory) -> Iterator[str]:
    """Soles in contact that are off the floor or move where they touch it, and soles below the floor."""
    terrain = ground_of(trajectory)
    for i, foot in enumerate(trajectory.feet):
        T, stands = trajectory.T_world_tip[foot], trajectory.contact[:, i]
        corners = np.einsum("tij,kj->tki", T[:, :3, :3], sole_corners(robot, foot)) + T[:, None, :3, 3]
        height = terrain.above_ground(corners)
        touches = np.abs(height) <= STANDS
        floats = stands & ~touches.any(axis=1)
        if floats.any():
            yield f"{foot} is in contact but off the floor at {trajectory.time[int(floats.argmax())]:.2f} s"
        sunk = ~(height.min(axis=1) >= -STANDS)
        if sunk.any():
            yield f"{foot} is below the floor at {trajectory.time[int(sunk.argmax())]:.2f} s"
        both = touches[1:] & touches[:-1]  # of a sole that turns about an edge, the ends of this edge
        moved = np.where(both, np.abs(np.diff(corners, axis=0)).max(axis=2), 0.0).max(axis=1)
        slides = stands[1:] & stands[:-1] & ~(moved <= STANDS)
        if slides.any():
            yield f"{foot} moves while in contact, at {trajectory.time[int(slides.argmax())]:.2f} s"


def _balance_faults(recorded: Trajectory, anew: Balance) -> Iterator[str]:
    for name in ("com", "zmp", "margin"):
        wrong = np.abs(getattr(recorded, name) - getattr(anew, name))
        if not wrong.max() <= CLOSED:
            yield f"the recorded {name} is up to {1e3 * wrong.max():.3g} mm from the one computed anew"


def _command_faults(robot: Robot, trajectory: Trajectory, motion: Trajectory) -> Iterator[str]:
    """Commands for elastic servos that are not those of their compensation."""
    if way_of(trajectory) == "none":
        return
    entry = trajectory.meta["compensation"]
    choices = (entry[key] for key in ("method", "passes", "model"))
    losses = {name: entry.get(name) for name in ("damping", "armature", "friction")}
    anew = compensate_walk(robot, motion, stiffness_of(trajectory), *choices, **losses)
    away = np.abs(anew.q - trajectory.q)
    if not away.max() <= SAME_COMMAND:
        k = int(away.max(axis=0).argmax())
        yield (
            f"the commands of {anew.joint_names[k]} are up to {away.max():.3g} rad from those that their "
            "compensation gives"
        )
