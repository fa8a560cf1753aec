"""The law of a stabilised walk: a pendulum, pulled to the measured one, and where it lets a foot land.

The pendulum stands on the internal ZMP; xi = c + c'/w is its divergent component of motion (DCM), with
w^2 = g/h. What the real robot does beside it pulls it, at once: the pendulum is what the legs follow, so the
plan goes to the robot and not the robot to the plan. Then, in this order: the ZMP moves within the sole, the
step is taken sooner or later, and the foot lands elsewhere.

Everything is in the axes of the stance foot; lengths in m, times in s. Scalars of any kind.
Source: Englsberger, Ott, Albu-Schaeffer (2015), the DCM and its shift per step; Khadiv et al. (2020), place
and time of a step together; Kajita et al. (2010), the pull of the model to the robot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from screwkin.algebra.scalar import Scalar, larger, least, sin, sqrt, where
from screwkin.kinematics.mass import GRAVITY
from screwkin.stabiliser.pairs import (
    Pair,
    clipped,
    exponential,
    logarithm,
    pair_difference,
    pair_sum,
    pair_within,
)

APART = 0.025
"""Between the soles at least, as a share of the CoM's height."""
QUICK = 0.073
"""By how much a landing place moves in a cycle at most, as a share of the CoM's height."""
LATE = 0.85
"""Share of a swing from which the landing place stays."""
MOMENT = 3.0
"""Cycles before a landing from which its time stays."""
SOONEST = 1.3
"""Time of a swing, in time constants of the pendulum, to which slow steps of a robot that falls are cut."""
SETTLED = 0.775
"""Time before a landing from which the wanted ZMP stays, in time constants of the pendulum."""


def pendulum(com: Pair, rate: Pair, zmp: Pair, w: Scalar, dt: Scalar) -> tuple[Pair, Pair]:
    """Place and rate of the pendulum after dt on a fixed ZMP: exact."""
    grown = exponential(w * dt)
    c, s = 0.5 * (grown + 1.0 / grown), 0.5 * (grown - 1.0 / grown)
    off = pair_difference(com, zmp)
    return (
        pair_sum(pair_sum(zmp, off, c), rate, s / w),
        (w * s * off[0] + c * rate[0], w * s * off[1] + c * rate[1]),
    )


def progress(u: Scalar, ramp: float = 0.25) -> Scalar:
    """Share of a swing's way at share u of its time: cosine ramps at both ends, even speed between."""
    speed, pi = 1.0 / (1.0 - ramp), math.pi

    def rising(v: Scalar) -> Scalar:
        return speed * (0.5 * v - ramp / (2 * pi) * sin(pi / ramp * v))

    even = speed * (u - 0.5 * ramp)
    return where(u < ramp, rising(u), where(u > 1.0 - ramp, 1.0 - rising(1.0 - u), even))


def raised(u: Scalar, ramp: float = 0.35) -> Scalar:
    """Share of a swing's lift at share u of its time: smooth up, level, and down."""
    v = clipped(least(u, 1.0 - u) * (1.0 / ramp), 0.0, 1.0)
    return v * v * (3.0 - 2.0 * v)


@dataclass(frozen=True)
class Gains:
    """How strongly a stabiliser answers; its own figures, none of the robot's: its lengths are shares.

    pull: share of the DCM's error beyond dead that the pendulum takes over in a cycle, ahead and aside;
    rate_filter: of the error's rate, share of the newest; lean: share of the trunk's lean by which the
    swing foot turns; lean_filter: share of the newest; level_time: time constant of what lasts, the floor's
    slope and the CoM's gap [s]; trim: share of that gap which the waist takes back; sole: share of the sole,
    less margin, in which the ZMP may go; step: share of what is left that the foot's place takes, up to reach
    ahead and aside; timing: share of it that the step's time takes, within sooner to later of the planned
    time, or as soon as ``SOONEST`` says, by at most two cycles a cycle; largest: error of the DCM beyond
    which it counts no more.
    dead and margin are shares of half the sole's width, reach and largest of the CoM's height.
    """

    pull: Pair = (0.12, 0.12)
    rate_filter: Scalar = 0.4
    lean: Scalar = 0.6
    lean_filter: Scalar = 0.5
    level_time: Scalar = 1.0
    dead: Scalar = 0.36
    sole: Scalar = 0.6
    margin: Scalar = 0.18
    step: Scalar = 1.0
    reach: Pair = (0.43, 0.31)
    timing: Scalar = 1.0
    sooner: Scalar = 0.7
    later: Scalar = 1.4
    largest: Scalar = 0.37
    trim: Scalar = 0.5


