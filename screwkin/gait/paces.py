"""What the search for a fitting gait tries: sizes and paces of steps, and what spares weak joints.

Ankles are spared from the start: the ZMP keeps as near to them as their torque asks for. Soles that would
touch at home are set apart. Legs without a roll axis at the ankle lean (``gait.steering``), as a waist that
shifts would tilt their soles, and the ZMP of all links is led, as no ankle rights a sole that tips. Where the
usual pace will not do, these follow:

- of legs that lean, quicker steps, the ZMP nearer to the ankles, then on the inner half of the soles;
- slower steps, for quick joints, and quicker ones, which need less sway;
- quick steps whose ZMP keeps to the inner half of the sole, then with the feet apart, for hips that turn in
  little;
- feet nearer to each other, where soles leave room: less sway then leaves legs more of their reach;
- a waist that tilts, then with the feet apart, or leans over the foot that stands: a hip carries all but its
  leg beside it, by the distance that its CoM keeps from the hip, and only a lean makes that shorter; where
  the waist also shifts, as it does when it tilts about a line below the hips, less of a lean is needed, and
  the step may take its time;
- quick steps whose ZMP keeps beside the ankles, for hips that bend little: these are then further back;
- steps so slow that the weight is shifted while both feet stand, for joints that are slow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import as_array, vector_from_array
from screwkin.dynamics.support import convex_hull
from screwkin.gait.driven import arms_of, driven
from screwkin.gait.files import load_gait
from screwkin.gait.lengths import fitted
from screwkin.gait.realise import free_rotations
from screwkin.gait.record import Gait
from screwkin.gait.soles import sole_distance
from screwkin.gait.stance import stance_of
from screwkin.kinematics.landmarks import waist_frame
from screwkin.kinematics.mass import GRAVITY
from screwkin.kinematics.positions import chain_jacobian, successive_displacement, tree_positions
from screwkin.mechanism.choice import closed_mechanism
from screwkin.model.robot import Robot

PERIODS = (3.5, 4.5, 6.0)
"""Of a step, in periods of a pendulum as long as the legs over 2 pi."""
LEANING = (2.0, 1.5, 1.0)
"""Likewise, of steps with a waist that leans."""
TILTING = (3.5, 4.5)
"""Likewise, of steps with a waist that tilts."""
QUICK_PERIODS = (2.5, 2.0)
"""Likewise, of steps that need less sway, where joints of hips or ankles cannot turn far enough for it."""
SLOW_PERIODS = (8.0, 14.0)
"""Likewise, of steps in which the weight is shifted slowly, for joints that are slow or weak."""
START = 4.0
"""Time that a quick walk takes to begin and to end, likewise: for so long the next steps move the CoM."""
SHIFTED = 0.5
"""Share of a slow step in which both feet stand: so long the CoM takes from one to the other."""
INWARD = 0.5
"""How far from the middle of the sole to its inner edge the ZMP goes, where hips turn in too little."""
WIDER = 0.05
"""How much further each foot then stands from the middle, in leg lengths."""
NEARER = 0.1
"""How much nearer to the middle each foot stands at most, where sway takes too much reach, in leg lengths."""
PIVOT = 0.5
"""Height of the line about which a waist tilts, in leg lengths."""
SOLE_GAP = 0.02
"""Least gap between the feet, in leg lengths."""
STANDING_SHARE = 0.3
"""Share of an ankle's torque with which it carries the robot on one foot."""
EXACT = 1e-8
"""Weight of changes of the jerk where no ankle rights a sole that tips: the ZMP is to be where it should."""
FINE = 8
"""Samples, at least, in which the weight then goes from foot to foot, and soles turn level with it."""
LEAST_AHEAD = 0.3
"""How far ahead of the ankles the ZMP goes at least, by the middle of the sole."""
_LATERAL = 0.7
"""Cosine to the sideways axis, above which a joint tips the foot forwards."""


@dataclass(frozen=True)
class StepSize:
    """Stride, lift and heights of the hips that are tried in turn, in leg lengths."""

    stride: float
    lift: float
    bends: tuple[float, ...]


STEP_SIZES = (
    StepSize(0.3, 0.06, (0.93, 0.9, 0.87, 0.83, 0.78)),
    StepSize(0.2, 0.06, (0.93, 0.95, 0.96, 0.94, 0.9, 0.87, 0.83, 0.78, 0.7)),
    StepSize(0.1, 0.04, (0.97, 0.95, 0.94, 0.93, 0.9, 0.87, 0.83, 0.78, 0.7)),
    StepSize(0.05, 0.03, (0.98, 0.96, 0.95, 0.94, 0.93, 0.9, 0.87, 0.83, 0.78, 0.7)),
    StepSize(0.03, 0.02, (0.98, 0.96, 0.95, 0.94, 0.93, 0.9, 0.87, 0.83, 0.78, 0.7)),
)
"""From large steps to small ones on straighter legs."""


def usual_pace(robot: Robot) -> Gait:
    """The gait that is tried first, in the lengths of a robot.

    Args:
        robot: with legs, soles and a ``home`` posture.

    Raises:
        InputError: it cannot walk: see ``stance_of``.
    """
    gait = fitted(load_gait("auto"), robot)
    apart, ahead = _spread(robot, gait), _ahead(robot)
    if apart > 0:
        gait = gait.replace(spread=f"{apart:.4g}*leg")
    if ahead < 1:
        gait = gait.replace(ahead=ahead)
    if _without_ankle_roll(robot):
        return _level(gait.replace(model="links", R=EXACT), LEANING[0])
    return gait.replace(period=PERIODS[0])


