"""A gait that fits a robot: how large, quick and bent its steps may be by limits, speeds and torques.

The search goes from large, quick steps on bent legs to small, slow ones on straight legs; legs without a
roll axis at the ankle are tried last with a waist that leans (``gait.steering``), in quicker steps. What is
weak is spared then, in this order: ankles, by a ZMP that stays near them; hips that turn in little, by a ZMP
on the inner half of the sole; hips that cannot carry the waist beside them, by a waist that leans over them;
slow joints, by steps so slow that the weight is shifted while both feet stand. Many gaits are tried coarsely
in one batch; the first promising ones are planned in full and judged by the model alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.errors import NoSolutionError, ScrewkinError, expect
from screwkin.gait.coarse import Coarse, coarse_walks
from screwkin.gait.driven import arms_of, driven
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.files import load_gait
from screwkin.gait.lengths import fitted
from screwkin.gait.realise import free_rotations
from screwkin.gait.record import Gait
from screwkin.gait.walk import planned_walk
from screwkin.mechanism.choice import closed_mechanism
from screwkin.model.inertias import inertia_matrix
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

TRIES = (
    (0.3, 0.06, (0.93, 0.9, 0.87, 0.83, 0.78)),
    (0.2, 0.06, (0.93, 0.96, 0.9, 0.87, 0.83, 0.78, 0.7)),
    (0.1, 0.04, (0.97, 0.95, 0.93, 0.9, 0.87, 0.83, 0.78, 0.7)),
    (0.05, 0.03, (0.98, 0.96, 0.93, 0.9, 0.87, 0.83, 0.78, 0.7)),
)
"""Stride, lift and heights of the hips, in leg lengths: from large steps to small ones on straighter legs."""
PERIODS = (3.5, 4.5, 6.0)
"""Of a step, in periods of a pendulum as long as the legs over 2 pi."""
LEANING = (2.0, 1.5, 1.0)
"""Likewise, of steps with a waist that leans."""
START = 4.0
"""Time that a quick walk takes to begin and to end, likewise: for so long the next steps move the CoM."""
BACK = 0.3
"""How far ahead of ankles that are too weak for the middle of the sole the ZMP goes, by that."""
QUICK = (2.5, 2.0)
"""Periods of steps that need less sway, where joints of the hips or ankles cannot turn far enough for it."""
INWARD = 0.5
"""How far from the middle of the sole to its inner edge the ZMP goes, where hips turn in too little."""
SLOW = (8.0, 14.0)
"""Periods of steps in which the weight is shifted slowly, for joints that are slow or weak."""
SHIFTED = 0.5
"""Share of such a step in which both feet stand: so long the CoM takes from one to the other."""
USE = 0.9
"""Share of a joint's speed and torque that a gait may take."""
_STEPS = 3
_SPREAD = 2.0  # leg lengths: radii of gyration beyond it are in other units


@dataclass(frozen=True)
class _Judged:
    """A gait planned in full and why it will not do, empty if it does.

    cut_short: there is no such walk; weak: it only asks too much of joints.
    """

    gait: Gait
    reasons: tuple[str, ...]
    cut_short: bool = False
    weak: bool = False


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
    base, tried = fitted(load_gait("auto"), robot), list[_Judged]()
    for paces in (_paces(robot, base), _sparing(base)):
        begun = len(tried)
        for paced in paces:
            for gait in _promising(robot, paced):
                tried.append(_judged(robot, gait))
                if not tried[-1].reasons:
                    return gait
        for judged in [one for one in tried[begun:] if one.weak]:
            tried.append(_judged(robot, judged.gait.replace(ahead=BACK)))
            if not tried[-1].reasons:
                return tried[-1].gait
    raise NoSolutionError(_refusal(robot, base, tried))


