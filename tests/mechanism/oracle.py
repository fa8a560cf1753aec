"""What Davies' method gives by LAPACK alone: N written down, its blocks solved and their singular values."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.se3 import pose_from_array, unstack
from screwkin.mechanism.network import coupling_twists, network_of_twists
from screwkin.mechanism.rates import block_rows
from screwkin.mechanism.scaling import referenced


def network_of(mechanism, state):
    """N (B, rows, couplings) of a flat batch."""
    twists = coupling_twists(mechanism, pose_from_array(state.T_world_base), unstack(state.q))
    return network_of_twists(mechanism, twists, np.shape(state.q)[:-1])


def blocks_of(mechanism, N):
    """Every block of secondary columns, at its reference points."""
    scaled, columns = referenced(mechanism, N), mechanism.secondary_columns
    for circuits, own in mechanism.blocks:
        yield scaled[..., block_rows(circuits), :][..., [columns[i] for i in own]]


def davies(mechanism, N, primary):
    """Secondary rates (..., secondary) of all circuits at once, unscaled."""
    right = -(N[..., mechanism.primary_columns] @ primary[..., None])
    return (np.linalg.pinv(N[..., mechanism.secondary_columns], rcond=1e-9) @ right)[..., 0]


def least_values_of(mechanism, N):
    """Least singular value (..., blocks)."""
    values = [np.linalg.svd(A, compute_uv=False)[..., -1] for A in blocks_of(mechanism, N)]
    return np.stack(values, axis=-1)


def largest_values_of(mechanism, N):
    """Largest singular value (..., blocks)."""
    values = [np.linalg.svd(A, compute_uv=False)[..., 0] for A in blocks_of(mechanism, N)]
    return np.stack(values, axis=-1)