def other_paces(robot: Robot, usual: Gait) -> Iterator[Gait]:
    """The gait at other paces, in the order in which they are tried.

    Args:
        robot: with legs, soles and a ``home`` posture.
        usual: from ``usual_pace``.
    """
    if _without_ankle_roll(robot):
        yield from (_level(usual, period) for period in LEANING[1:])
        if usual.numbers["ahead"] > LEAST_AHEAD:
            yield from (_level(usual.replace(ahead=LEAST_AHEAD), period) for period in LEANING)
        yield from (_level(usual.replace(inward=INWARD), period) for period in LEANING)
        return
    upright = usual.replace(lateral="shift", stand=1, period=PERIODS[0])
    yield from (upright.replace(period=period) for period in PERIODS[1:])
    yield from (_quick(upright, period) for period in QUICK_PERIODS)
    inward = upright.replace(inward=INWARD)
    yield from (_quick(inward, period) for period in QUICK_PERIODS)
    wide = f"{_spread(robot, usual) + WIDER:.4g}*leg"
    yield from (_quick(inward.replace(spread=wide), period) for period in QUICK_PERIODS)
    nearer = min(NEARER, 0.5 * (_gap(robot, usual) - SOLE_GAP))
    if nearer > 0:
        yield upright.replace(spread=f"{-nearer:.4g}*leg")
    tilting = upright.replace(lateral="tilt", pivot=f"{PIVOT:g}*leg")
    yield from (tilting.replace(period=period) for period in TILTING)
    yield tilting.replace(spread=f"{_spread(robot, usual) + 2 * WIDER:.4g}*leg")
    yield from (_leaning(upright, period) for period in LEANING)
    if usual.numbers["ahead"] > 0:
        yield _quick(upright.replace(ahead=0), QUICK_PERIODS[0])
    yield from (upright.replace(period=period, dsp=SHIFTED) for period in SLOW_PERIODS)


def _quick(gait: Gait, period: float) -> Gait:
    return gait.replace(period=period, stand=START / period)


def _leaning(gait: Gait, period: float) -> Gait:
    return _quick(gait.replace(lateral="lean"), period)


def _level(gait: Gait, period: float) -> Gait:
    """A waist that leans over level soles, with samples that show how these turn level."""
    leaning = _leaning(gait, period)
    shown = FINE / (leaning.numbers["dsp"] * leaning.Tc)
    return leaning.replace(rate=float(np.ceil(max(leaning.rate, shown))))


def _without_ankle_roll(robot: Robot) -> bool:
    """Whether soles lean sideways with their legs, but do not tip forwards."""
    free = free_rotations(closed_mechanism(driven(robot, arms_of(robot)).moving))
    return any("rx" in rotations and "ry" not in rotations for rotations in free.values())


def _spread(robot: Robot, gait: Gait) -> float:
    """By how much each foot is to stand further from the middle than at home, in leg lengths."""
    return max(0.0, 0.5 * (SOLE_GAP - _gap(robot, gait)))


def _gap(robot: Robot, gait: Gait) -> float:
    """Distance between the feet at home, in leg lengths."""
    stance, leg = stance_of(robot), gait.lengths["leg"]
    left, right = (
        convex_hull(np.asarray(foot.sole + foot.body, dtype=float))
        + np.array([0.0, foot.side * stance.foot_y])
        for foot in sorted(stance.feet, key=lambda foot: -foot.side)
    )
    return float(sole_distance(left[None], right[None])[0]) / leg


def _ahead(robot: Robot) -> float:
    """How far ahead of the ankles the ZMP goes, by the middle of the sole: as far as they bear all weight."""
    middles = {foot.name: float(np.mean(np.array(foot.sole)[:, 0])) for foot in stance_of(robot).feet}
    most = max(_standing_share(robot, tip, middle) for tip, middle in middles.items())
    return 1.0 if most <= STANDING_SHARE else round(max(LEAST_AHEAD, STANDING_SHARE / most), 2)


def _standing_share(robot: Robot, tip: str, middle: float) -> float:
    """Share of its torque with which the ankle carries the robot on a point ahead of the tip [m]."""
    limb, every = robot.limb(tip), tree_positions(robot, list(robot.posture("home").q))
    path = robot.path_to(limb.link)
    screws, thetas = [robot.tree[i].screw for i in path], [every[i] for i in path]
    place = successive_displacement(screws, thetas, A_ref_k=limb.frame).p
    axes = as_array(waist_frame(robot).R).astype(float)
    point = as_array(place).astype(float) + middle * axes[:, 0]
    columns = chain_jacobian(screws, thetas)
    for i, column in reversed(list(zip(path, columns, strict=True))):
        twist: Array = as_array(at(vector_from_array(point), column)).astype(float)
        if abs(twist[:3] @ axes[:, 1]) > _LATERAL * np.linalg.norm(twist[:3]) > 0:
            motor, ratio = robot.gears[i]
            torque = abs(float(twist[3:] @ axes[:, 2]) * float(ratio)) * float(robot.mass) * GRAVITY
            return torque / robot.joints[motor].effort
    return 0.0
