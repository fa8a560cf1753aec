"""Secondary rates and accelerations from the primary ones, by Davies' method, certified.

The system falls apart into blocks of circuits that share secondary couplings (for a humanoid whose waist is
imposed: one limb each). A program solves the blocks that have a formula; what it does not certify, and all
other blocks, are solved by singular values.

Source: paper A, eq. 10-11.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.scalar import is_jax
from screwkin.algebra.se3 import as_array, twist_from_array, unstack
from screwkin.compiler.run import common_batch
from screwkin.mechanism.choice import RANK_TOLERANCE
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import assembled, coupling_screws, twist_rates
from screwkin.mechanism.scaling import reference_points, referenced
from screwkin.mechanism.secondary import formula_blocks, secondary_door
from screwkin.model.state import State

CERTIFIED = 2 * RANK_TOLERANCE
"""Lower bound of a block's least singular value above which its formula is certified.

The margin to ``RANK_TOLERANCE`` exceeds rounding, so that the verdict on a sample is the same on every path.
"""


@dataclass(frozen=True)
class SecondarySolution:
    """Magnitudes of the secondary couplings (..., secondary), and which blocks are singular (..., blocks)."""

    values: Array
    singular: Array


def block_name(mechanism: Mechanism, circuits: Sequence[int]) -> str:
    """The limbs or loops that a block joins."""
    return " + ".join(mechanism.circuit_names[c] for c in circuits)


def block_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of all blocks, in their order."""
    return tuple(block_name(mechanism, circuits) for circuits, _ in mechanism.blocks)


def block_rows(circuits: Sequence[int]) -> list[int]:
    """Rows of N that belong to the circuits."""
    return [6 * c + r for c in circuits for r in range(6)]


def flat(array: Array, axes: int, batch: tuple[int, ...]) -> Array:
    """The array broadcast to a batch, all of it as one axis in front of its last axes."""
    inner = array.shape[array.ndim - axes :]
    return np.broadcast_to(array, (*batch, *inner)).reshape(math.prod(batch), *inner)


def solve_rates(mechanism: Mechanism, T_world_base: Array, q: Array, primary: Array) -> SecondarySolution:
    """Rates of the secondary couplings from those of the primary ones: eq. 11.

    Args:
        mechanism: the closed mechanism.
        T_world_base: (..., 4, 4), NumPy or JAX.
        q: (..., n) [rad or m].
        primary: (..., primary), in ``mechanism.primary`` order [rad/s or m/s].

    Returns:
        Singular blocks are solved by least squares, and marked.
    """
    by_formula = formula_blocks(mechanism)
    if not by_formula or any(map(is_jax, (T_world_base, q, primary))):
        batch, xp = common_batch((T_world_base, q, primary), (2, 1, 1)), numpy_of(T_world_base, q, primary)
        N = network_of(mechanism, T_world_base, q)
        N = xp.broadcast_to(N, (*batch, *N.shape[-2:]))
        return _by_singular_values(mechanism, N, xp.broadcast_to(primary, (*batch, primary.shape[-1])))
    values, least = secondary_door(mechanism.robot, *mechanism.choice)((T_world_base, q, primary))
    batch = values.shape[:-1]
    singular = np.zeros((*batch, len(mechanism.blocks)), dtype=bool)
    certified = least > CERTIFIED
    if np.count_nonzero(certified) == certified.size and len(by_formula) == len(mechanism.blocks):
        return SecondarySolution(values, singular)
    T, q, primary = flat(T_world_base, 2, batch), flat(q, 1, batch), flat(primary, 1, batch)
    rows, marks = values.reshape(len(q), -1), singular.reshape(len(q), -1)

    def solve(samples: Array, blocks: Sequence[int]) -> None:
        N = network_of(mechanism, T[samples], q[samples])
        solution = _by_singular_values(mechanism, N, primary[samples], blocks)
        for k in blocks:
            own = mechanism.blocks[k][1]
            rows[samples[:, None], own] = solution.values[:, own]
            marks[samples, k] = solution.singular[:, k]

    uncertified = np.flatnonzero(~certified.all(axis=-1))
    if len(uncertified):
        solve(uncertified, by_formula)
    others = [k for k in range(len(mechanism.blocks)) if k not in by_formula]
    if others and len(q):
        solve(np.arange(len(q)), others)
    return SecondarySolution(values, singular)