def _paces(robot: Robot, base: Gait) -> Iterator[Gait]:
    """The gait at several periods, then in quick steps; where no joint keeps soles level, the waist leans.

    Sway and lean grow with the period: the CoM of a slow step has to come over the sole itself.
    """
    yield from (base.replace(period=period) for period in PERIODS)
    free = free_rotations(closed_mechanism(driven(robot, arms_of(robot)).moving))
    rolls = any("rx" in rotations and "ry" not in rotations for rotations in free.values())
    lateral, periods = ("lean", LEANING) if rolls else ("shift", QUICK)
    yield from (base.replace(lateral=lateral, period=p, stand=START / p) for p in periods)


def _sparing(base: Gait) -> Iterator[Gait]:
    """The gait with less sway, in quick steps; with a waist that leans over the foot; and in slow steps.

    A hip carries all but its leg beside it, by the distance that its CoM keeps from the hip: only a lean
    makes that shorter. The CoM of a slow step goes from foot to foot as fast as the ZMP does, or faster than
    joints can if it is left to fall over: so long both feet stand.
    """
    yield from (base.replace(inward=INWARD, period=p, stand=START / p) for p in QUICK)
    yield from (base.replace(lateral="lean", period=p, stand=START / p) for p in LEANING)
    yield from (base.replace(period=period, dsp=SHIFTED) for period in SLOW)


def _promising(robot: Robot, base: Gait) -> list[Gait]:
    """Of every size the first gait that the legs can follow, coarsely, at speeds that they have."""
    several = [
        [base.replace(stride=f"{stride:g}*leg", lift=f"{lift:g}*leg", bend=bend) for bend in bends]
        for stride, lift, bends in TRIES
    ]
    walks = iter(coarse_walks(robot, [gait for gaits in several for gait in gaits]))
    good = [[gait for gait in gaits if _possible(robot, next(walks))] for gaits in several]
    return [gaits[0] for gaits in good if gaits]


def _possible(robot: Robot, walked: Coarse | None) -> bool:
    """Whether a coarse walk is in reach, and its joints stay below their greatest speeds."""
    if walked is None or not walked.reached:
        return False
    speeds = np.abs(np.gradient(walked.q, walked.time, axis=0)).max(axis=0)
    return bool((speeds <= [joint.velocity for joint in robot.joints]).all())


def _judged(robot: Robot, gait: Gait) -> _Judged:
    try:
        trajectory = planned_walk(robot, gait, _STEPS)
    except ScrewkinError as error:
        return _Judged(gait, (str(error),), cut_short=True)
    unbalanced, overloaded = tuple(_unbalanced(trajectory)), tuple(_overloaded(robot, trajectory))
    return _Judged(gait, (*unbalanced, *overloaded), weak=bool(overloaded) and not unbalanced)


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
        best = min(tried, key=lambda judged: (judged.cut_short, len(judged.reasons)))
        size = f"stride {best.gait.stride:.3g} m, Tc {best.gait.Tc:.3g} s"
        return f"{robot.name}: no gait fits; with {size}: {'; '.join(best.reasons)}{_spread(robot, base)}"
    stride, lift, _ = TRIES[-1]
    smallest = base.replace(stride=f"{stride:g}*leg", lift=f"{lift:g}*leg")
    reasons = _judged(robot, smallest).reasons
    why = "; ".join(reasons) or "joints would be faster than they can"
    return f"{robot.name}: no gait fits; with stride {smallest.stride:.3g} m: {why}"


def _spread(robot: Robot, base: Gait) -> str:
    """A word on inertias that no body of the robot's size has: no balance can be planned with them."""
    radii = [
        float(np.sqrt(max(np.linalg.eigvalsh(inertia_matrix(link.inertia))[-1], 0.0) / float(link.mass)))
        for link in robot.links
        if float(link.mass) > 0
    ]
    large = [radius for radius in radii if radius > _SPREAD * base.lengths["leg"]]
    if not large:
        return ""
    return (
        f". {len(large)} links have inertias of bodies of {max(large):.2g} m radius of gyration, where legs"
        f" are {base.lengths['leg']:.2g} m: check their units (screwkin check)"
    )
