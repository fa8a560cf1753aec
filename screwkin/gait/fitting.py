"""A gait that fits a robot: how large, fast and bent its steps may be, by its own limits, speeds and torques.

The search goes from large, quick steps on bent legs to small, slow ones on straight legs. Many gaits are
tried coarsely in one batch; the first promising ones are planned in full and judged by the model alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from screwkin.errors import NoSolutionError, ScrewkinError, expect
from screwkin.gait.coarse import Coarse, coarse_walks
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.files import load_gait
from screwkin.gait.lengths import fitted
from screwkin.gait.record import Gait
from screwkin.gait.walk import walk
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

SIZES = ((0.3, 0.06), (0.2, 0.06), (0.15, 0.05), (0.1, 0.04), (0.05, 0.03))
"""Stride and lift in leg lengths, from large to small."""
BENDS = (0.93, 0.96, 0.9, 0.87, 0.98, 0.83, 0.78, 0.7)
"""Heights of the hips, in leg lengths, in the order of preference."""
PERIODS = (3.5, 4.5, 6.0)
"""Of a step, in periods of a pendulum as long as the legs over 2 pi."""
USE = 0.9
"""Share of a joint's speed and torque that a gait may take."""
INSIDE = 0.15
"""Least distance of the ZMP inside the support polygon, in halves of its narrower side while on one foot."""
_FULL = 4
"""Gaits that are planned in full before the search gives up."""
_STEPS = 3


@dataclass(frozen=True)
class _Judged:
    """A gait planned in full and why it will not do; empty if it does."""

    gait: Gait
    reasons: tuple[str, ...]


def fitting_gait(robot: Robot) -> Gait:
    """A straight walk that a robot can do by its own model, given in its lengths.

    Args:
        robot: with legs, soles and a ``home`` posture.

    Returns:
        The gait; its numbers are formulas over the lengths of a robot, so that it can be tried on another.

    Raises:
        NoSolutionError: none of the gaits tried will do; it says what the best of them asks too much of.
        InputError: the robot cannot walk at all: no legs, soles, ``home`` posture or floating base.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> bool(sk.walk(robot, sk.fitting_gait(robot), steps=2).margin.min() > 0)
        True
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    base, tried = fitted(load_gait("auto"), robot), []
    for period in PERIODS:
        gaits = [base.replace(period=period, **changes) for changes in _changes()]
        promising = [
            gait
            for gait, walked in zip(gaits, coarse_walks(robot, gaits), strict=True)
            if walked is not None and walked.reached and _slow(robot, walked)
        ]
        for gait in promising[:_FULL]:
            tried.append(_judged(robot, gait))
            if not tried[-1].reasons:
                return gait
    raise NoSolutionError(_refusal(robot, base, tried))


def _changes() -> Iterator[Mapping[str, str | float]]:
    """What changes from gait to gait: sizes first, since a smaller step asks less of everything."""
    for (stride, lift), bend in product(SIZES, BENDS):
        yield {"stride": f"{stride:g}*leg", "lift": f"{lift:g}*leg", "bend": bend}


def _slow(robot: Robot, walked: Coarse) -> bool:
    """Whether the joints of a coarse walk stay below their greatest speeds."""
    speeds = np.abs(np.gradient(walked.q, walked.time, axis=0)).max(axis=0)
    return bool((speeds <= [joint.velocity for joint in robot.joints]).all())


def _judged(robot: Robot, gait: Gait) -> _Judged:
    try:
        trajectory = walk(robot, gait, _STEPS)
    except ScrewkinError as error:
        return _Judged(gait, (str(error),))
    return _Judged(gait, (*_unbalanced(trajectory), *_overloaded(robot, trajectory)))


def _unbalanced(trajectory: Trajectory) -> Iterator[str]:
    margin = float(trajectory.margin.min())
    if not margin > 0:
        yield f"the ZMP comes {-1e3 * margin:.1f} mm out of the support polygon"


def _overloaded(robot: Robot, trajectory: Trajectory) -> Iterator[str]:
    """Joints that would be faster or stronger than they can, at ``USE`` of their limits."""
    torques = np.abs(walking_torques(robot, trajectory)).max(axis=0)
    speeds = np.abs(trajectory.qd).max(axis=0)
    for joint, torque, speed in zip(robot.joints, torques, speeds, strict=True):
        unit, force = ("m/s", "N") if joint.type == "prismatic" else ("rad/s", "N m")
        if speed > USE * joint.velocity:
            yield f"{joint.name} turns at {speed:.3g} of {joint.velocity:.3g} {unit}"
        if torque > USE * joint.effort:
            yield f"{joint.name} needs {torque:.3g} of {joint.effort:.3g} {force}"


def _refusal(robot: Robot, base: Gait, tried: Sequence[_Judged]) -> str:
    """Why no gait was found: what the one that failed least asks too much of, or how the first ended."""
    if tried:
        best = min(tried, key=lambda judged: len(judged.reasons))
        size = f"stride {best.gait.stride:.3g} m, Tc {best.gait.Tc:.3g} s"
        return f"{robot.name}: no gait fits; with {size}: {'; '.join(best.reasons)}"
    smallest = base.replace(**list(_changes())[-len(BENDS)])
    reasons = _judged(robot, smallest).reasons
    why = "; ".join(reasons) or "joints would be faster than they can"
    return f"{robot.name}: no gait fits; with stride {smallest.stride:.3g} m: {why}"