@dataclass(frozen=True)
class Rhythm:
    """The walk that is to be stabilised: what is planned and constant.

    period: of a step [s]; double: share of it on both feet; lift [m]; com_height: of the CoM [m]; apart: from
    the middle to a foot [m]; half: half edges of the sole, and middle: of the sole ahead of the tip and
    outwards [m]; beginning: from rest to the first step [s]; dt: of a cycle [s].
    inward: from there to where the ZMP of a step stands: out over the edge is no way back [m].
    rest: where the CoM rests after the last step, ahead and to the left of the middle between the tips [m].
    """

    period: Scalar
    double: Scalar
    lift: Scalar
    com_height: Scalar
    apart: Scalar
    half: Pair
    middle: Pair
    beginning: Scalar = 0.8
    dt: Scalar = 0.01
    inward: Scalar = 0.0
    rest: Pair = (0.0, 0.0)

    @property
    def w(self) -> Scalar:
        """Rate of divergence [1/s]."""
        return sqrt(GRAVITY / self.com_height)

    @property
    def under(self) -> Pair:
        """Where the ZMP of a step stands on a sole, ahead of the tip and outwards [m]."""
        return self.middle[0], self.middle[1] - self.inward

    @property
    def both(self) -> Scalar:
        """Time on both feet in a step [s]."""
        return self.double * self.period


@dataclass(frozen=True)
class Landing:
    """What a cycle of a step decides: ZMP and landing place in the stance foot's axes, and duration."""

    zmp: Pair
    place: Pair
    period: Scalar
    held: Pair


def waited(z: Scalar) -> Scalar:
    """1 - (1 - e^-z)/z of z from 0 to 3: share of a ZMP's distance by which a ramp lets the DCM grow more.

    While the ZMP goes evenly to a point within time t, the DCM runs from that point as if it had stood
    further away by this share of the ZMP's distance, at z = w t.
    """
    total: Scalar = 0.0
    for k in range(24, 0, -1):
        total = (1.0 - total) * z * (1.0 / (k + 1))
    return total


def delay(rhythm: Rhythm, time: Scalar) -> Scalar:
    """``waited`` of a ZMP that goes in cycles, in each of which it stands where the ramp is at its end."""
    cycle = waited(rhythm.w * rhythm.dt)
    return larger(1.0 - (1.0 - waited(rhythm.w * time)) / (1.0 - cycle), 0.0)


def entry(rhythm: Rhythm, side: Scalar, came: Pair, step: Sequence[Scalar]) -> Pair:
    """DCM beside a foot's ZMP as it begins to stand, so that its step ends as the next ones need it.

    Args:
        rhythm: what is constant.
        side: of that foot, +1 left.
        came: by how much the ZMP moves to it, in its axes [m].
        step: displacement (forward, left) of the other foot while it stands; later ones are taken for alike.
    """
    growth, late = exponential(rhythm.w * rhythm.period), delay(rhythm, rhythm.both)
    alike, turns = (1.0 - growth * late) / (growth - 1.0), (1.0 + growth * late) / (growth + 1.0)
    wide = 2.0 * (rhythm.apart + rhythm.under[1])  # between the ZMPs of both feet
    goes = step[0], step[1] - side * wide
    later = step[0] * alike, step[1] * alike + side * wide * turns
    return (goes[0] + later[0]) / growth - late * came[0], (goes[1] + later[1]) / growth - late * came[1]


def nominal_place(rhythm: Rhythm, side: Scalar, step: Sequence[Scalar]) -> Pair:
    """Where a planned step (forward, left) lands, in the axes of the foot that stands, of side +1 left."""
    return step[0], step[1] - side * (2.0 * rhythm.apart)


class StepState(Protocol):
    """What the law asks of a walk in course; see ``cycle.Memory``."""

    @property
    def tau(self) -> Scalar:
        """Time in the mode [s]."""

    @property
    def period(self) -> Scalar:
        """Duration of the step [s]."""

    @property
    def side(self) -> Scalar:
        """Of the foot that stands, +1 left."""

    @property
    def held(self) -> Pair:
        """Wanted ZMP of the cycle before."""

    @property
    def place(self) -> Pair:
        """Landing place of the cycle before."""


