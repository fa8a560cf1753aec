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
from screwkin.compiler.run import common_batch
from screwkin.errors import SingularError
from screwkin.kinematics.status import Status
from screwkin.mechanism.free_screws import FreeScrews, free_screws
from screwkin.mechanism.least_values import least_values, network_values
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import coupling_screws
from screwkin.mechanism.rates import block_name, block_rows, flat, network_of
from screwkin.mechanism.scaling import centre, referenced
from screwkin.model.display import listing
from screwkin.model.state import State

NEAR = 0.02
"""Smallest normalised singular value below which a limb is reported as near a singularity."""

TOLERANCE = 0.05
"""How nearly parallel, concurrent or in one plane axes are that cause a singularity, length-normalised."""


@dataclass(frozen=True)
class LimbSingularity:
    """The worst sample of a limb (or loop): its smallest singular value, and the cause when it is small.

    Where it is near, and a state was given, ``free`` holds the motion and the wrench that it leaves free.
    """

    limb: str
    sample: int
    sigma: float
    near: bool
    joints: tuple[str, ...]
    cause: str
    free: FreeScrews | None = None


def singularity_report(mechanism: Mechanism, at: State | Array) -> tuple[LimbSingularity, ...]:
    """For every limb or loop its least regular sample.

    Args:
        mechanism: the closed mechanism.
        at: a state, batched or not; or its network matrices (..., 6 circuits, couplings), formed at the base
            origin as ``network_matrix`` does by default.

    Returns:
        One entry for every block of secondary couplings. Singular values have no unit: screws are taken at
        the tip (of a loop: at the point nearest to its axes), velocities over ``characteristic_length``.

    Example:
        >>> import screwkin as sk
        >>> mechanism = sk.closed_mechanism(sk.load_robot(sk.robot_names()[0]))
        >>> any(entry.near for entry in sk.singularity_report(mechanism, sk.home(mechanism.robot)))
        False
    """
    if isinstance(at, State):
        T, q = np.asarray(at.T_world_base, dtype=float), np.asarray(at.q, dtype=float)
        batch = common_batch((T, q), (2, 1))
        T, q = flat(T, 2, batch), flat(q, 1, batch)
        sigma = least_values(mechanism, T, q)
        worst = sigma.argmin(axis=0)
        N, S = (
            network_of(mechanism, T[worst], q[worst]),
            coupling_screws(mechanism, State(T[worst], q[worst])),
        )
    else:
        every = np.reshape(at, (-1, *np.shape(at)[-2:]))
        sigma = network_values(mechanism, every)
        worst = sigma.argmin(axis=0)
        N, S = every[worst], None
    scaled, entries = referenced(mechanism, N), []
    for k, sample in enumerate(worst):
        smallest, free = float(sigma[sample, k]), None
        if S is not None and smallest < NEAR:
            free = free_screws(mechanism, k, N[k], S[k], NEAR)
        entries.append(_entry(mechanism, k, int(sample), smallest, scaled[k], free))
    return tuple(entries)


def _entry(
    mechanism: Mechanism, block: int, sample: int, sigma: float, scaled: Array, free: FreeScrews | None
) -> LimbSingularity:
    """The entry of one block, from its referenced network matrix at its worst sample."""
    circuits, inside = mechanism.blocks[block]
    chosen = [mechanism.secondary_columns[i] for i in inside]
    null = np.linalg.svd(scaled[block_rows(circuits)][:, chosen])[2][-1]
    dependent = [k for k in range(len(chosen)) if abs(null[k]) > 0.05 * np.abs(null).max()]
    names = [mechanism.couplings[c] for c in chosen]
    near = sigma < NEAR
    cause = _cause(names, _screws(scaled, mechanism, chosen), dependent, free) if near else ""
    joints = tuple(names[k] for k in dependent)
    return LimbSingularity(block_name(mechanism, circuits), sample, sigma, near, joints, cause, free)


