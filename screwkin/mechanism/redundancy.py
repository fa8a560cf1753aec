"""Rates where imposed couplings leave freedom: priorities, then the weighted least of the rest.

Every motion that the circuits admit is a combination of the null vectors of N. Each level of wishes takes
what it needs of them, by least squares, and hands down only combinations that do not change it.
Source: Nakamura, Hanafusa and Yoshikawa (1987), task priority; Whitney (1969), weighted least norm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError, SingularError, expect, one_of
from screwkin.kinematics.arrays import checked
from screwkin.mechanism.choice import RANK_TOLERANCE
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.quantities import network_matrix
from screwkin.mechanism.scaling import characteristic_length, referenced
from screwkin.model.state import State

FOLLOWED = 1e-8
"""Largest deviation of an imposed rate, relative to the largest, lengths in sizes of the robot."""


def least_rates(
    mechanism: Mechanism,
    state: State,
    imposed: Mapping[str, Any],
    wishes: Sequence[Mapping[str, Any]] = (),
    weights: Mapping[str, float] | None = None,
) -> Array:
    """Rates of all couplings where the imposed ones leave freedom: wishes in their order, then the least.

    Args:
        mechanism: from ``closed_mechanism``; its choice of primary couplings does not matter here.
        state: T_world_base (..., 4, 4) and q (..., n), closed.
        imposed: rate (...) of couplings [rad/s or m/s], by name; fewer than the mobility.
        wishes: rates of further couplings, the most important first; each is followed as far as those before
            it allow, by least squares, metres divided by the robot's size.
        weights: of the couplings whose weighted squares are least in the end, by name; those not named weigh
            0. Default: 1 for every real joint.

    Returns:
        (..., couplings), in ``mechanism.couplings`` order [rad/s or m/s].

    Raises:
        UnknownNameError: no such coupling. InputError: a weight that is no number of at least 0.
        SingularError: the imposed rates contradict one another, or no motion follows them.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> mechanism = sk.closed_mechanism(sk.load_robot("linkages/four-bar"))
        >>> rates = sk.least_rates(mechanism, sk.home(mechanism.robot), {"crank": 1.0})
        >>> round(float(rates[0]), 9)
        1.0

    Source: Nakamura, Hanafusa and Yoshikawa (1987); Whitney (1969).
    """
    expect(mechanism, Mechanism, "mechanism", "closed_mechanism(robot)")
    levels = [_named(mechanism, "imposed", imposed)]
    levels += [_named(mechanism, f"wishes[{k}]", wish) for k, wish in enumerate(wishes)]
    N = network_matrix(mechanism, state)
    batch = np.broadcast_shapes(N.shape[:-2], *(np.shape(v) for level in levels for v in level.values()))
    xp = numpy_of(N, *(v for level in levels for v in level.values()))
    N = referenced(mechanism, N) if mechanism.circuits else N
    unit = _units(mechanism)
    V = xp.linalg.svd(N * unit, full_matrices=True)[2]
    free = xp.swapaxes(V, -1, -2)[..., V.shape[-1] - mechanism.mobility :]
    free = xp.broadcast_to(free, (*batch, *free.shape[-2:]))
    rates = xp.zeros((*batch, len(unit)))
    for k, level in enumerate(levels):
        rates, free = _followed(mechanism, rates, free, unit, level)
        if k == 0 and not is_jax(rates):
            _refuse_open(mechanism, rates, level, unit)
    shares = np.sqrt(_weights(mechanism, weights)) * unit
    shares = shares / shares.max(initial=0.0) if shares.any() else shares
    step = _inverse(shares[:, None] * free) @ (shares * rates)[..., None]
    result: Array = (rates - (free @ step)[..., 0]) * unit
    return result


def _followed(
    mechanism: Mechanism, rates: Array, free: Array, unit: Array, level: Mapping[str, Array]
) -> tuple[Array, Array]:
    """Rates nearest to those of a level, and the motions that do not change them; both without units."""
    xp = numpy_of(rates, *level.values())
    if not level:
        return rates, free
    rows = [mechanism.position[name] for name in level]
    wanted = xp.stack([xp.broadcast_to(v, rates.shape[:-1]) for v in level.values()], axis=-1) / unit[rows]
    A = free[..., rows, :]
    inverse = _inverse(A)
    step = inverse @ (wanted - rates[..., rows])[..., None]
    return rates + (free @ step)[..., 0], free - free @ (inverse @ A)


def _inverse(A: Array) -> Array:
    """The pseudoinverse of rows of null vectors, which have length 1: what is near 0 among them is 0."""
    xp = numpy_of(A)
    U, sigma, V = xp.linalg.svd(A, full_matrices=False)
    regular = sigma > RANK_TOLERANCE
    scale = xp.where(regular, 1 / xp.where(regular, sigma, 1.0), 0.0)
    inverse: Array = xp.swapaxes(V, -1, -2) @ (scale[..., None] * xp.swapaxes(U, -1, -2))
    return inverse


def _named(mechanism: Mechanism, what: str, level: Mapping[str, Any]) -> dict[str, Array]:
    """The rates of a level, by couplings that exist, checked."""
    if not isinstance(level, Mapping):
        raise InputError(f"{what} is {level!r}; give rates by names of couplings, as {{'hand.px': 0.1}}")
    return {
        one_of("coupling", name, mechanism.couplings): checked(f"{what}[{name!r}]", value)
        for name, value in level.items()
    }


def _units(mechanism: Mechanism) -> Array:
    """Of every coupling's rate: the robot's size for those that slide, so that metres do not weigh."""
    length = characteristic_length(mechanism.robot)
    sliding = {joint.name for joint in mechanism.robot.joints if joint.screw.is_translation}
    for chain in (*mechanism.chains, *mechanism.added):
        sliding |= {n for n, c in zip(chain.names, chain.couplings, strict=True) if c[0] == "p"}
    return np.array([length if name in sliding else 1.0 for name in mechanism.couplings])


def _weights(mechanism: Mechanism, weights: Mapping[str, float] | None) -> Array:
    chosen: dict[str, Any] = dict(weights or {})
    if weights is None:
        chosen = dict.fromkeys(mechanism.robot.joint_names, 1.0)
    for name, value in chosen.items():
        one_of("coupling", name, mechanism.couplings)
        if not (isinstance(value, int | float) and 0 <= value < np.inf):
            raise InputError(f"the weight of {name} is {value!r}; it must be a finite number of at least 0")
    return np.array([float(chosen.get(name, 0.0)) for name in mechanism.couplings])


def _refuse_open(mechanism: Mechanism, rates: Array, level: Mapping[str, Array], unit: Array) -> None:
    """Raise where imposed rates are not followed."""
    for name, value in level.items():
        column = mechanism.position[name]
        off = np.abs(rates[..., column] - value / unit[column])
        scale = np.maximum(np.abs(rates).max(axis=-1), 1e-300)
        if (off > FOLLOWED * scale).any():
            sample = int(np.argmax(np.ravel(off / scale)))
            raise SingularError(
                f"{mechanism.robot.name}, sample {sample}: no motion of the circuits follows all imposed "
                f"rates; {name} is off by {np.ravel(off)[sample] * unit[column]:.3g}. Impose fewer, or move "
                "away from the singularity",
                mechanism.robot.name,
                sample,
            )