def step_landing(
    rhythm: Rhythm,
    gains: Gains,
    course: StepState,
    dcm: Pair,
    zmp: Pair,
    steps: Sequence[Sequence[Scalar]],
    more: Scalar,
    feedback: Scalar,
) -> Landing:
    """ZMP, landing place and time of a step in course.

    Args:
        rhythm: of the walk.
        gains: of the stabiliser.
        course: of the cycle before.
        dcm: beside the stance foot's tip, in its axes.
        zmp: of the cycle before, likewise.
        steps: displacements (forward, left) of this step and of the next.
        more: how many follow; the last one ends as rest between the feet needs it.
        feedback: 0 leaves place and time as planned.
    """
    w, dt = rhythm.w, rhythm.dt
    side, tau = course.side, course.tau
    (cx, cy), (hx, hy) = rhythm.under, rhythm.half
    here = cx, side * cy
    nominal = nominal_place(rhythm, side, steps[0])
    late, goal = delay(rhythm, rhythm.both), _goal(rhythm, side, nominal, steps[1], more)
    left = larger(course.period - tau, dt)
    growth = exponential(w * left)
    ramp = growth * delay(rhythm, clipped(rhythm.both - tau, 0.0, rhythm.both))
    wanted = tuple(
        (g - growth * x + ramp * z) / (1.0 - growth + ramp - late)
        for g, x, z in zip(goal, dcm, zmp, strict=True)
    )
    far = w * left > SETTLED
    held = where(far, wanted[0], course.held[0]), where(far, wanted[1], course.held[1])
    room = gains.sole * (hx - gains.margin * hy), gains.sole * (hy - gains.margin * hy)
    aim = pair_within(held, pair_difference(here, room), pair_sum(here, room))
    goal = pair_sum(goal, aim, late)
    h, wide = rhythm.com_height, 2.0 * rhythm.apart
    rx, ry = gains.reach[0] * h, gains.reach[1] * h
    back, ahead = least(nominal[0], 0.0) - rx, larger(nominal[0], 0.0) + rx
    spare = back - nominal[0], ahead - nominal[0]
    period = _timed(
        rhythm, gains, course, pair_difference(goal, aim), pair_difference(dcm, aim), spare, feedback
    )
    growth = exponential(w * larger(period - tau, dt))
    end = pair_sum(pair_sum(aim, pair_difference(dcm, aim), growth), pair_difference(zmp, aim), -ramp)
    free = pair_sum(nominal, pair_difference(end, goal), gains.step * feedback)  # what the ZMP leaves
    close = larger(wide - ry, 2.0 * (hy - rhythm.middle[1]) + APART * h)
    quick = QUICK * h, QUICK * h
    slow = -QUICK * h, -QUICK * h
    bounded = (
        clipped(free[0], back, ahead),
        -side * clipped(-side * free[1], close, wide + ry),
    )
    share = (tau - rhythm.both) / larger(period - rhythm.both, 1e-3)
    moved = pair_sum(course.place, pair_within(pair_difference(bounded, course.place), slow, quick))
    still = share >= LATE
    chosen = where(still, course.place[0], moved[0]), where(still, course.place[1], moved[1])
    return Landing(aim, chosen, period, held)


def _goal(rhythm: Rhythm, side: Scalar, nominal: Pair, step: Sequence[Scalar], more: Scalar) -> Pair:
    """The DCM at the end of a step that lands as planned, had the ZMP stayed at the tip.

    More steps follow as ``entry`` says, or the ZMP then goes evenly to where the CoM rests.
    """
    foot = pair_sum(nominal, (rhythm.under[0], -side * rhythm.under[1]))
    onwards = pair_sum(foot, entry(rhythm, -side, foot, step))
    rest = pair_sum(rhythm.rest, nominal, 0.5)
    stays = pair_sum(rest, rest, -delay(rhythm, rhythm.both))
    last = more < 0.5
    return where(last, stays[0], onwards[0]), where(last, stays[1], onwards[1])


