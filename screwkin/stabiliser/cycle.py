"""A stabilised walk, cycle by cycle: state and senses in, state and joint positions out; no simulator in it.

A cycle is one formula over scalars: plain numbers, or a straight-line program in C (``stabiliser_program``).
It knows what a robot knows: attitude by an IMU, joint positions, force cells in the feet where there are any,
and steps to take. The CoM follows from the attitude and the legs' kinematics, on the foot that stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from screwkin.algebra.scalar import Scalar, atan2, cos, larger, sin, sqrt, where
from screwkin.algebra.se3 import Pose, Rotation, Vector, X, Y, Z, leaves, rotate
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.stabiliser.body import WalkingBody
from screwkin.stabiliser.law import (
    Gains,
    Landing,
    Rhythm,
    first_shift,
    nominal_place,
    pendulum,
    progress,
    raised,
    step_landing,
    stopping_zmp,
)
from screwkin.stabiliser.pairs import (
    Pair,
    clipped,
    either,
    pair_difference,
    pair_sum,
    pair_turned,
    pair_within,
)

Place = tuple[Scalar, Scalar, Scalar]
"""x, y, yaw of a foot on the floor."""
STARTING, STEPPING, STOPPING = 0.0, 1.0, 2.0


@dataclass(frozen=True)
class Memory:
    """What a stabiliser knows from one cycle to the next; scalars, in the order in which arrays hold them.

    mode: starting, stepping or stopping; tau: time in it [s]; period: of the step in course [s]; side: of the
    foot that stands, +1 left; stance, other: feet on the floor, the other one where it stood at last (x, y
    [m], yaw [rad]); com, rate, zmp: of the internal pendulum; held, place: see ``StepState``; seen: side of
    the foot by which the CoM was measured last, 0 if never; gap, gap_rate: of the CoM from the pendulum,
    measured, beside what lasts of it (lasting); error: of the DCM; slope, lean: of the floor and of the
    trunk beside it, about x and y [rad]; waist: x, y.
    """

    mode: Scalar
    tau: Scalar
    period: Scalar
    side: Scalar
    stance: Place
    other: Place
    com: Pair
    rate: Pair
    zmp: Pair
    held: Pair
    place: Pair
    seen: Scalar
    gap: Pair
    gap_rate: Pair
    error: Pair
    slope: Pair
    lean: Pair
    lasting: Pair
    waist: Pair


@dataclass(frozen=True)
class Sensed:
    """What a robot feels: turn of its base against the vertical (any heading), and joint positions [rad].

    By foot, right and left: vertical force [N] and centre of pressure in the tip's axes [m]. Without force
    cells the force is 1 on both feet and the pressure in the middle of the sole.
    """

    attitude: Rotation
    q: Sequence[Scalar]
    force: Pair
    pressure: tuple[Pair, Pair]


@dataclass(frozen=True)
class Ahead:
    """Steps to come: displacements (forward, left, turn) of the step in course and of the next.

    more: how many follow the one in course; height: of the waist now [m].
    """

    steps: tuple[Place, Place]
    more: Scalar
    height: Scalar


@dataclass(frozen=True)
class _Seen:
    """The CoM on the floor, measured by the foot of a side; attitude with the plan's heading; if it holds."""

    com: Pair
    attitude: Rotation
    valid: Scalar
    side: Scalar


