"""A gait that fits a robot: how large, quick and bent its steps may be by limits, speeds and torques.

The search begins with steps of a usual pace, from large ones on bent legs to small ones on straight legs
(``gait.paces`` has what is tried). Where none will do, or joints use most of their torque, others follow:
slower and quicker ones, and what spares weak or stiff joints. Of those a small step is tried first; larger
ones follow where it will do. Sizes are tried coarsely in one batch; promising ones are planned in full and
judged by the model alone. A gait that uses at most ``SPARED`` of every torque ends the search; else
``MORE_JUDGED`` are judged after the first that will do, and the one that uses least is taken: landings add to
what the motion needs, and so do legs that push against each other while both feet stand.
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
MORE_JUDGED = 4
"""Gaits judged after the first that will do, for one that uses less torque."""
HEIGHTS_JUDGED = 3
"""Of a size, heights of the hips that are judged: the next one where there is no walk at the one before."""
OUTSIDE = "the ZMP comes"
"""How a reason of a ZMP outside the support polygon begins."""
_STEPS = 3
_SPREAD = 2.0  # leg lengths: radii of gyration beyond it are in other units


@dataclass(frozen=True)
class _Judged:
    """A gait planned in full and why it will not do, empty if it does.

    use: greatest share of a joint's torque; cut_short: there is no such walk.
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
    base, tried, since = usual_pace(robot), list[_Judged](), 0
    for judged in _tries(robot, base):
        tried.append(judged)
        if judged.use <= SPARED and not judged.reasons:
            return judged.gait
        since += any(not one.reasons for one in tried)
        if since > MORE_JUDGED:
            break
    will_do = [one for one in tried if not one.reasons]
    if will_do:
        return min(will_do, key=lambda one: one.use).gait
    raise NoSolutionError(_refusal(robot, base, tried))


def _tries(robot: Robot, base: Gait) -> Iterator[_Judged]:
    """Gaits judged in full, in the order in which they are to be preferred."""
    yield from _of_sizes(robot, base, STEP_SIZES)
    *larger, smallest = STEP_SIZES
    for paced in other_paces(robot, base):
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
    torques = np.abs(walking_torques(robot, trajectory)).max(axis=0)
    reasons = *_unbalanced(trajectory), *_overloaded(robot, trajectory, torques)
    return _Judged(gait, reasons, float(np.max(torques / [joint.effort for joint in robot.joints])))


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
