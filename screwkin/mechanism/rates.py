"""Secondary rates and accelerations from the primary ones: Davies' method, batched.

Source: paper A, eq. 10-11. The system falls apart into blocks of circuits that share secondary
couplings (for a humanoid whose waist is imposed: one limb each), and each block is one small solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import is_jax
from screwkin.algebra.se3 import NO_TWIST, Twist, as_array
from screwkin.mechanism.choice import RANK_TOLERANCE, characteristic_length, normalised
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import twist_rates


@dataclass(frozen=True)
class SecondarySolution:
    """Secondary magnitudes (..., secondary), and for every block its smallest normalised singular value."""

    values: Array
    sigma: Array
    blocks: tuple[str, ...]

    @property
    def singular(self) -> Array:
        """(..., blocks) bool."""
        return self.sigma < RANK_TOLERANCE


def block_name(mechanism: Mechanism, circuits: Sequence[int]) -> str:
    """The limbs or loops that a block joins."""
    return " + ".join(mechanism.circuit_names[c] for c in circuits)


def block_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of all blocks, in their order."""
    return tuple(block_name(mechanism, circuits) for circuits, _ in mechanism.blocks)


def block_rows(circuits: Sequence[int]) -> list[int]:
    """Rows of N that belong to the circuits."""
    return [6 * c + r for c in circuits for r in range(6)]


def solve_secondary(mechanism: Mechanism, N: Array, right: Array) -> SecondarySolution:
    """Secondary magnitudes x with N_s x = right, block by block.

    Args:
        mechanism: says which columns are secondary.
        N: network matrix (..., 6 circuits, couplings).
        right: (..., 6 circuits).

    Returns:
        values (..., secondary); singular blocks are solved by least squares and flagged by ``sigma``.
        Overconstrained loops (more equations than the rank) are solved by least squares too; their
        equations agree at a closed position.
    """
    np_ = _numpy_of(N, right)
    length = characteristic_length(mechanism.robot)
    columns = mechanism.secondary_columns
    scaled, wanted = normalised(N, length), normalised(right[..., None], length)
    parts: list[tuple[int, Array]] = []
    sigmas = []
    for circuits, inside in mechanism.blocks:
        rows = block_rows(circuits)
        A = scaled[..., rows, :][..., [columns[i] for i in inside]]
        b = wanted[..., rows, :]
        sigma = np_.linalg.svd(A, compute_uv=False)[..., -1]
        if A.shape[-1] == A.shape[-2]:
            healthy = (sigma >= RANK_TOLERANCE)[..., None, None]
            eye = np_.broadcast_to(np_.eye(A.shape[-1]), A.shape)
            x = np_.linalg.solve(np_.where(healthy, A, eye), b)[..., 0]
            if not is_jax(A) and not healthy.all():
                least = (np.linalg.pinv(A, rcond=RANK_TOLERANCE) @ b)[..., 0]
                x = np.where(healthy[..., 0], x, least)
        else:
            x = (np_.linalg.pinv(A, rcond=RANK_TOLERANCE) @ b)[..., 0]
        parts += [(i, x[..., k]) for k, i in enumerate(inside)]
        sigmas.append(sigma)
    names = block_names(mechanism)
    if not parts:  # nothing follows: a tree without tips
        nothing = np_.zeros((*right.shape[:-1], 0))
        return SecondarySolution(nothing, nothing, names)
    values = np_.stack([x for _, x in sorted(parts, key=lambda part: part[0])], axis=-1)
    return SecondarySolution(values, np_.stack(sigmas, axis=-1), names)


def secondary_rates(mechanism: Mechanism, N: Array, primary: Array) -> SecondarySolution:
    """Rates of the secondary couplings from those of the primary ones (..., primary): eq. 11."""
    Np = N[..., mechanism.primary_columns]
    return solve_secondary(mechanism, N, -(Np @ primary[..., None])[..., 0])


def secondary_accelerations(
    mechanism: Mechanism, twists: Sequence[Twist], N: Array, rates: Array, primary: Array
) -> SecondarySolution:
    """Second derivatives of the secondary couplings: N q'' = -N' q', with N' from the brackets of the screws.

    Args:
        mechanism: the closed mechanism.
        twists: the couplings' screws at the states (as for N).
        N: network matrix (..., 6 circuits, couplings).
        rates: rates of all couplings (..., couplings).
        primary: second derivatives of the primary couplings (..., primary).
    """
    scalars = [rates[..., i] for i in range(rates.shape[-1])]
    moving = twist_rates(mechanism, twists, scalars)
    bias = [dS * rate for dS, rate in zip(moving, scalars, strict=True)]
    rows = []
    for signs in mechanism.circuit_matrix:
        total = NO_TWIST
        for sign, term in zip(signs, bias, strict=True):
            if sign:
                total = total + term * int(sign)
        rows.append(total)
    coriolis = as_array(rows, rates.shape[:-1]).reshape(*rates.shape[:-1], -1)
    Np = N[..., mechanism.primary_columns]
    return solve_secondary(mechanism, N, -(Np @ primary[..., None])[..., 0] - coriolis)


def _numpy_of(*arrays: Array) -> Any:
    if any(is_jax(a) for a in arrays):
        import jax.numpy as jnp

        return jnp
    return np


def singular_values(mechanism: Mechanism, N: Array) -> Array:
    """Smallest singular value (..., blocks) of every limb's or loop's secondary block, length-normalised."""
    scaled = normalised(N, characteristic_length(mechanism.robot))
    columns = mechanism.secondary_columns
    sigma = np.empty((*N.shape[:-2], len(mechanism.blocks)))
    for k, (circuits, inside) in enumerate(mechanism.blocks):
        A = scaled[..., block_rows(circuits), :][..., [columns[i] for i in inside]]
        sigma[..., k] = np.linalg.svd(A, compute_uv=False)[..., -1]
    return sigma
