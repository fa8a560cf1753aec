"""The plan of a walk: what the virtual chains impose, sample by sample, in task space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.dynamics.terrain import Terrain
from screwkin.errors import Fault, GaitError, InputError
from screwkin.gait.footsteps import Foothold, feet_motion, footholds
from screwkin.gait.ground import check_edges, planned_terrain
from screwkin.gait.hands import hands_motion
from screwkin.gait.motion import Motion, carried_frame
from screwkin.gait.path import path_of
from screwkin.gait.pitch import foot_acceleration, foot_pose, foot_twist, pitched
from screwkin.gait.record import Gait
from screwkin.gait.soles import check_soles
from screwkin.gait.stance import Stance
from screwkin.gait.timing import Timing
from screwkin.gait.waist import waist_path

MOST_SAMPLES = 1_000_000  # a longer plan would fill the memory of a small computer
LEAST_SHOWN = 2  # samples of a swing below which a trajectory does not show that the foot leaves the floor


@dataclass(frozen=True, eq=False)
class Plan:
    """Targets over T samples, in the floor's frame; arrays are read-only.

    time (T,) [s]; phase (T,) [steps]; T_world_base (T, 4, 4); base_twist (T, 6), [omega; v of the base
    origin], and base_acceleration (T, 6), its time derivative; the same for every foot by the name of its
    tip, at the tip's own origin: T_world_tip, tip_twist, tip_acceleration; hand_position, hand_velocity,
    hand_acceleration (T, 3) for every hand; contact (T, feet) bool for ``feet``; footholds: two of the
    start, then one per step; terrain: what is supposed to be under them; boundaries (steps + 1,)
    [s]: when each step begins, and the last ends; sole_gap: smallest distance between the soles seen along
    the floor's normal [m]; notes: what the reader should know.
    """

    gait: Gait
    steps: int
    time: Array
    phase: Array
    T_world_base: Array
    base_twist: Array
    base_acceleration: Array
    T_world_tip: Mapping[str, Array]
    tip_twist: Mapping[str, Array]
    tip_acceleration: Mapping[str, Array]
    hand_position: Mapping[str, Array]
    hand_velocity: Mapping[str, Array]
    hand_acceleration: Mapping[str, Array]
    contact: NDArray[np.bool_]
    feet: tuple[str, ...]
    footholds: tuple[Foothold, ...]
    terrain: Terrain
    boundaries: Array
    sole_gap: float
    notes: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])


def plan(gait: Gait, stance: Stance, steps: int) -> Plan:
    """The plan of a geometric gait.

    Args:
        gait: a gait of kind ``geometric``.
        stance: feet, soles and shoulders of the robot.
        steps: number of steps, at least 1.

    Returns:
        Samples from rest (if ``ramp`` > 0) to rest, evenly spaced by nearly 1/rate: their number is rounded
        such that the last one falls on the end.

    Raises:
        InputError: ``steps`` is no whole number above 0.
        GaitError: another kind of gait, a swing below the floor, too many or too few samples, or numbers too
            large.
        NoSolutionError: the feet overlap.

    Source: walking paper (docs/papers.md, A), eq. 16-24, generalised to arcs and to stepping sideways.
    """
    steps = whole_steps(steps)
    if gait.kind != "geometric":
        found = f"a gait of kind {gait.kind!r} does not consist of key points alone"
        raise GaitError(_where(gait), [Fault("[gait]", "kind", found, 'Give one of kind "geometric"')])
    check_fitted(gait)
    check_rate(gait)
    timing = Timing(gait.Tc, steps, gait.ramp)
    time = sample_times(gait, timing)
    with np.errstate(all="ignore"):  # absurd sizes are refused below, in words
        phase = timing.phase(time)
        progress, side = waist_path(gait, steps).motions(phase)
        waist = path_of(gait).follow(progress, side, gait.waist_height)
    boundaries = timing.time_of(np.arange(steps + 1.0))
    return plan_around(gait, stance, steps, time, phase, waist, boundaries, _notes(gait, timing))


def plan_around(
    gait: Gait,
    stance: Stance,
    steps: int,
    time: Array,
    phase: Motion,
    waist: Motion,
    boundaries: Array,
    notes: tuple[str, ...] = (),
    home: Motion | None = None,
) -> Plan:
    """The plan whose waist moves as given, x, y, z, yaw (T, 4), with feet and hands by the gait's phase (T,).

    Args:
        gait: swings, hands and path.
        stance: feet, soles and shoulders of the robot.
        steps: number of steps, at least 1.
        time: (T,) [s].
        phase: (T,) [steps].
        waist: x, y, z, yaw (T, 4) of the waist in the world [m and rad].
        boundaries: (steps + 1,) [s].
        notes: what the reader of the plan should know.
        home: how much (T,) the hands are where they are at home.

    Raises:
        GaitError: a swing below the floor, or numbers too large. NoSolutionError: the feet overlap, or run
            into the block of a foothold.
    """
    with np.errstate(all="ignore"):
        holds = footholds(gait, stance, steps)
        feet, contact = feet_motion(gait, stance, holds, phase)
        feet = pitched(gait, stance, holds, phase, feet)
        hands = hands_motion(gait, stance, waist, phase, home)
    _check_finite(gait, {"waist": waist, **feet, **hands})
    with np.errstate(all="ignore"):
        gap = check_soles(gait, stance, feet, time)
        terrain = planned_terrain(gait, stance, holds)
        check_edges(gait, stance, feet, time, terrain)
        base = carried_frame(waist, stance.T_waist_base)
    return Plan(
        gait=gait,
        steps=steps,
        time=read_only(time),
        phase=read_only(phase.value),
        T_world_base=read_only(base[0]),
        base_twist=read_only(base[1]),
        base_acceleration=read_only(base[2]),
        T_world_tip=_each(feet, foot_pose),
        tip_twist=_each(feet, foot_twist),
        tip_acceleration=_each(feet, foot_acceleration),
        hand_position=_each(hands, lambda hand: hand.value),
        hand_velocity=_each(hands, lambda hand: hand.rate),
        hand_acceleration=_each(hands, lambda hand: hand.acceleration),
        contact=read_only(contact),
        feet=tuple(foot.name for foot in stance.feet),
        footholds=holds,
        terrain=terrain,
        boundaries=read_only(boundaries),
        sole_gap=gap,
        notes=notes if terrain.flat else (*notes, f"this walk supposes that {terrain}"),
    )


def sample_times(gait: Gait, timing: Timing) -> Array:
    """Sample times of a walk (T,) [s].

    Args:
        gait: its rate.
        timing: its duration.

    Raises:
        GaitError: fewer than two samples, or more than ``MOST_SAMPLES``.
    """
    count = timing.duration * gait.rate + 1
    if not 1.5 <= count <= MOST_SAMPLES:
        found = f"{gait.rate:g} per second over {timing.duration:g} s make {count:.6g} samples"
        raise GaitError(
            _where(gait), [Fault("[gait]", "rate", found, f"Keep them between 2 and {MOST_SAMPLES:,}")]
        )
    return timing.samples(gait.rate)


def check_fitted(gait: Gait) -> None:
    """Refuse a gait in lengths of a robot that is not known.

    Raises:
        GaitError: names the keys.
    """
    if gait.unfitted:
        found = f"{', '.join(gait.unfitted)} depend on the robot, and it was fitted to none"
        raise GaitError(_where(gait), [Fault("[gait]", "", found, "Use walk(robot, gait)")])


def check_rate(gait: Gait) -> None:
    """Refuse a rate that does not show the swings.

    Args:
        gait: its rate, ``Tc``, and the times of liftoff and landing.

    Raises:
        GaitError: fewer than ``LEAST_SHOWN`` samples while a foot is in the air.
    """
    liftoff, landing = gait.channels["foot_height"].at[[0, -1]]
    swing = float(landing - liftoff) * gait.Tc
    if swing * gait.rate < LEAST_SHOWN:
        found = f"{gait.rate:g} per second is {swing * gait.rate:.2g} samples in a swing of {swing:.3g} s"
        rate, Tc = LEAST_SHOWN / swing, LEAST_SHOWN * gait.Tc / (swing * gait.rate)
        upwards = f"raise rate to {np.ceil(rate):g} or more, or Tc to {np.ceil(1e4 * Tc) / 1e4:g} s or more"
        fix = f"This rate cannot show the swing: {upwards}"
        raise GaitError(_where(gait), [Fault("[gait]", "rate", found, fix)])


def whole_steps(steps: object) -> int:
    """The number of steps, if it is a whole number above 0."""
    if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or steps < 1:
        raise InputError(f"steps is {steps!r}; expected a whole number, at least 1")
    return int(steps)


def _where(gait: Gait) -> str:
    return gait.path or f"gait {gait.name}"


def _check_finite(gait: Gait, motions: Mapping[str, Motion]) -> None:
    for name, motion in motions.items():
        if not all(np.isfinite(x).all() for x in (motion.value, motion.rate, motion.acceleration)):
            found = f"the motion of {name} is beyond all numbers"
            fix = "Give stride, side, turn and Tc of sensible size"
            raise GaitError(_where(gait), [Fault("[gait]", "", found, fix)])


def _notes(gait: Gait, timing: Timing) -> tuple[str, ...]:
    notes = []
    if timing.ramp_steps < gait.ramp:
        few = "1 step is" if timing.steps == 1 else f"{timing.steps} steps are"
        notes.append(
            f"start and stop take {timing.ramp_steps:g} instead of {gait.ramp:g} steps each: {few} too few"
        )
    if gait.ramp == 0:
        notes.append("ramp = 0: the walk starts and stops at full speed")
    return tuple(notes)


def read_only(array: Any) -> Any:
    """A copy of an array that cannot be written to."""
    array = np.array(array)
    array.flags.writeable = False
    return array


def _each(motions: Mapping[str, Motion], part: Any) -> Mapping[str, Array]:
    return MappingProxyType({name: read_only(part(motion)) for name, motion in motions.items()})
