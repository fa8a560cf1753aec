"""Measures of a leg: inverse kinematics, workspace, stiffness, preview control and compensation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, unstack
from screwkin.analysis.ik_study import IkRow, IkStudy, ik_study
from screwkin.analysis.stiffness_maps import DeflectionMap, stiffness_maps
from screwkin.analysis.workspace import WorkspaceMap, workspace
from screwkin.compliance.stiffness import Method as Law
from screwkin.errors import InputError, one_of
from screwkin.gait.compensation import METHODS, compensate_walk, convergence
from screwkin.gait.footsteps import footholds
from screwkin.gait.preview import follow_reference, preview_gains
from screwkin.gait.preview_plan import zmp_reference
from screwkin.gait.stance import stance_of
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.papers.bench import Bench
from screwkin.trajectory import Trajectory

Limits = Mapping[str, Sequence[float]]
"""Other ranges [rad] of joints, by name."""
POSES = 2000
"""Random poses of the comparison of inverse kinematics."""
FINE, COARSE = 0.0025, 0.005
"""Grids of maps of the reach and of the deflection [m]."""


def study_of(bench: Bench, limb: str) -> IkStudy:
    """The comparison of inverse kinematics methods, computed once."""
    return bench.once(("ik", limb), lambda: ik_study(bench.robot, limb, POSES))


def ik_number(bench: Bench, limb: str, method: str, key: str, data: str = "gait") -> float:
    """A number of an inverse kinematics method: iterations, share solved or in limits, or seconds."""
    return _number(_row(study_of(bench, limb), method, data), key)


def ik_ratio(bench: Bench, limb: str, methods: Sequence[str], key: str) -> float:
    """How many times more the first method needs than the second, over the walk."""
    first, second = (ik_number(bench, limb, method, key) for method in methods)
    return first / second


def _row(study: IkStudy, method: str, data: str) -> IkRow:
    rows = {row.method: row for row in study.rows if row.data == data}
    return one_of("inverse kinematics method", method, rows)


def _number(row: IkRow, key: str) -> float:
    if key == "seconds":
        return 1e-6 * row.microseconds
    value = getattr(row, key, None)
    if not isinstance(value, int | float):
        raise InputError(f"a row of inverse kinematics has no number {key}")
    return value


def map_of(
    bench: Bench, limb: str, height: float, grid: float = FINE, limits: Limits | None = None
) -> WorkspaceMap:
    """The workspace of a limb at a height of the waist above its tip, computed once."""
    changed = {joint: (float(lower), float(upper)) for joint, (lower, upper) in (limits or {}).items()}
    robot = bench.robot.replace(limits=changed) if changed else bench.robot
    key = ("workspace", limb, height, grid, *sorted(changed.items()))
    return bench.once(key, lambda: workspace(robot, limb, [height], grid)[0])


def reach(bench: Bench, limb: str, height: float, key: str = "area", limits: Limits | None = None) -> float:
    """Area [m^2] that a limb reaches with its tip level, or the median condition number there."""
    place = map_of(bench, limb, height, limits=limits)
    return float(getattr(place, one_of("number of a workspace", key, ("area", "median_condition"))))


def cut_at(bench: Bench, limb: str, height: float, at: Sequence[float], limits: Limits | None = None) -> str:
    """What decides at a place [m] of the waist frame: reachable, out of reach, or the limit of a joint."""
    place = map_of(bench, limb, height, limits=limits)
    i, j = (int(np.abs(axis - value).argmin()) for axis, value in zip((place.x, place.y), at, strict=True))
    return place.causes[int(place.cause[i, j])].replace("_", " ")


def sinking_of(bench: Bench, limb: str, height: float, stiffness: float = 1.0) -> DeflectionMap:
    """Deflection of a tip all over its workspace, computed once."""
    place = map_of(bench, limb, height, COARSE)
    key = ("stiffness", limb, height, stiffness)
    return bench.once(key, lambda: stiffness_maps(bench.robot, [place], stiffness)[0])


def deflection(bench: Bench, limb: str, height: float, key: str, stiffness: float = 1.0) -> float | Array:
    """Deflection [m] of the swinging tip over its workspace, the other foot standing.

    ``key``: median or max of its length; x, y or z for the range (2,) of a component; least_at for the place
    (2,) with the smallest one.
    """
    sunk = sinking_of(bench, limb, height, stiffness)
    if key in ("median", "max"):
        return float(getattr(np, f"nan{key}")(sunk.magnitude))
    if key == "least_at":
        i, j = np.unravel_index(np.nanargmin(sunk.magnitude), sunk.magnitude.shape)
        return np.array([sunk.place.x[i], sunk.place.y[j]])
    one_of("number of a deflection map", key, ("median", "max", "x", "y", "z", "least_at"))
    part = sunk.translation[..., "xyz".index(key)]
    return np.array([np.nanmin(part), np.nanmax(part)])


def gains(bench: Bench, key: str, settings: Mapping[str, float]) -> float | Array:
    """Preview gains Ks or Kx (3,) for ``period``, ``com_height``, ``horizon``, and weights Qe, Qx, R."""
    value: float | Array = getattr(preview_gains(**settings), one_of("preview gain", key, ("Ks", "Kx")))
    return value


def preview_tracking(
    bench: Bench, gait: str, who: str, com_height: float | None = None, steps: int | None = None
) -> Array:
    """Largest |x| and |y| (2,) [m] between the wanted ZMP and that of the ``cart``, or of all ``links``.

    ``com_height`` [m] of the cart; default: the robot's.
    """
    wanted, cart, whole = zmp_lines(bench, gait, steps, com_height)
    line = one_of("ZMP", who, {"cart": cart, "links": whole})
    return np.asarray(np.abs(line - wanted).max(axis=0))


def zmp_lines(
    bench: Bench, gait: str, steps: int | None = None, com_height: float | None = None
) -> tuple[Array, Array, Array]:
    """ZMP (T, 2) [m] of a preview gait: wanted, of the cart that follows it, and of all links."""
    account = bench.account(gait, steps)
    plan, stance = bench.gait(gait), stance_of(account.robot)
    count = plan.steps if steps is None else steps
    time = account.trajectory.time
    wanted = zmp_reference(plan, stance, footholds(plan, stance, count), count, time)
    height = float(account.balance.com[0, 2]) if com_height is None else com_height
    weights = {name: plan.numbers[name] for name in ("Qe", "Qx", "R")}
    cart = follow_reference(preview_gains(1 / plan.rate, height, plan.numbers["horizon"], **weights), wanted)
    return wanted, cart.zmp, account.balance.zmp


def compensated_of(bench: Bench, gait: str, stiffness: float) -> Trajectory:
    """The walk with commands whose swing foot is compensated."""
    account = bench.account(gait)
    key = ("compensated", account.trajectory.sha256, stiffness)
    return bench.once(key, lambda: compensate_walk(account.robot, account.trajectory, stiffness, "swing"))


def compensation(
    bench: Bench,
    gait: str,
    key: str,
    method: str = "swing",
    model: Law = "nonlinear",
    stiffness: float = 60.0,
    passes: int = 1,
) -> float:
    """Swing-foot error [m] against the nonlinear equilibrium before and after, or the share removed.

    ``key`` is such as ``before x``, ``after z``, ``removed y``, or ``after norm``.
    """
    account, chosen = bench.account(gait), one_of("compensation", method, METHODS)
    rows = bench.once(
        ("remaining", account.trajectory.sha256, method, model, stiffness, passes),
        lambda: convergence(account.robot, account.trajectory, stiffness, passes, chosen, model),
    )
    what, _, part = key.partition(" ")
    if what not in ("before", "after", "removed") or part not in ("x", "y", "z", "norm"):
        raise InputError(
            f"compensation has no number {key!r}; write before, after or removed, and x, y, z or norm"
        )
    before, after = (
        1e-3 * (row.norm_mm if part == "norm" else row.largest_mm["xyz".index(part)])
        for row in (rows[0], rows[-1])
    )
    return {"before": before, "after": after, "removed": 1.0 - after / before}[what]


def foot_from_waist(bench: Bench, gait: str, limb: str, stiffness: float) -> tuple[Array, Array]:
    """Places (T, 3) [m] of a limb's tip in the waist's frame: planned, and commanded to compensate."""
    robot, walk = bench.robot, bench.account(gait).trajectory
    tip = robot.limb(limb).tip
    planned, commanded = (
        as_array(pose_in_base(robot, link_displacements(robot, unstack(q)), tip), (len(q),))[:, :3, 3]
        for q in (walk.q, compensated_of(bench, gait, stiffness).q)
    )
    return planned, commanded


def command_changes(bench: Bench, gait: str, limb: str, stiffness: float) -> Array:
    """Largest change (k,) [rad] of the commands of a limb's joints by the swing foot's compensation."""
    robot, walk = bench.robot, bench.account(gait).trajectory
    changed = np.abs(compensated_of(bench, gait, stiffness).q - walk.q).max(axis=0)
    return np.asarray(changed[list(robot.path_to(robot.limb(limb).link))])


def most_changed(bench: Bench, gait: str, limb: str, count: int, stiffness: float) -> str:
    """The joints of a limb whose commands compensation changes most, from the waist to the tip."""
    path = bench.robot.path_to(bench.robot.limb(limb).link)
    largest = np.argsort(command_changes(bench, gait, limb, stiffness))[-count:]
    return ", ".join(bench.robot.joint_names[path[i]].replace("_", " ") for i in sorted(largest))


def swing_corrections(bench: Bench, gait: str, limb: str, key: str, stiffness: float) -> float | str:
    """How far compensation moves a foot [m]: in its ``first`` swing, median of the ``others``, ``standing``.

    ``order``: whether the first is lower than any other; ``stride``: length of the first swing over the
    median of the others.
    """
    trajectory = bench.account(gait).trajectory
    foot = bench.robot.limb(limb).tip
    planned, commanded = foot_from_waist(bench, gait, limb, stiffness)
    moved = np.linalg.norm(commanded - planned, axis=1)
    stands = trajectory.contact[:, trajectory.feet.index(foot)]
    flying = np.flatnonzero(~stands)
    swings = np.split(flying, np.flatnonzero(np.diff(flying) > 1) + 1)
    x = trajectory.T_world_tip[foot][:, 0, 3]
    lengths = [abs(x[min(rows[-1] + 1, len(x) - 1)] - x[rows[0] - 1]) for rows in swings]
    first, *others = (float(moved[rows].max()) for rows in swings)
    return one_of(
        "correction of a foot",
        key,
        {
            "first": first,
            "others": float(np.median(others)),
            "standing": float(moved[stands].max()),
            "order": "lower" if first < min(others) else "not lower",
            "stride": float(lengths[0] / np.median(lengths[1:])),
        },
    )