def _timed(
    rhythm: Rhythm, gains: Gains, course: StepState, wanted: Pair, now: Pair, spare: Pair, feedback: Scalar
) -> Scalar:
    """Duration of the step with which the DCM aside grows from where it is to where the next step wants it.

    Both are beside the ZMP: where that suffices, the step takes its time; but it lands before the DCM has run
    further ahead than the foot can reach, and soon where the DCM falls out over the foot that stands. It
    changes by at most two cycles a cycle, once both feet have stood for their share, and not in the last
    moment. spare: how far the foot can land behind and ahead of its planned place.
    """
    w, T, tau, h = rhythm.w, rhythm.period, course.tau, rhythm.com_height
    moment, nought = MOMENT * rhythm.dt, 1e-6 * h * h
    most, free = exponential(2.0 * rhythm.dt * w), (tau > rhythm.both) & (course.period - tau > moment)
    growth = exponential(w * larger(course.period - tau, rhythm.dt))

    def ratio(goal: Scalar, here: Scalar, otherwise: Scalar) -> Scalar:
        runs = goal * here > nought
        return clipped(where(runs, goal / where(runs, here * growth, 1.0), otherwise), 1.0 / most, most)

    reach = where(now[0] > 0.0, spare[1], spare[0])
    fits = least(ratio(wanted[1], now[1], 1.0 / most), ratio(wanted[0] + reach, now[0], most))
    change = feedback * gains.timing / w * logarithm(fits)
    soonest = least(gains.sooner * T, rhythm.both + SOONEST / w)
    timed = larger(clipped(course.period + change, soonest, gains.later * T), tau + moment)
    return where(free, timed, course.period)


def first_shift(rhythm: Rhythm, course: StepState, dcm: Pair, beside: Pair, step: Sequence[Scalar]) -> Pair:
    """ZMP that brings the DCM from rest onto the periodic orbit of the steps, within both soles.

    It stays there until the first step begins and goes evenly under the foot that stands then; what it
    lacks there would grow from step to step.

    Args:
        rhythm: what is constant.
        course: time since it began, and side of the foot that will stand.
        dcm: in the axes of that foot.
        beside: the other foot, in them.
        step: displacement (forward, left) of the first step; later ones are taken for alike.
    """
    here = rhythm.under[0], course.side * rhythm.under[1]
    goal = pair_sum(here, entry(rhythm, course.side, here, step))  # as if the ZMP came from the tip
    late = delay(rhythm, rhythm.both)
    settle = exponential(rhythm.w * larger(rhythm.beginning - course.tau, rhythm.dt))
    zmp = tuple((g - x * settle) / (1.0 - settle - late) for g, x in zip(goal, dcm, strict=True))
    return _between(rhythm, (zmp[0], zmp[1]), beside)


def stopping_zmp(rhythm: Rhythm, tau: Scalar, dcm: Pair, zmp: Pair, beside: Pair) -> Pair:
    """ZMP that brings the DCM to rest between the feet, within both soles.

    It goes there evenly while both feet would stand in a step, and then stands half as far again from the
    point of rest as the DCM.

    Args:
        rhythm: what is constant.
        tau: since the last foot landed [s].
        dcm: in the axes of that foot.
        zmp: of the cycle before, likewise.
        beside: the other foot, likewise.
    """
    rest, left = pair_sum(rhythm.rest, beside, 0.5), larger(rhythm.both - tau, 0.0)
    growth = exponential(rhythm.w * left)
    ramp = growth * delay(rhythm, left)
    share = 1.5 / (1.0 - 1.5 * (1.0 - growth + ramp))
    ahead, aside = (
        share * (growth * (x - r) - ramp * (z - r)) for x, z, r in zip(dcm, zmp, rest, strict=True)
    )
    return _between(rhythm, pair_sum(rest, (ahead, aside)), beside)


def _between(rhythm: Rhythm, zmp: Pair, beside: Pair) -> Pair:
    """The nearest ZMP of the box about both feet, three quarters of their soles."""
    (hx, hy), mx = rhythm.half, rhythm.middle[0]
    low = least(beside[0], 0.0) + mx - 0.75 * hx, least(beside[1], 0.0) - 0.75 * hy
    high = larger(beside[0], 0.0) + mx + 0.75 * hx, larger(beside[1], 0.0) + 0.75 * hy
    return pair_within(zmp, low, high)
