"""What a small error of an axis does to a model's numbers: DH parameters jump, screws follow the axis.

The common normal of two parallel axes may be anywhere; tilt one of them by an angle, however small, and it
runs where they come nearest, about their distance over that angle away. So no DH table is near that of
parallel axes, and calibration about it is ill conditioned; the numbers of a screw are those of its line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Vector, as_array, cross, dot, norm, rotate, rotation_log
from screwkin.analysis.chains import ModelChain, by_screws
from screwkin.kinematics.limits import TURN, turns
from screwkin.model.dh import DHTable, dh_fk
from screwkin.model.dh_derive import dh_from_screws

TILTS = tuple(10.0**-k for k in range(1, 10))
"""Tilts of the series [rad]."""

_NOISE = 1e-6  # rad, and of the robot's size: far above rounding, far below any tolerance of manufacture
_NEVER = 1e-15  # axes at a greater angle than this are not taken as parallel


@dataclass(frozen=True, eq=False)
class Misalignment:
    """A pair of parallel axes, the second tilted by (k,) angles about a line at 45 deg to their normal.

    Attributes:
        chain: name of the chain.
        joints: names of the two joints.
        tilt: (k,) angles [rad].
        dh_length: (k,) largest change of an a or d of the chain's table [m].
        dh_angle: (k,) largest change of an alpha or offset [rad].
        screw_change: (k,) largest change of a number of the screw table.
        dh_error: (k,) error of the tip by rounding with such a table [m and 1, largest entry].
        parallel_error: (k,) the same, for the table with the tilted axes taken as parallel.
    """

    chain: str
    joints: tuple[str, str]
    tilt: Array
    dh_length: Array
    dh_angle: Array
    screw_change: Array
    dh_error: Array
    parallel_error: Array


def misalignment(
    chains: Sequence[ModelChain], tilts: Sequence[float] = TILTS, seed: int = 0
) -> Misalignment | None:
    """The series for the first two successive axes that are parallel and apart; None where there are none."""
    for chain in chains:
        for i, (first, second) in enumerate(zip(chain.screws, chain.screws[1:], strict=False)):
            across = second.s0 - first.s0
            across = across - first.s * dot(across, first.s)
            if norm(cross(first.s, second.s)) < 1e-12 and norm(across) > 1e-6 and not first.is_translation:
                return _series(chain, i + 1, across / norm(across), tilts, seed)
    return None


def _series(
    chain: ModelChain, tilted: int, normal: Vector, tilts: Sequence[float], seed: int
) -> Misalignment:
    screw = chain.screws[tilted]
    about = (normal + cross(screw.s, normal)) / math.sqrt(2.0)
    q = list(np.random.default_rng(seed).uniform(-math.pi, math.pi, (len(chain.screws), 100)))
    straight = dh_from_screws(chain.screws, chain.frame)
    rows = []
    for tilt in tilts:
        screws = list(chain.screws)
        screws[tilted] = Screw(rotate(about, tilt) @ screw.s, screw.s0, screw.pitch)
        table = dh_from_screws(screws, chain.frame, parallel=_NEVER)
        merged = dh_from_screws(screws, chain.frame, parallel=2.0 * tilt)
        exact = as_array(by_screws(screws, chain.frame, q)[0])
        lengths, angles = table_change(straight, table)
        turned = as_array(screws[tilted].s - screw.s)
        errors = [float(np.abs(as_array(dh_fk(t, q)) - exact).max()) for t in (table, merged)]
        rows.append((lengths, angles, float(np.abs(turned).max()), *errors))
    names = (chain.table.joint_names[tilted - 1], chain.table.joint_names[tilted])
    return Misalignment(chain.name, names, np.array(tilts), *np.array(rows).T)


def sensitivity(
    chains: Sequence[ModelChain], length: float, draws: int = 20, seed: int = 0
) -> dict[str, float]:
    """Largest change of a model's numbers per change of an axis, when all axes are slightly off at random.

    Axes tilt by 1e-6 rad and shift by 1e-6 of ``length``, the robot's size [m]; changes of lengths are
    relative to that size. Of the DH tables only what lies between the first and the last axis counts, as base
    and tool are chosen. The median of the draws; about 1 is a model that follows its axes.
    """
    rng = np.random.default_rng(seed)
    dh, screw = np.zeros(draws), np.zeros(draws)
    for chain in chains:
        straight = dh_from_screws(chain.screws, chain.frame)
        for k in range(draws):
            screws = [_nudged(one, length, rng) for one in chain.screws]
            lengths, angles = table_change(straight, dh_from_screws(screws, chain.frame), inner=True)
            dh[k] = max(dh[k], lengths / length / _NOISE, angles / _NOISE)
            for before, after in zip(chain.screws, screws, strict=True):
                moved = [*as_array(after.s - before.s), *(as_array(after.s0 - before.s0) / length)]
                screw[k] = max(screw[k], float(np.abs(moved).max()) / _NOISE)
    return {"dh": float(np.median(dh)), "screw": float(np.median(screw))}


def table_change(before: DHTable, after: DHTable, inner: bool = False) -> tuple[float, float]:
    """Largest difference of two modified tables of a chain: of lengths [m], and of angles [rad].

    ``inner`` leaves out what leads from the base to the first axis and from the last one to the tip.
    """
    rows = zip(before.rows, after.rows, strict=True)
    change = np.array([[b.a - a.a, b.d - a.d, b.alpha - a.alpha, b.offset - a.offset] for a, b in rows])
    change[:, 2:] -= TURN * turns(change[:, 2:])
    if inner:
        change[0, [0, 2]] = change[0, [1, 3]] = change[-1, [1, 3]] = 0.0
    lengths, angles = [np.abs(change[:, :2]).max()], [np.abs(change[:, 2:]).max()]
    if not inner:
        for a_end, b_end in ((before.base, after.base), (before.tool, after.tool)):
            lengths += [abs(x) for x in b_end.p - a_end.p]
            angles.append(norm(rotation_log(b_end.R @ a_end.R.T)))
    return float(max(lengths)), float(max(angles))


def _nudged(screw: Screw, length: float, rng: np.random.Generator) -> Screw:
    tilt, shift = (Vector(*(v / np.linalg.norm(v)).tolist()) for v in rng.normal(size=(2, 3)))
    across = cross(screw.s, tilt)
    s = rotate(across / norm(across), _NOISE) @ screw.s
    return replace(screw, s=s, s0=screw.s0 + shift * (_NOISE * length))
