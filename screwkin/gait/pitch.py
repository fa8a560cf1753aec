"""Feet that leave over the front edge of their sole and land on its rear edge.

Before liftoff a foot turns about its front edge by ``toe``, and in the swing back again; in the swing it
turns about its rear edge by ``heel``, toes up, and after landing back again: quintics from rest to rest. With
the level foot L, turns a and b and the axis y of the foot its pose is L Rot(front, a) Rot(rear, -b). The
second turn leaves every point of the sole behind the front edge and none below the sole, so that the first
one raises it: no point is lower than the level foot, whatever the angles.

A foot that turns after landing and one that turns before liftoff are both on the floor. The one has half the
time in which the ZMP goes from foot to foot, the other the second half, besides what the gait leaves them
between landing and the end of a step, and between ``dsp`` and liftoff.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, Vector, Y, Z, as_array, rotate
from screwkin.errors import Fault, GaitError
from screwkin.gait.footsteps import Foothold
from screwkin.gait.motion import Motion, along, carried_point, level_pose, level_twist, together
from screwkin.gait.record import Gait
from screwkin.gait.splines import minimum_jerk
from screwkin.gait.stance import Foot, Stance
from screwkin.trajectory import Trajectory


def pitches(gait: Gait) -> bool:
    """Whether its feet are not always level."""
    return gait.heel != 0.0 or gait.toe != 0.0


def recorded_angles(trajectory: Trajectory) -> str:
    """The keys by whose angles the gait of a trajectory pitches feet, for messages; empty without any."""
    recorded = trajectory.meta.get("gait")
    table = recorded.get("gait") if isinstance(recorded, Mapping) else None
    keys = [key for key in ("toe", "heel") if isinstance(table, Mapping) and table.get(key, 0) != 0]
    return " and ".join(keys)


def refuse_level_legs(gait: Gait, feet: Sequence[str], free: dict[str, tuple[str, ...]]) -> None:
    """Refuse to pitch feet whose limbs have no joint for it.

    Args:
        gait: its angles ``heel`` and ``toe``.
        feet: tips of the feet.
        free: by tip, rotations that follow.

    Raises:
        GaitError: names keys and foot.
    """
    faults = [
        Fault("[gait]", key, f"{getattr(gait, key):g} rad, but no joint pitches {foot}", f"Set {key} = 0")
        for key in ("heel", "toe")
        for foot in feet
        if getattr(gait, key) and "ry" in free.get(foot, ())
    ]
    if faults:
        raise GaitError(gait.path or f"gait {gait.name}", faults)


def pitched(
    gait: Gait, stance: Stance, holds: tuple[Foothold, ...], phase: Motion, feet: dict[str, Motion]
) -> dict[str, Motion]:
    """Motion of the feet's frames: x, y, z, yaw, pitch (T, 5) by name; (T, 4) as they come if all are level.

    A foot turns in proportion to how far it stands behind the other one, or lands ahead of it, in the mean of
    their headings: in full from half the length of its sole. The last foot lands level.

    Args:
        gait: ``heel``, ``toe`` [rad], ``dsp``, and times of liftoff and landing.
        stance: soles.
        holds: from ``footholds``.
        phase: (T,) [steps].
        feet: level, x, y, z, yaw (T, 4) by name.
    """
    if not pitches(gait):
        return feet
    edges = {foot.name: _edges(foot) for foot in stance.feet}
    turns, moved = (
        _turns(gait, {name: front - rear for name, (rear, front) in edges.items()}, holds, phase),
        {},
    )
    for foot in stance.feet:
        (rear, front), (toe, heel) = edges[foot.name], turns[foot.name]
        pitch = _sum(toe, heel * -1.0)
        away = _sum(_swept(toe, front - rear), _swept(pitch, rear))
        level = feet[foot.name]
        at = carried_point(level, away)
        parts = (
            (getattr(at, f), getattr(level, f)[:, 3], getattr(pitch, f))
            for f in ("value", "rate", "acceleration")
        )
        moved[foot.name] = Motion(*(np.column_stack(part) for part in parts))
    return moved


def foot_pose(motion: Motion) -> Array:
    """World pose (T, 4, 4) of a foot, from x, y, z, yaw (T, 4), or with its pitch (T, 5)."""
    if motion.value.shape[1] == 4:
        return level_pose(motion)
    x, y, z, yaw, pitch = motion.value.T
    return np.asarray(as_array(Pose(rotate(Z, yaw) @ rotate(Y, pitch), Vector(x, y, z))))


def foot_twist(motion: Motion) -> Array:
    """Twist (T, 6) of a foot, [omega; v of its origin] in world axes."""
    twist = level_twist(motion.rate)
    if motion.value.shape[1] == 5:
        twist[:, :2] += motion.rate[:, 4:] * _across(motion)
    return twist


def foot_acceleration(motion: Motion) -> Array:
    """Time derivative (T, 6) of ``foot_twist``: its pitch axis turns with its yaw."""
    change = level_twist(motion.acceleration)
    if motion.value.shape[1] == 5:
        across, turning = _across(motion), motion.rate[:, 3:4] * motion.rate[:, 4:]
        change[:, :2] += motion.acceleration[:, 4:] * across
        change[:, :2] += turning * np.column_stack([-across[:, 1], across[:, 0]])
    return change


def _across(motion: Motion) -> Array:
    """The axis of pitch over the floor (T, 2)."""
    return np.column_stack([-np.sin(motion.value[:, 3]), np.cos(motion.value[:, 3])])


def _edges(foot: Foot) -> tuple[float, float]:
    """Where rear and front edge of a sole are along its frame's x axis [m]."""
    xs = [x for x, _ in foot.sole]
    return min(xs), max(xs)