def refuse_singular(
    mechanism: Mechanism, T_world_base: Array, q: Array, singular: Array, time: Array | None = None
) -> None:
    """Raise for the first singular sample of a batch.

    Args:
        mechanism: the closed mechanism.
        T_world_base: (..., 4, 4).
        q: (..., n) [rad or m].
        singular: (..., blocks) bool, from ``secondary_rates`` or ``least_values``.
        time: of the samples (T,) [s], for the message.

    Raises:
        SingularError: names limb, sample, its time where times are given, and the cause.
    """
    if not (np.count_nonzero(singular) if type(singular) is np.ndarray else singular.any()):
        return
    batch, blocks = singular.shape[:-1], singular.shape[-1]
    sample, block = (int(i) for i in np.argwhere(np.reshape(singular, (-1, blocks)))[0])
    here = State(flat(T_world_base, 2, batch)[sample], flat(q, 1, batch)[sample])
    entry = singularity_report(mechanism, here)[block]
    when = "" if time is None else f" (t = {time[sample]:.3f} s)"
    message = f"{entry.limb}, sample {sample}{when}: singular; {entry.cause}; {Status.SINGULAR.help}"
    raise SingularError(message, entry.limb, sample)


def _screws(N: Array, mechanism: Mechanism, columns: Sequence[int]) -> Array:
    """Screws (k, 6) of some couplings, from the first circuit that holds each."""
    rows = [int(np.flatnonzero(mechanism.involved[:, c])[0]) for c in columns]
    return np.array([N[6 * r : 6 * r + 6, c] for r, c in zip(rows, columns, strict=True)])


def _cause(names: Sequence[str], screws: Array, taking: Sequence[int], free: FreeScrews | None) -> str:
    """What is special about the dependent screws of a block, in words; ``taking`` are the dependent ones."""
    dependent, chosen = screws[list(taking)], [names[k] for k in taking]
    listed = ", ".join(chosen)
    if len(chosen) == 1:
        return f"{listed} cannot move its body in a direction that the loop allows"
    if (np.linalg.norm(dependent[:, :3], axis=1) > 1e-9).all():
        if len(chosen) == 2 and _parallel(dependent[:, :3]):
            inside = ", ".join(names[taking[0] + 1 : taking[1]])
            turned = f": {inside} between them is near +-90 deg" if inside else ""
            return f"the axes of {listed} fall together{turned}"
        for k in taking[1:-1]:
            if _stretched(screws, taking, k):
                before, after = chosen[: chosen.index(names[k])], chosen[chosen.index(names[k]) + 1 :]
                return (
                    f"{names[k]} is near straight or fully folded: its axis lies in one plane with "
                    f"{', '.join(before)} before it and {', '.join(after)} behind it"
                )
        if _meeting_point(dependent) is not None:
            return _concurrent(names, taking)
        for split in range(2, len(chosen) - 1):
            if all(_meeting_point(part) is not None for part in (dependent[:split], dependent[split:])):
                here, there = ", ".join(chosen[:split]), ", ".join(chosen[split:])
                return (
                    f"{here} and {there} can both turn about the line through the two points where they meet"
                )
    if free is None:
        names = listing(chosen)
        return f"the screws of {names} are dependent: a wrench exists that does no work on any of them"
    return (
        f"{free.body} can move while the primary couplings rest, by {free.motion.text}; "
        f"free wrench: {free.wrench.text}"
    )


def _concurrent(names: Sequence[str], taking: Sequence[int]) -> str:
    """Dependent axes through one point: a ball at its limit, or a far axis that passes through the ball."""
    chosen = [names[k] for k in taking]
    ends = {chosen[0]: taking[1] - taking[0], chosen[-1]: taking[-1] - taking[-2]}
    far, gap = max(ends.items(), key=lambda end: end[1])
    if gap > 1 and len(chosen) > 2:
        others = ", ".join(name for name in chosen if name != far)
        return f"the axis of {far} passes through the point where those of {others} meet"
    middle = chosen[len(chosen) // 2]
    return f"the axes of {', '.join(chosen)} meet in a point and lie in one plane: {middle} is near +-90 deg"


def _parallel(axes: Array) -> bool:
    return bool(np.linalg.norm(np.cross(axes, axes[0]), axis=1).max() < TOLERANCE)


def _meeting_point(screws: Array) -> Array | None:
    """The point through which all axes pass (nearly), if there is one."""
    p = centre(screws.T)
    return p if np.abs(np.cross(p, screws[:, :3]) - screws[:, 3:]).max() < TOLERANCE else None


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
