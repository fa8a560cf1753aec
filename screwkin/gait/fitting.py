"""A gait that fits a robot: how large, quick and bent its steps may be by limits, speeds and torques.

The search begins with steps of a usual pace, from large ones on bent legs to small ones on straight legs
(``gait.paces`` has what is tried). Where none will do, or joints use most of their torque, others follow:
slower and quicker ones, and what spares weak or stiff joints. Of those a small step is tried first; larger
ones follow where it will do. Sizes are tried coarsely in one batch; promising ones are planned in full and
judged by the model alone. A gait that uses at most ``SPARED`` of every torque ends the search; else
``MORE_PACES`` follow after the first that has one that will do, and of all the one that uses least is taken:
landings add to what the motion needs, and so do legs that push against each other while both feet stand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import NoSolutionError, ScrewkinError, expect
from screwkin.gait.coarse import Coarse, coarse_walks
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.paces import STEP_SIZES, StepSize, other_paces, usual_pace
from screwkin.gait.record import Gait
from screwkin.gait.sideways import sideways
from screwkin.gait.walk import planned_walk
from screwkin.model.inertias import inertia_matrix
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory

USE = 0.9
"""Share of a joint's speed and torque that a gait may take."""
SPARED = 0.7
"""Share of every torque with which the search ends at once."""
MORE_PACES = 3
"""Paces with gaits that will do, after the first such pace, that are tried for one that uses less torque."""
NEARLY = 0.02
"""Shares of torque that differ by less are alike: the gait that was tried first is taken."""
LASTING = 0.05
"""How long torques last by which gaits are compared [s]: as long as a verdict's."""
HEIGHTS_JUDGED = 3
"""Of a size, heights of the hips that are judged: the next one where there is no walk at the one before."""
OUTSIDE = "the ZMP comes"
"""How a reason of a ZMP outside the support polygon begins."""
_STEPS = 4  # the default of 6 also ends with the other foot than it begins with
_SPREAD = 2.0  # leg lengths: radii of gyration beyond it are in other units


@dataclass(frozen=True)
class _Judged:
    """A gait planned in full and why it will not do, empty if it does.

    use: greatest share of a joint's torque that lasts; cut_short: there is no such walk.
    """

    gait: Gait
    reasons: tuple[str, ...]
    use: float = np.inf
    cut_short: bool = False


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
    base, tried, paces = usual_pace(robot), list[_Judged](), 0
    for pace in _paces(robot, base):
        since = len(tried)
        for judged in pace:
            tried.append(judged)
            if judged.use <= SPARED and not judged.reasons:
                return judged.gait
        paces += any(not one.reasons for one in tried[since:])
        if paces > MORE_PACES:
            break
    will_do = [one for one in tried if not one.reasons]
    if will_do:
        least = min(one.use for one in will_do)
        return next(one.gait for one in will_do if one.use <= least + NEARLY)
    raise NoSolutionError(_refusal(robot, base, tried))


def _paces(robot: Robot, base: Gait) -> Iterator[Iterator[_Judged]]:
    """Of every pace gaits judged in full, both in the order in which they are to be preferred."""
    yield _of_sizes(robot, base, STEP_SIZES)
    yield from (_from_small(robot, paced) for paced in other_paces(robot, base))


def _from_small(robot: Robot, paced: Gait) -> Iterator[_Judged]:
    """The smallest step judged, and before it larger ones where it will do."""
    *larger, smallest = STEP_SIZES
    small = list(_of_sizes(robot, paced, [smallest]))
    if any(not one.reasons for one in small):
        yield from _of_sizes(robot, paced, larger)
    yield from small


def _of_sizes(robot: Robot, paced: Gait, sizes: Sequence[StepSize]) -> Iterator[_Judged]:
    """Of every size that is promising, the first height of the hips at which there is a walk, judged."""
    for gaits in _promising(robot, paced, sizes):
        yield _first(_judged(robot, gait) for gait in gaits[:HEIGHTS_JUDGED])


def _first(several: Iterable[_Judged]) -> _Judged:
    """The first that is a walk, else the last."""
    for judged in several:
        if not judged.cut_short:
            break
    return judged


def _promising(robot: Robot, paced: Gait, sizes: Sequence[StepSize]) -> list[list[Gait]]:
    """Of every size the gaits that the legs can follow, coarsely, at speeds that they have; none empty."""
    several = [
        [paced.replace(stride=f"{s.stride:g}*leg", lift=f"{s.lift:g}*leg", bend=bend) for bend in s.bends]
        for s in sizes
    ]
    walks = iter(coarse_walks(robot, [gait for gaits in several for gait in gaits]))
    good = [[gait for gait in gaits if _possible(robot, next(walks))] for gaits in several]
    return [gaits for gaits in good if gaits]


def _possible(robot: Robot, walked: Coarse | None) -> bool:
    """Whether a coarse walk is in reach, at speeds that a gait may take."""
    if walked is None or not walked.reached:
        return False
    speeds = np.abs(np.gradient(walked.q, walked.time, axis=0)).max(axis=0)
    return bool((speeds <= [USE * joint.velocity for joint in robot.joints]).all())


def _judged(robot: Robot, gait: Gait) -> _Judged:
    try:
        trajectory = planned_walk(robot, gait, _STEPS)
    except ScrewkinError as error:
        return _Judged(gait, (str(error),), cut_short=True)
    torques = walking_torques(robot, trajectory)
    reasons = *_unbalanced(trajectory), *_overloaded(robot, trajectory, np.abs(torques).max(axis=0))
    lasting = np.abs(_means(torques, round(LASTING * gait.rate))).max(axis=0)
    return _Judged(gait, reasons, float(np.max(lasting / [joint.effort for joint in robot.joints])))


def _means(values: Array, count: int) -> Array:
    """Means over all windows of consecutive rows; of all rows where there are fewer."""
    windows = np.lib.stride_tricks.sliding_window_view(values, min(max(count, 1), len(values)), axis=0)
    return np.asarray(windows.mean(axis=-1))


def _unbalanced(trajectory: Trajectory) -> Iterator[str]:
    margin = float(trajectory.margin.min())
    if not margin > 0:
        yield f"{OUTSIDE} {-1e3 * margin:.1f} mm out of the support polygon"


def _overloaded(robot: Robot, trajectory: Trajectory, torques: Array) -> Iterator[str]:
    """Joints that would be faster or stronger than they can, at ``USE`` of their limits."""
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
        why = "; ".join(best.reasons)
        aside = f". {why_not}" if OUTSIDE in why and (why_not := str(sideways(robot))) else ""
        return f"{robot.name}: no gait fits; with {size}: {why}{aside}{_spread(robot, base)}"
    smallest = base.replace(stride=f"{STEP_SIZES[-1].stride:g}*leg", lift=f"{STEP_SIZES[-1].lift:g}*leg")
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
