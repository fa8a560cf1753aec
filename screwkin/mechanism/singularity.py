"""Which limb is near a singularity, how near, and why: read from the geometry of its dependent screws.

A rank test on N sees nothing (its virtual columns keep it regular) and a determinant mixes units; the
length-normalised smallest singular value of each limb's secondary block tells, and its null vector names the
joints that work against each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import SingularError
from screwkin.kinematics.status import Status
from screwkin.mechanism.choice import characteristic_length, normalised
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.rates import SecondarySolution, block_name, block_rows

NEAR = 0.02
"""Smallest normalised singular value below which a limb is reported as near a singularity."""

TOLERANCE = 0.05
"""How nearly parallel, concurrent or in one plane axes are that cause a singularity, length-normalised."""


@dataclass(frozen=True)
class LimbSingularity:
    """The worst sample of a limb (or loop): its smallest singular value, and the cause when it is small."""

    limb: str
    sample: int
    sigma: float
    near: bool
    joints: tuple[str, ...]
    cause: str


def singularity_report(mechanism: Mechanism, N: Array) -> tuple[LimbSingularity, ...]:
    """For every limb or loop its least regular sample.

    Args:
        mechanism: the closed mechanism.
        N: network matrix (..., 6 circuits, couplings), formed at the waist origin.
    """
    scaled = normalised(N, characteristic_length(mechanism.robot)).reshape(-1, *N.shape[-2:])
    columns = mechanism.secondary_columns
    report = []
    for circuits, inside in mechanism.blocks:
        chosen = [columns[i] for i in inside]
        A = scaled[:, block_rows(circuits)][:, :, chosen]
        sigma = np.linalg.svd(A, compute_uv=False)[:, -1]
        worst = int(sigma.argmin())
        null = np.linalg.svd(A[worst])[2][-1]
        taking = [k for k in range(len(chosen)) if abs(null[k]) > 0.05 * np.abs(null).max()]
        names = [mechanism.couplings[c] for c in chosen]
        near = bool(sigma[worst] < NEAR)
        cause = _cause(names, _screws(scaled[worst], mechanism, chosen), taking) if near else ""
        taken = tuple(names[k] for k in taking)
        report.append(
            LimbSingularity(block_name(mechanism, circuits), worst, float(sigma[worst]), near, taken, cause)
        )
    return tuple(report)


def refuse_singular(
    mechanism: Mechanism, N: Array, solution: SecondarySolution, time: Array | None = None
) -> None:
    """Raise for the first singular sample of a solution with the network matrix N (..., rows, couplings).

    Raises:
        SingularError: names limb, sample, its time [s] where times (T,) are given, and the cause.
    """
    if not solution.singular.any():
        return
    flat = np.reshape(solution.singular, (-1, solution.singular.shape[-1]))
    sample, block = (int(i) for i in np.argwhere(flat)[0])
    here = np.reshape(np.asarray(N), (-1, *N.shape[-2:]))[sample]
    limb, cause = solution.blocks[block], singularity_report(mechanism, here)[block].cause
    when = "" if time is None else f" (t = {time[sample]:.3f} s)"
    message = f"{limb}, sample {sample}{when}: singular; {cause}; {Status.SINGULAR.help}"
    raise SingularError(message, limb, sample)


def _screws(N: Array, mechanism: Mechanism, columns: Sequence[int]) -> Array:
    """Screws (k, 6) of some couplings, from the first circuit that holds each."""
    rows = [int(np.flatnonzero(mechanism.circuit_matrix[:, c])[0]) for c in columns]
    return np.array([N[6 * r : 6 * r + 6, c] for r, c in zip(rows, columns, strict=True)])


def _cause(names: Sequence[str], screws: Array, taking: Sequence[int]) -> str:
    """What is special about the dependent screws of a block, in words; ``taking`` are the dependent ones."""
    dependent, told = screws[list(taking)], [names[k] for k in taking]
    listed = ", ".join(told)
    if len(told) == 1:
        return f"{listed} cannot move its body in a direction that the loop allows"
    if (np.linalg.norm(dependent[:, :3], axis=1) > 1e-9).all():
        if len(told) == 2 and _parallel(dependent[:, :3]):
            inside = ", ".join(names[taking[0] + 1 : taking[1]])
            turned = f": {inside} between them is near +-90 deg" if inside else ""
            return f"the axes of {listed} fall together{turned}"
        for k in taking[1:-1]:
            if _stretched(screws, taking, k):
                before, after = told[: told.index(names[k])], told[told.index(names[k]) + 1 :]
                return (
                    f"{names[k]} is near straight or fully folded: its axis lies in one plane with "
                    f"{', '.join(before)} before it and {', '.join(after)} behind it"
                )
        if _meeting_point(dependent) is not None:
            return _concurrent(names, taking)
        for split in range(2, len(told) - 1):
            if all(_meeting_point(part) is not None for part in (dependent[:split], dependent[split:])):
                here, there = ", ".join(told[:split]), ", ".join(told[split:])
                return (
                    f"{here} and {there} can both turn about the line through the two points where they meet"
                )
    return f"the screws of {listed} are dependent: a wrench exists that does no work on any of them"


def _concurrent(names: Sequence[str], taking: Sequence[int]) -> str:
    """Dependent axes through one point: a ball at its limit, or a far axis that passes through the ball."""
    told = [names[k] for k in taking]
    ends = {told[0]: taking[1] - taking[0], told[-1]: taking[-1] - taking[-2]}
    far, gap = max(ends.items(), key=lambda end: end[1])
    if gap > 1 and len(told) > 2:
        others = ", ".join(name for name in told if name != far)
        return f"the axis of {far} passes through the point where those of {others} meet"
    middle = told[len(told) // 2]
    return f"the axes of {', '.join(told)} meet in a point and lie in one plane: {middle} is near +-90 deg"


def _parallel(axes: Array) -> bool:
    return bool(np.linalg.norm(np.cross(axes, axes[0]), axis=1).max() < TOLERANCE)


def _meeting_point(screws: Array) -> Array | None:
    """The point through which all axes pass (nearly), if there is one."""
    # A point p of the axis has p x w = v.
    rows = [[[0.0, w[2], -w[1]], [-w[2], 0.0, w[0]], [w[1], -w[0], 0.0]] for w in screws[:, :3]]
    A, b = np.reshape(rows, (-1, 3)), screws[:, 3:].reshape(-1)
    p = np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])
    return p if np.abs(A @ p - b).max() < TOLERANCE else None


def _place(screws: Array, axis: Array) -> Array | None:
    """Where some axes are, seen along another one: the point where they meet, or a line parallel to it."""
    w, v = screws[0, :3], screws[0, 3:]
    if len(screws) == 1:
        return np.cross(w, v) if _parallel(np.array([axis, w])) else None
    return _meeting_point(screws)


def _stretched(screws: Array, taking: Sequence[int], k: int) -> bool:
    """True if the k-th axis lies in one plane with what is before and what is behind it: a straight knee.

    Before and behind are the dependent axes, if they have one place, else all axes there.
    """
    axis, here = screws[k, :3], np.cross(screws[k, :3], screws[k, 3:])
    offsets: list[Array] = []
    for dependent, every in (
        ([i for i in taking if i < k], range(k)),
        ([i for i in taking if i > k], range(k + 1, len(screws))),
    ):
        place = _place(screws[dependent], axis)
        if place is None:
            place = _place(screws[list(every)], axis)
        if place is None:
            return False
        offsets.append(place - here - axis * (axis @ (place - here)))
    a, b = offsets
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return bool(lengths > 1e-4 and np.linalg.norm(np.cross(a, b)) < 2 * TOLERANCE * lengths)