def _measured(
    body: WalkingBody, rhythm: Rhythm, memory: Memory, senses: Sensed, swings: Scalar, landing: Scalar
) -> _Seen:
    """Where the CoM is, by the foot that has stood longest, or the other where that one is in the air.

    With both on the floor it is the foot about to swing: servos are late, so the other may still be landing.
    """
    D = link_displacements(body.robot, senses.q)
    com = senses.attitude @ mass_center(body.robot, D)
    older = where(landing, -memory.side, memory.side)
    left = older > 0.0
    feet = [pose_in_base(body.robot, D, tip) for tip in body.tips]
    views = [
        [*_column(senses.attitude @ foot.R.x), *_column(senses.attitude @ foot.R.y),
         *_column(senses.attitude @ foot.p), *pressure, force]
        for foot, pressure, force in zip(feet, senses.pressure, senses.force, strict=True)
    ]  # fmt: skip
    stands, other = either(left, views[1], views[0]), either(left, views[0], views[1])
    aloft = (stands[-1] < 0.25 * (stands[-1] + other[-1])) & (other[-1] > 0.0)
    xx, xy, xz, yx, yy, yz, px, py, pz, kx, ky, _ = either(aloft, other, stands)
    side = where(aloft, -older, older)
    at = either(side * memory.side > 0.0, memory.stance, memory.other)
    outward = side * rhythm.middle[1]
    (hx, hy), mx = rhythm.half, rhythm.middle[0]
    k = pair_within((kx, ky), (mx - hx, outward - hy), (mx + hx, outward + hy))
    pivot = Vector(px + xx * k[0] + yx * k[1], py + xy * k[0] + yy * k[1], pz + xz * k[0] + yz * k[1])
    # Turn about the vertical from the IMU's heading to the plan's.
    size = sqrt(xx * xx + xy * xy)
    ch, sh, cf, sf = xx / size, xy / size, cos(at[2]), sin(at[2])
    c, s = cf * ch + sf * sh, sf * ch - cf * sh
    turn = Rotation(Vector(c, s, 0), Vector(-s, c, 0), Z)
    arm = turn @ (com - pivot)
    place = pair_sum(pair_sum((at[0], at[1]), pair_turned(k, at[2])), (arm.x, arm.y))
    return _Seen(place, turn @ senses.attitude @ body.T_waist_base.R.T, where(swings & aloft, 0.0, 1.0), side)


def _column(v: Vector) -> tuple[Scalar, Scalar, Scalar]:
    return v.x, v.y, v.z


@dataclass(frozen=True, eq=False)
class StabilisedBody:
    """What is constant in a stabilised walk: the robot's body, the walk and how it is stabilised."""

    body: WalkingBody
    rhythm: Rhythm
    gains: Gains


def _estimated(rhythm: Rhythm, gains: Gains, memory: Memory, seen: _Seen) -> tuple[Pair, ...]:
    """Gap, its rate and the DCM's error; slope, lean and what lasts of the gap: all filtered."""
    good, dt = seen.valid > 0.5, rhythm.dt
    off = pair_difference(seen.com, memory.com)
    lasting = pair_sum(memory.lasting, pair_difference(off, memory.lasting), dt / gains.level_time)
    gap = pair_difference(off, lasting)
    far, dead = gains.largest * rhythm.com_height, gains.dead * rhythm.half[1]
    fast = 1.3 * far * rhythm.w
    moved = pair_difference(gap, memory.gap)
    speed = pair_within((moved[0] / dt, moved[1] / dt), (-fast, -fast), (fast, fast))
    share = where(memory.seen * seen.side > 0.5, gains.rate_filter, 0.0)  # another foot: no speed by it
    rate = pair_sum(memory.gap_rate, pair_difference(speed, memory.gap_rate), share)
    whole = pair_sum(gap, rate, 1.0 / rhythm.w)
    beyond = pair_difference(whole, pair_within(whole, (-dead, -dead), (dead, dead)))
    error = pair_within(beyond, (-far, -far), (far, far))
    R = seen.attitude
    about = atan2(-R.z.y, R.z.z), atan2(R.z.x, R.z.z)
    bounded = pair_within(about, (-0.1, -0.1), (0.1, 0.1))
    slope = pair_sum(memory.slope, pair_difference(bounded, memory.slope), dt / gains.level_time)
    beside = pair_within(pair_difference(about, slope), (-0.25, -0.25), (0.25, 0.25))
    lean = pair_sum(memory.lean, pair_difference(beside, memory.lean), gains.lean_filter)
    news = gap, rate, error, slope, lean, lasting
    olds = memory.gap, memory.gap_rate, memory.error, memory.slope, memory.lean, memory.lasting
    return tuple(_pair(either(good, new, old)) for new, old in zip(news, olds, strict=True))


def _pair(two: Sequence[Scalar]) -> Pair:
    return two[0], two[1]


