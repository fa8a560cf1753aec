"""What a run shows beside its plan: ZMP from contacts, slip, torque and speed against the servos."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array, Booleans, stretches
from screwkin.dynamics.on_floor import pressed_points
from screwkin.gait.ground import ground_of
from screwkin.kinematics.limits import limited_joints
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.sim.internal_load import FEET, feet_held, legs_of, on_both, without_internal_load
from screwkin.sim.run import Run
from screwkin.trajectory import Trajectory

WINDOW = 0.05
"""Averaging time of forces [s]: contact solvers shift force between corners from step to step."""


@dataclass(frozen=True, eq=False)
class ZmpRecord:
    """ZMP measured and planned, averaged over the same windows; rows (M,) are at their middle.

    time (M,) [s]; contact (M, 2) from contact forces, planned (M, 2), ankle (M, 2) from the ankle sensors
    [m]. A row is NaN where nothing presses on the floor.
    """

    time: Array
    contact: Array
    planned: Array
    ankle: Array


@dataclass(frozen=True, eq=False)
class ForceRecord:
    """Forces measured, averaged over windows; rows (M,) are at their middle.

    time (M,) [s]; foot_force (M, feet, 3): of the floor on the legs' last links [N]; torque (M, n) of the
    motors [N m].
    """

    time: Array
    foot_force: Array
    torque: Array


@dataclass(frozen=True)
class Slip:
    """Horizontal motion of soles that should stand still, or of the edges about which they turn.

    largest [m]: farthest a sole moves in the middle 80 % of one stance; total [m]: net motion of all whole
    stances added up; turned [rad]: largest change of a sole's heading in the middle of one stance.
    """

    largest: float
    total: float
    turned: float


def zmp_record(run: Run, trajectory: Trajectory, window: float = WINDOW) -> ZmpRecord:
    """Contact, ankle and planned ZMP, all as force-weighted means over the same windows.

    A step's forces change the rates of the step before into its own, so they belong to its start. Rows cover
    the trajectory, up to a fall.
    """
    count = max(1, round(window / run.dt))
    start = run.time - run.dt
    before = _before_fall(run)
    if before.sum() < count:
        nothing = np.zeros((0, 2))
        return ZmpRecord(np.zeros(0), nothing, nothing, nothing)
    planned = np.stack([np.interp(start[before], trajectory.time, axis) for axis in trajectory.zmp.T], axis=1)
    middle = _window_mean(start[before], count)
    rows = (middle >= trajectory.time[0]) & (middle <= trajectory.time[-1])
    return ZmpRecord(
        time=middle[rows],
        contact=_zmp(_window_mean(run.ground_wrench[before], count))[rows],
        planned=_window_mean(planned, count)[rows],
        ankle=_zmp(_window_mean(run.ankle_wrench[before].sum(axis=1), count))[rows],
    )


def force_record(run: Run, window: float = WINDOW) -> ForceRecord:
    """Forces of feet and torques of motors from the trajectory's begin on, up to a fall."""
    count = max(1, round(window / run.dt))
    before = _before_fall(run)
    if before.sum() < count:
        return ForceRecord(np.zeros(0), run.foot_force[:0], run.torque[:0])
    time = _window_mean((run.time - run.dt)[before], count)
    rows = time >= 0.0
    force, torque = (_window_mean(x[before], count)[rows] for x in (run.foot_force, run.torque))
    return ForceRecord(time[rows], force, torque)


def slip(run: Run, trajectory: Trajectory, robot: Robot) -> Slip:
    """How far soles move while they should stand still.

    They should where a controller has them flat on the floor, which takes steps sooner or later than planned;
    without one where the plan has them there at both samples around. As a foot turns about an edge its tip
    moves; what counts is the motion of the sole where the plan has it press on the floor.
    """
    legs = legs_of(robot)
    played = _before_fall(run) & (run.time >= trajectory.time[0]) & (run.time <= trajectory.time[-1])
    if run.contact is None:
        after = np.minimum(np.searchsorted(trajectory.time, run.time[played]), trajectory.samples - 1)
        both = trajectory.contact & np.roll(trajectory.contact, 1, axis=0)
        standing = both[after][:, [trajectory.feet.index(foot) for foot in legs]]
        pressed = pressed_points(robot, legs, trajectory.T_world_tip, ground_of(trajectory))[after]
    else:
        standing = run.contact[played]
        pressed = np.zeros((*standing.shape, 3))
    largest = total = turned = 0.0
    for i in range(len(legs)):
        T = run.T_world_foot[played, i]
        rolled = np.zeros((len(T), 2))
        rolled[1:] = np.cumsum(np.einsum("tij,tj->ti", np.diff(T[:, :2, :3], axis=0), pressed[1:, i]), 0)
        place = T[:, :2, 3] + rolled
        for first, last in stretches(standing[:, i]):
            total += float(np.linalg.norm(place[last - 1] - place[first]))
            tenth = (last - first) // 10
            rows = slice(first + tenth, last - tenth)
            middle = T[rows]
            away = np.linalg.norm(place[rows] - place[first + tenth], axis=1)
            heading = np.unwrap(np.arctan2(middle[:, 1, 0], middle[:, 0, 0]))
            largest = max(largest, float(away.max()))
            turned = max(turned, float(np.abs(heading - heading[0]).max()))
    return Slip(largest, total, turned)