def _turns(
    gait: Gait, lengths: Mapping[str, float], holds: tuple[Foothold, ...], phase: Motion
) -> dict[str, tuple[Motion, Motion]]:
    """Turns (T,) about front and rear edge by the foot's name [rad], both at least 0, for soles so long."""
    liftoff, landing = gait.channels["foot_height"].at[[0, -1]]
    half = 0.5 * gait.numbers["dsp"]
    leaves, lands = (half, liftoff, landing), (liftoff, landing, 1.0 + half)
    stand = {hold.foot: hold for hold in holds[:2]}
    turns = {foot: (_still(phase), _still(phase)) for foot in stand}
    for hold in holds[2:]:
        (other,) = (stood for foot, stood in stand.items() if foot != hold.foot)
        toe, heel = turns[hold.foot]
        behind, ahead = (
            np.clip(_ahead(a, b) / (0.5 * lengths[hold.foot]), 0.0, 1.0)
            for a, b in ((other, stand[hold.foot]), (hold, other))
        )
        _add(toe, gait.toe * behind, hold.step, leaves, phase)
        _add(heel, gait.heel * ahead * (hold is not holds[-1]), hold.step, lands, phase)
        stand[hold.foot] = hold
    return turns


def _add(turn: Motion, angle: float, step: int, at: tuple[float, float, float], phase: Motion) -> None:
    """Write into a turn (T,) that it goes from 0 to an angle and back, at three phases of a step."""
    first = int(np.searchsorted(phase.value, step + at[0], "right"))
    rows = slice(first, int(np.searchsorted(phase.value, step + at[2], "left")))
    own = Motion(phase.value[rows] - step, phase.rate[rows], phase.acceleration[rows])
    bump = along(minimum_jerk(np.array(at), np.array([0.0, angle, 0.0])), own)
    turn.value[rows], turn.rate[rows], turn.acceleration[rows] = bump.value, bump.rate, bump.acceleration


def _ahead(a: Foothold, b: Foothold) -> float:
    """How far a foothold lies ahead of another one, along the mean of their headings [m]."""
    yaw = 0.5 * (a.yaw + b.yaw)
    return float(np.cos(yaw) * (a.x - b.x) + np.sin(yaw) * (a.y - b.y))


def _swept(turn: Motion, arm: float) -> Motion:
    """Way (T, 3) of the end of an arm backwards along x, whose other end stays, as it turns about y."""

    def back(angle: Array, order: int) -> Array:
        return np.asarray((1.0 - np.cos(angle), np.sin(angle), np.cos(angle))[order])

    def up(angle: Array, order: int) -> Array:
        return np.asarray((np.sin(angle), np.cos(angle), -np.sin(angle))[order])

    return together(along(back, turn) * arm, _still(turn), along(up, turn) * arm)


def _still(like: Motion) -> Motion:
    return Motion(*np.zeros((3, len(like.value))))


def _sum(a: Motion, b: Motion) -> Motion:
    return Motion(a.value + b.value, a.rate + b.rate, a.acceleration + b.acceleration)
