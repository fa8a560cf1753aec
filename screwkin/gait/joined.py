"""Motions joined, one after the other, where one ends as the next one begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, expect
from screwkin.gait.ground import ground_of
from screwkin.trajectory import Trajectory

SAME = 1e-6
"""How closely positions must meet [rad and m]."""
_ALONG = ("q", "qd", "qdd", "contact", "margin")
SLOW = 1e-4
"""How closely rates and accelerations must meet [per s, per s^2]."""


def join(*trajectories: Trajectory) -> Trajectory:
    """One trajectory of several, without a jump in position, rate or acceleration.

    Each is moved over the floor and turned so that it begins where the one before ends. Walks over footsteps
    and to goals begin and end at home, so that they can be joined in any order.

    Args:
        trajectories: two at least, of one robot, at one rate, on a level floor.

    Returns:
        Trajectory; ``meta["joined"]`` holds the gaits.

    Raises:
        InputError: they do not fit together; says which and how far they are apart.

    Example:
        >>> import screwkin as sk
        >>> robot, gait = sk.load_robot(sk.robot_names()[0]), sk.load_gait("preview")
        >>> step = sk.walk(robot, gait, sk.footsteps([(0.03, -0.042, 0.0)]))
        >>> two = sk.join(step, step)
        >>> round(float(two.T_world_base[-1, 0, 3]), 3)
        0.06
    """
    if len(trajectories) < 2:
        raise InputError("join takes two trajectories at least")
    for trajectory in trajectories:
        expect(trajectory, Trajectory, "trajectory", "walk(robot, gait)")
    whole = trajectories[0]
    for number, trajectory in enumerate(trajectories[1:], 2):
        _check_kinds(trajectories[0], trajectory, number)
        whole = _joined(whole, trajectory, number)
    return whole


def _check_kinds(first: Trajectory, other: Trajectory, number: int) -> None:
    """Refuse motions of another robot, rate, floor or of commands."""

    def robot(trajectory: Trajectory) -> Any:
        recorded = trajectory.meta.get("robot")
        return recorded.get("sha256") if isinstance(recorded, Mapping) else None

    gaps = [float(np.median(np.diff(t.time))) for t in (first, other)]
    for wrong, what in (
        (robot(first) != robot(other) or first.joint_names != other.joint_names, "is of another robot"),
        (first.feet != other.feet, "stands on other feet"),
        (abs(gaps[0] - gaps[1]) > 1e-9, f"has samples every {gaps[1]:g} s, not {gaps[0]:g} s"),
        (first.meta.get("at_rest") != other.meta.get("at_rest"), "has other arms at rest"),
        (any("compensation" in t.meta for t in (first, other)), "or the first holds commands, not a motion"),
        (not all(ground_of(t).flat for t in (first, other)), "or the first is no walk on a level floor"),
    ):
        if wrong:
            raise InputError(f"trajectory {number} {what}; it cannot be joined")


def _joined(a: Trajectory, b: Trajectory, number: int) -> Trajectory:
    T = a.T_world_base[-1] @ np.linalg.inv(b.T_world_base[0])
    upright = np.abs([T[2, 0], T[2, 1], T[2, 3]]).max()
    ends = {name: getattr(a, name)[-1] for name in ("q", "qd", "qdd")}
    apart = {name: np.abs(value - getattr(b, name)[0]) for name, value in ends.items()}
    for name, limit, unit in (("q", SAME, "rad"), ("qd", SLOW, "rad/s"), ("qdd", SLOW, "rad/s^2")):
        k = int(apart[name].argmax())
        if not apart[name][k] <= limit:
            raise InputError(
                f"trajectory {number} does not begin as the one before ends: {name} of {a.joint_names[k]}"
                f" jumps by {apart[name][k]:.3g} {unit}; let walks begin and end at home (lead = 1)"
            )
    if not upright <= SAME:
        raise InputError(f"trajectory {number} begins at another height or tilt than the one before ends")
    if not (a.contact[-1] == b.contact[0]).all():
        raise InputError(f"trajectory {number} begins on other feet than the one before ends on")
    moved, R = b.time - b.time[0] + a.time[-1], T[:3, :3]

    def turned(twist: Array) -> Array:
        return np.asarray((twist.reshape(-1, 2, 3) @ R.T).reshape(twist.shape))

    def both(first: Array, second: Array) -> Array:
        return np.concatenate([first, second[1:]])

    return Trajectory(
        time=both(a.time, moved),
        joint_names=a.joint_names,
        **{
            name: both(getattr(a, name), getattr(b, name)) for name in ("q", "qd", "qdd", "contact", "margin")
        },
        T_world_base=both(a.T_world_base, T @ b.T_world_base),
        base_twist=both(a.base_twist, turned(b.base_twist)),
        base_acceleration=both(a.base_acceleration, turned(b.base_acceleration)),
        T_world_tip={tip: both(pose, T @ b.T_world_tip[tip]) for tip, pose in a.T_world_tip.items()},
        feet=a.feet,
        com=both(a.com, b.com @ R.T + T[:3, 3]),
        zmp=both(a.zmp, b.zmp @ R[:2, :2].T + T[:2, 3]),
        meta=_meta(a, b, float(moved[0] - b.time[0])),
    )


def _meta(a: Trajectory, b: Trajectory, later: float) -> dict[str, Any]:
    """What is recorded of both."""
    first, second = a.meta, b.meta
    meta = {key: first[key] for key in ("robot", "versions", "at_rest") if key in first}
    sigma = [x if isinstance(x := m.get("sigma"), Mapping) else {} for m in (first, second)]
    return {
        **meta,
        "joined": [*_gaits(first), *_gaits(second)],
        "steps": int(first.get("steps", 0)) + int(second.get("steps", 0)),
        "boundaries": [*first.get("boundaries", []), *(t + later for t in second.get("boundaries", []))],
        "closure": max(float(m.get("closure", 0.0)) for m in (first, second)),
        "sigma": {key: min(float(s[key]) for s in sigma if key in s) for key in {**sigma[0], **sigma[1]}},
        "notes": [*dict.fromkeys([*first.get("notes", []), *second.get("notes", [])])],
        "command": "; ".join(filter(None, (str(m.get("command", "")) for m in (first, second)))),
    }


def _gaits(meta: Mapping[str, Any]) -> Sequence[Any]:
    joined = meta.get("joined")
    return joined if isinstance(joined, list) else [meta.get("gait")]