def cycle(
    walker: StabilisedBody,
    memory: Memory,
    senses: Sensed,
    ahead: Ahead,
    q: Sequence[Scalar],
    feedback: Scalar,
) -> tuple[Memory, list[Scalar], Scalar]:
    """One cycle: the memory after it, joint positions to command, and 1 if a foot landed in it, else 0.

    Args:
        walker: what is constant.
        memory: of the cycle before.
        senses: what is felt now.
        ahead: steps to come; after a landing they are those from the next on.
        q: joint positions commanded in the cycle before; joints that are no legs' stay there.
        feedback: 1 with senses, 0 without: the same walk, open loop.
    """
    rhythm, gains = walker.rhythm, walker.gains
    w, dt = rhythm.w, rhythm.dt
    starting, stepping = memory.mode < 0.5, (memory.mode > 0.5) & (memory.mode < 1.5)
    swings = stepping & (memory.tau > rhythm.both)
    seen = _measured(walker.body, rhythm, memory, senses, swings, starting | (memory.tau <= rhythm.both))
    seen = replace(seen, valid=seen.valid * feedback)
    gap, gap_rate, error, slope, lean, lasting = _estimated(rhythm, gains, memory, seen)
    pulls = where(starting, 0.0, seen.valid) * w
    rate = tuple(v + pulls * k * e for v, k, e in zip(memory.rate, gains.pull, error, strict=True))
    origin, yaw = (memory.stance[0], memory.stance[1]), memory.stance[2]
    dcm = pair_turned(pair_difference(pair_sum(memory.com, _pair(rate), 1.0 / w), origin), -yaw)
    beside = pair_turned(pair_difference(_pair(memory.other), origin), -yaw)
    stood = pair_turned(pair_difference(memory.zmp, origin), -yaw)
    steps = [step[:2] for step in ahead.steps]
    decided = step_landing(rhythm, gains, memory, dcm, stood, steps, ahead.more, feedback)
    now = _now(rhythm, memory, decided, starting, stepping, ahead)
    there = pair_sum(
        now.place_before, pair_turned((rhythm.under[0], now.side * rhythm.under[1]), ahead.steps[0][2])
    )
    shift = first_shift(rhythm, memory, dcm, beside, ahead.steps[0][:2])
    under = rhythm.under[0], memory.side * rhythm.under[1]
    begins = starting & (now.mode > 0.5)
    at_rest = either(
        begins, under, either(starting, shift, stopping_zmp(rhythm, memory.tau, dcm, stood, beside))
    )
    zmp = either(stepping, either(now.lands, there, decided.zmp), at_rest)
    evenly = dt / larger(rhythm.both - now.tau, dt)
    ease = where(stepping | begins, evenly, where(starting, 1.0, where(now.tau < rhythm.both, evenly, 0.3)))
    zmp = pair_sum(
        memory.zmp, pair_difference(pair_sum(origin, pair_turned(_pair(zmp), yaw)), memory.zmp), ease
    )
    com, rate = pendulum(memory.com, _pair(rate), zmp, w, dt)
    share = where(stepping & ~now.lands, now.share, 0.0)
    swing = _swing(rhythm, gains, now, share, _pair(lean), feedback)
    center = pair_sum(com, _pair(lasting), -gains.trim * feedback)
    waist, joints = _whole(walker.body, ahead.height, now, swing, center, memory.waist, q)
    after = Memory(
        now.mode, now.tau + dt, now.period, now.side, now.stance, now.other, com, rate, zmp, decided.held,
        now.place, where(seen.valid > 0.5, seen.side, memory.seen), gap, gap_rate, error, slope, lean,
        lasting, waist,
    )  # fmt: skip
    return after, joints, where(now.lands, 1.0, 0.0)


@dataclass(frozen=True)
class _Now:
    """The walk after this cycle's decisions; share: of the swing's time that has passed."""

    mode: Scalar
    tau: Scalar
    period: Scalar
    side: Scalar
    stance: Place
    other: Place
    place: Pair
    place_before: Pair
    turn: Scalar
    turned: Scalar
    share: Scalar
    lands: Scalar


