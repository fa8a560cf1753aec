"""Measures of a walk: its key points, its balance, and the simulator's verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.account import Account
from screwkin.analysis.contact_account import forces_of
from screwkin.errors import InputError, one_of
from screwkin.papers.bench import Bench
from screwkin.papers.scatter import Scatter
from screwkin.report.frames import cycle_times

Changes = Mapping[str, str | float] | None

AXES = ("x", "y", "z")


def key_points(
    bench: Bench,
    gait: str,
    body: str,
    along: str,
    step: int,
    at: Sequence[float],
    seen_from: str = "step",
    steps: int = 6,
    changes: Changes = None,
) -> Array:
    """Coordinates (k,) [m] of a body at fractions of a step.

    Args:
        bench: of the paper.
        gait: its name.
        body: ``base`` or a tip.
        along: x, y or z.
        step: which one, from 0; take one beyond the start.
        at: fractions of the step's duration, which the gait's rate must sample.
        seen_from: ``step``: from where the body is when the step begins; ``lowest``: from the least of the
            coordinates; ``floor``: in the world; ``base``; or a joint: from its axis point on a base that
            does not turn.
        steps: of the walk.
        changes: of the gait's parameters.
    """
    account = bench.account(gait, steps, changes)
    k = AXES.index(along)
    rows = _rows(account, step, at)
    value = _path(account, body)[:, k]
    if seen_from == "step":
        return np.asarray(value[rows] - value[_rows(account, step, [0.0])])
    if seen_from == "lowest":
        return np.asarray(value[rows] - value[rows].min())
    if seen_from == "floor":
        return np.asarray(value[rows])
    base = _path(account, "base")[:, k]
    offset = 0.0 if seen_from == "base" else list(account.robot.joint(seen_from).screw.s0)[k]
    return np.asarray((value - base)[rows] - float(offset))


def feet_apart(bench: Bench, gait: str, step: int, steps: int = 6, changes: Changes = None) -> float:
    """Distance [m] of the feet along x when a step begins."""
    account = bench.account(gait, steps, changes)
    (row,) = _rows(account, step, [0.0])
    return float(np.ptp([_path(account, foot)[row, 0] for foot in account.trajectory.feet]))


def cycle_ends(bench: Bench, gait: str, steps: int | None = None) -> int:
    """Number of instants at which gait cycles of two steps begin or end."""
    return len(cycle_times(bench.account(gait, steps)))


def swing_height(bench: Bench, gait: str, foot: str, steps: int | None = None) -> float:
    """How high a foot is lifted [m]."""
    return float(_path(bench.account(gait, steps), foot)[:, 2].max())


def largest_effort(bench: Bench, gait: str, steps: int | None = None) -> float:
    """Largest torque [N m] of a joint along the planned walk, the load shared out among soles' corners."""
    forces = forces_of(bench.account(gait, steps), None)
    return float(np.abs(forces.forces.efforts).max())


def balance_number(
    bench: Bench, key: str, gait: str, steps: int | None = None, changes: Changes = None
) -> float:
    """A number of a walk's balance: see ``BALANCE``; lengths in m."""
    value = one_of("fact of a balance", key, BALANCE)(bench.account(gait, steps, changes))
    return value if isinstance(value, int) else float(value)


def spike_phases(bench: Bench, gait: str, steps: int | None = None, changes: Changes = None) -> str:
    """When spikes of |GCoM - ZMP| stand, in fractions of a step's duration, start and stop left out."""
    account = bench.account(gait, steps, changes)
    ends = np.array(account.boundaries)
    inner = [spike.time for spike in account.balance.spikes if ends[1] <= spike.time < ends[-2]]
    if not inner:
        return "none"
    begin = np.searchsorted(ends, inner, side="right") - 1
    phases = (np.array(inner) - ends[begin]) / (ends[begin + 1] - ends[begin])
    counts = {round(float(phase), 2): 0 for phase in sorted(phases)}
    for phase in phases:
        counts[round(float(phase), 2)] += 1
    return ", ".join(f"{phase:.2f} ({count} times)" for phase, count in counts.items())


def simulated(
    bench: Bench,
    key: str,
    gait: str,
    steps: int | None = None,
    changes: Changes = None,
    sole_stiffness: float | None = None,
) -> Scatter:
    """What the simulator says of runs of a walk; lengths as in the verdict, truth as yes or no.

    Soles are rigid unless ``sole_stiffness`` [N/m] of every point of contact is given.
    """
    account = bench.account(gait, steps, changes)
    verdicts = bench.verdicts(account, sole_stiffness)
    return Scatter(tuple(_single(verdict, key) for verdict in verdicts))


def _single(verdict: Mapping[str, Any], key: str) -> float | str:
    """One value of a verdict."""
    if key == "fell_at" and verdict[key] is None:
        return "does not fall"
    if key not in verdict or isinstance(verdict[key], dict | list | None):
        raise InputError(f"a verdict has no single value {key}; it has {', '.join(verdict)}")
    value: float | str = verdict[key]
    return ("yes" if value else "no") if isinstance(value, bool) else value


def _rows(account: Account, step: int, at: Sequence[float]) -> list[int]:
    """Samples at fractions of a step."""
    begin, end = account.boundaries[step : step + 2]
    wanted = begin + np.asarray(at, dtype=float) * (end - begin)
    rows = [int(np.abs(account.trajectory.time - time).argmin()) for time in wanted]
    apart = np.abs(account.trajectory.time[rows] - wanted).max()
    if apart > 1e-6:
        raise InputError(f"no sample at {list(at)} of step {step}, {apart:.4f} s off; take another rate")
    return rows


def _path(account: Account, body: str) -> Array:
    """Places (T, 3) of a body in the world."""
    trajectory = account.trajectory
    T = one_of("body", body, {"base": trajectory.T_world_base, **trajectory.T_world_tip})
    return np.asarray(T[:, :3, 3])


def _apart(a: Array, b: Array, k: int) -> float:
    return float(np.abs(a[:, k] - b[:, k]).max())


BALANCE = {
    "min_margin": lambda one: one.balance.margin.min(),
    "outside": lambda one: one.outside.mean(),
    "gcom_zmp": lambda one: one.balance.distance.max(),
    "gcom_zmp_x": lambda one: _apart(one.balance.zmp, one.balance.com, 0),
    "gcom_zmp_y": lambda one: _apart(one.balance.zmp, one.balance.com, 1),
    "median_gcom_zmp": lambda one: np.median(one.balance.distance),
    "com_waist_x": lambda one: _apart(one.balance.com, _path(one, "base"), 0),
    "com_waist_y": lambda one: _apart(one.balance.com, _path(one, "base"), 1),
    "cart_table": lambda one: np.linalg.norm(one.balance.cart_table - one.balance.zmp, axis=1).max(),
    "spikes": lambda one: len(one.balance.spikes),
    "closure": lambda one: one.max_closure,
    "singular": lambda one: one.singular_samples,
    "least_sigma": lambda one: min(limb.sigma for limb in one.limbs),
    "samples": lambda one: one.trajectory.samples,
    "com_height": lambda one: one.balance.com[:, 2].mean(),
    "waist_height": lambda one: _path(one, "base")[:, 2].mean(),
    "speed_use": lambda one: max(share.speed for share in one.servos.values()),
    "advance": lambda one: _path(one, "base")[-1, 0] - _path(one, "base")[0, 0],
}
"""Numbers of a walk by name."""
