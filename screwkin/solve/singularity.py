"""Which limb is near a singularity, how near, and why: read from the geometry of its dependent screws.

A rank test on N sees nothing (its virtual columns keep it regular) and a determinant mixes units; the
length-normalised smallest singular value of each limb's secondary block tells, and its null vector names the
joints that work against each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.mechanism.choice import characteristic_length, normalised
from screwkin.mechanism.mechanism import Mechanism
from screwkin.solve.rates import block_name, block_rows

Array = np.ndarray[Any, np.dtype[np.float64]]

NEAR = 0.02
"""Smallest normalised singular value below which a limb is reported as near a singularity."""


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
        names = [mechanism.couplings[chosen[k]] for k in taking]
        screws = _screws(scaled[worst], mechanism, [chosen[k] for k in taking])
        near = bool(sigma[worst] < NEAR)
        span = range(chosen[taking[0]] + 1, chosen[taking[-1]])
        between = [mechanism.couplings[c] for c in span if c in chosen]
        cause = _cause(names, screws, between) if near else ""
        report.append(
            LimbSingularity(
                block_name(mechanism, circuits), worst, float(sigma[worst]), near, tuple(names), cause
            )
        )
    return tuple(report)


def _screws(N: Array, mechanism: Mechanism, columns: Sequence[int]) -> Array:
    """Screws (k, 6) of some couplings, from the first circuit that holds each."""
    rows = [int(np.flatnonzero(mechanism.circuit_matrix[:, c])[0]) for c in columns]
    return np.array([N[6 * r : 6 * r + 6, c] for r, c in zip(rows, columns, strict=True)])


def _cause(names: Sequence[str], screws: Array, between: Sequence[str]) -> str:
    """What is special about dependent screws, in words; ``between`` are the joints from first to last."""
    turning = np.linalg.norm(screws[:, :3], axis=1) > 1e-9
    axes = screws[turning, :3]
    listed = ", ".join(names)
    if len(names) == 1:
        return f"{names[0]} cannot move its body in a direction that the loop allows"
    parallel = turning.all() and np.linalg.norm(np.cross(axes, axes[0]), axis=1).max() < 0.05
    if parallel and len(names) == 2:
        turned = f": {', '.join(between)} between them is near +-90 deg" if between else ""
        return f"the axes of {listed} fall together{turned}"
    if parallel:
        middle = names[len(names) // 2]
        return f"the parallel axes of {listed} lie in one plane: {middle} is near straight or fully folded"
    virtual = [name for name in names if "." in name]
    if virtual and len(virtual) == len(names):
        return (
            f"the virtual rotations {listed} lie in one plane: {virtual[len(virtual) // 2]} is near +-90 deg"
        )
    if turning.all() and _concurrent(screws):
        middle = names[len(names) // 2]
        return f"the axes of {listed} meet in a point and lie in one plane: {middle} is near +-90 deg"
    return f"the screws of {listed} are dependent: a wrench exists that does no work on any of them"


def _concurrent(screws: Array) -> bool:
    """True if all axes pass (nearly) through one point."""
    rows, right = [], []
    for s in screws:
        w, v = s[:3], s[3:]
        # A point p of the axis has p x w = v.
        rows.append(np.array([[0.0, w[2], -w[1]], [-w[2], 0.0, w[0]], [w[1], -w[0], 0.0]]))
        right.append(v)
    A, b = np.concatenate(rows), np.concatenate(right)
    p = np.linalg.lstsq(A, b, rcond=None)[0]
    return bool(np.abs(A @ p - b).max() < 0.05)