def _now(
    rhythm: Rhythm, memory: Memory, decided: Landing, starting: Scalar, stepping: Scalar, ahead: Ahead
) -> _Now:
    """Feet, mode and time: a step begins after the first shift of weight, and where a foot lands."""
    first, second = ahead.steps
    tau, yaw, side = memory.tau, memory.stance[2], memory.side
    lands = stepping & (tau >= decided.period - 1e-9)
    begins = starting & (tau >= rhythm.beginning - 1e-9)
    anew = lands | begins
    spot = pair_turned(decided.place, yaw)
    landed = (memory.stance[0] + spot[0], memory.stance[1] + spot[1], yaw + first[2])
    mode = where(begins, STEPPING, where(lands, where(ahead.more > 0.5, STEPPING, STOPPING), memory.mode))
    place = either(stepping, decided.place, memory.place)
    place = either(begins, nominal_place(rhythm, side, first), place)
    place = either(lands, nominal_place(rhythm, -side, second), place)
    T, both = rhythm.period, rhythm.both
    share = clipped((tau - both) / larger(decided.period - both, 1e-3), 0.0, 1.0)
    going = where(stepping & ~lands, progress(share), 0.0)
    stance, other = either(lands, landed, memory.stance), either(lands, memory.stance, memory.other)
    apart = other[2] - stance[2] + going * (stance[2] + first[2] - other[2])
    period = where(anew, T, where(stepping, decided.period, memory.period))
    return _Now(
        mode=mode,
        tau=where(anew, 0.0, tau),
        period=period,
        side=where(lands, -side, side),
        stance=_place(stance),
        other=_place(other),
        place=_pair(place),
        place_before=decided.place,
        turn=first[2],
        turned=apart,
        share=share,
        lands=lands,
    )


def _swing(rhythm: Rhythm, gains: Gains, now: _Now, share: Scalar, lean: Pair, feedback: Scalar) -> Pose:
    """Sole of the other foot on the floor: on its way, and turned about the stance foot against the lean."""
    x, y, yaw = now.stance
    spot = pair_turned(now.place, yaw)
    goal = (x + spot[0], y + spot[1], yaw + now.turn)
    gone = progress(share)
    at = [a + (b - a) * gone for a, b in zip(now.other, goal, strict=True)]
    sole = Pose(rotate(Z, at[2]), Vector(at[0], at[1], rhythm.lift * raised(share)))
    answer = gains.lean * feedback * clipped(10.0 * share, 0.0, 1.0)
    against = (rotate(X, answer * lean[0]) @ rotate(Y, answer * lean[1])).T
    pivot = Vector(x, y, 0.0)
    return Pose(against @ sole.R, pivot + against @ (sole.p - pivot))


def _whole(
    body: WalkingBody, height: Scalar, now: _Now, swing: Pose, com: Pair, waist: Pair, q: Sequence[Scalar]
) -> tuple[Pair, list[Scalar]]:
    """Waist and joint positions that bring the CoM over the pendulum: one step of Newton's method a cycle."""
    x, y, yaw = now.stance
    stance = Pose(rotate(Z, yaw), Vector(x, y, 0.0))
    heading = yaw + 0.5 * now.turned
    left = now.side > 0.0
    feet = [_either_pose(left, swing, stance), _either_pose(left, stance, swing)]

    def frame(at: Pair) -> Pose:
        return Pose(rotate(Z, heading), Vector(at[0], at[1], height))

    near = body.posture(frame(waist), feet, q)
    center = frame(waist) @ body.T_waist_base @ body.center(near)
    error = pair_difference(com, (center.x, center.y))
    moved = pair_within((error[0] / body.share, error[1] / body.share), (-0.01, -0.01), (0.01, 0.01))
    waist = pair_sum(waist, moved)
    return waist, body.posture(frame(waist), feet, near)


def _either_pose(condition: Scalar, a: Pose, b: Pose) -> Pose:
    x = either(condition, leaves(a), leaves(b))
    return Pose(Rotation(Vector(*x[0:3]), Vector(*x[3:6]), Vector(*x[6:9])), Vector(*x[9:12]))


def _place(three: Sequence[Scalar]) -> Place:
    return three[0], three[1], three[2]