def secondary_accelerations(
    mechanism: Mechanism, T_world_base: Array, q: Array, rates: Array, primary: Array
) -> SecondarySolution:
    """Second derivatives of the secondary couplings: N q'' = -N' q', with N' from the brackets of the screws.

    Args:
        mechanism: the closed mechanism.
        T_world_base: (..., 4, 4), NumPy or JAX.
        q: (..., n) [rad or m].
        rates: of all couplings (..., couplings), as ``blend`` puts them together [rad/s or m/s].
        primary: second derivatives of the primary couplings (..., primary) [rad/s^2 or m/s^2].

    Returns:
        As ``secondary_rates``.
    """
    batch = common_batch((T_world_base, q, rates, primary), (2, 1, 1, 1))
    xp = numpy_of(T_world_base, q, rates, primary)
    S = coupling_screws(mechanism, State(T_world_base, q))
    S = xp.broadcast_to(S, (*batch, *S.shape[-2:]))
    rates = xp.broadcast_to(rates, (*batch, rates.shape[-1]))
    scalars = unstack(rates @ mechanism.gears.T if mechanism.robot.coupled else rates)
    moving = twist_rates(mechanism, [twist_from_array(S[..., c]) for c in range(S.shape[-1])], scalars)
    bias = as_array([dS * rate for dS, rate in zip(moving, scalars, strict=True)], batch)
    coriolis = xp.matmul(mechanism.circuit_matrix.astype(float), bias).reshape(
        *batch, 6 * len(mechanism.circuits)
    )
    return _by_singular_values(mechanism, assembled(mechanism, S), primary, known=coriolis)


def network_of(mechanism: Mechanism, T_world_base: Array, q: Array) -> Array:
    """Network matrix (..., 6 circuits, couplings) of checked arrays, formed at the base origin."""
    N: Array = assembled(mechanism, coupling_screws(mechanism, State(T_world_base, q)))
    return N


def _by_singular_values(
    mechanism: Mechanism,
    N: Array,
    primary: Array,
    blocks: Sequence[int] | None = None,
    known: Array | None = None,
) -> SecondarySolution:
    """Secondary magnitudes x with N_s x = -N_p primary - known, for some blocks (default: all), else zero.

    Overconstrained loops (more equations than the rank) are solved by least squares too; their equations
    agree at a closed position.
    """
    xp, points = numpy_of(N, primary), reference_points(mechanism, N)
    scaled = referenced(mechanism, N, points)
    right = -(scaled[..., mechanism.primary_columns] @ primary[..., None])
    if known is not None:
        right = right - referenced(mechanism, known[..., None], points)
    batch, columns = right.shape[:-2], mechanism.secondary_columns
    values: list[Array] = [xp.zeros(batch)] * len(columns)
    singular: list[Array] = [xp.zeros(batch, dtype=bool)] * len(mechanism.blocks)
    for k in range(len(mechanism.blocks)) if blocks is None else blocks:
        circuits, inside = mechanism.blocks[k]
        rows = block_rows(circuits)
        x, singular[k] = _solve(scaled[..., rows, :][..., [columns[i] for i in inside]], right[..., rows, :])
        for j, i in enumerate(inside):
            values[i] = x[..., j]
    return SecondarySolution(
        xp.stack(values, axis=-1) if values else xp.zeros((*batch, 0)),
        xp.stack(singular, axis=-1) if singular else xp.zeros((*batch, 0), dtype=bool),
    )


def _solve(A: Array, b: Array) -> tuple[Array, Array]:
    """x (..., n) with A x = b, by least squares where A is singular or not square; where it is singular."""
    xp, square = numpy_of(A, b), A.shape[-1] == A.shape[-2]
    if square or is_jax(A):
        singular = xp.linalg.svd(A, compute_uv=False)[..., -1] < RANK_TOLERANCE
        if not square:
            return (xp.linalg.pinv(A, rcond=RANK_TOLERANCE) @ b)[..., 0], singular
        here, eye = singular[..., None, None], xp.broadcast_to(xp.eye(A.shape[-1]), A.shape)
        x = xp.linalg.solve(xp.where(here, eye, A), b)
        if is_jax(A):
            from jax.lax import stop_gradient

            least = xp.linalg.pinv(stop_gradient(xp.where(here, A, eye)), rcond=RANK_TOLERANCE) @ b
            x = xp.where(here, least, x)
        elif singular.any():
            x[singular] = least_squares(A[singular], b[singular])[0]
        return x[..., 0], singular
    x, sigma, _ = least_squares(A, b)
    return x[..., 0], sigma[..., -1] < RANK_TOLERANCE


def least_squares(A: Array, b: Array) -> tuple[Array, Array, Array]:
    """The shortest x (..., n, 1) of least squares, the singular values of A, and V^T of its factorisation."""
    U, sigma, V = np.linalg.svd(A, full_matrices=False)
    regular = sigma > RANK_TOLERANCE * sigma[..., :1]
    scale = np.where(regular, 1 / np.where(regular, sigma, 1.0), 0.0)
    return V.swapaxes(-1, -2) @ (scale[..., None] * (U.swapaxes(-1, -2) @ b)), sigma, V