def landings(trajectory: Trajectory) -> Array:
    """Times (m,) [s] at which a foot that swings is planned to stand again, in their order."""
    lands = trajectory.contact[1:] & ~trajectory.contact[:-1]
    return np.asarray(trajectory.time[1:][lands.any(axis=1)])


def landing_leads(run: Run, trajectory: Trajectory, legs: tuple[str, ...]) -> Array:
    """By how much (m,) every swinging foot touches the floor before it is planned to stand [s], up to a fall.

    It touches where the floor carries a twentieth of the weight by it, in the second half of its swing or as
    long after it; ``legs`` names the run's feet.
    """
    before = _before_fall(run)
    time, force = run.time[before] - run.dt, run.foot_force[before, :, 2]
    touches = force > 0.05 * np.median(force.sum(axis=1))
    leads = []
    for i, foot in enumerate(legs):
        for first, last in stretches(~trajectory.contact[:, trajectory.feet.index(foot)]):
            if first == 0 or last == trajectory.samples:
                continue
            lift, land = trajectory.time[first - 1], trajectory.time[last]
            half = (land - lift) / 2.0
            rows = touches[:, i] & (time >= land - half) & (time <= land + half)
            if rows.any():
                leads.append(land - time[rows.argmax()])
    return np.array(leads)


def torque_use(run: Run, robot: Robot, window: float = WINDOW) -> Array:
    """Share (n,) of every motor's torque limit: the largest window mean of its torque.

    The simulated motor never exceeds its limit; a share of 1 means that it could not follow for that long.
    """
    return np.asarray(_most(_mean_torques(run, len(robot.joints), window)) / _limits(robot))


def torque_needed(run: Run, robot: Robot, trajectory: Trajectory, window: float = WINDOW) -> Array:
    """The same (n,) without what rigid servos make the feet press against each other while both stand.

    It is less than ``torque_use`` for rigid servos alone, in robots that are trees with two legs, where both
    feet carry and the commands keep one still against the other.
    """
    used = _mean_torques(run, len(robot.joints), window)
    if run.servo != "rigid" or robot.closures or len(legs_of(robot)) != FEET or not len(used):
        return np.asarray(_most(used) / _limits(robot))
    count = max(1, round(window / run.dt))
    rows = _played(run)
    wrenches, torque = (_window_mean(x[rows], count) for x in (run.ankle_wrench, run.torque))
    middle = np.flatnonzero(rows)[count // 2 :][: len(used)]
    sample = np.searchsorted(trajectory.time, run.time[middle]).clip(0, trajectory.samples - 1)
    both = np.flatnonzero(on_both(wrenches) & feet_held(robot, trajectory)[sample])
    state = State(run.T_world_base[middle[both]], run.q[middle[both]])
    needed = without_internal_load(robot, state, torque[both], wrenches[both])
    used[both] += np.minimum(np.abs(needed) - np.abs(torque[both]), 0.0)
    return np.asarray(_most(used) / _limits(robot))


def _mean_torques(run: Run, joints: int, window: float) -> Array:
    """Window means (M, n) of the magnitudes of torques, from the trajectory's begin up to a fall."""
    torque, count = np.abs(run.torque[_played(run)]), max(1, round(window / run.dt))
    return _window_mean(torque, count) if len(torque) >= count else np.zeros((0, joints))


def _most(torques: Array) -> Array:
    return np.asarray(torques.max(axis=0, initial=0.0))


def _limits(robot: Robot) -> Array:
    return np.array([joint.effort for joint in robot.joints])


def _played(run: Run) -> Booleans:
    return np.asarray(_before_fall(run) & (run.time >= 0.0))


def speed_use(trajectory: Trajectory, robot: Robot) -> Array:
    """Share (n,) of every servo's speed limit that the planned rates need."""
    return np.asarray(
        np.abs(trajectory.qd).max(axis=0) / np.array([joint.velocity for joint in limited_joints(robot)])
    )


def _before_fall(run: Run) -> Booleans:
    if run.fallen_at is None:
        return np.ones(len(run.time), dtype=bool)
    return np.asarray(run.time < run.fallen_at)


def _window_mean(values: Array, count: int) -> Array:
    """Means over all windows of ``count`` consecutive rows."""
    summed = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    return np.asarray((summed[count:] - summed[:-count]) / count)


def _zmp(wrench: Array) -> Array:
    """Point of the floor (K, 2) where a wrench about the world origin has no horizontal moment."""
    pressing = np.where(wrench[:, 5] > 1e-6, wrench[:, 5], np.nan)
    return np.stack([-wrench[:, 1] / pressing, wrench[:, 0] / pressing], axis=1)
