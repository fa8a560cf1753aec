"""The closed mechanism over arrays: network matrix, rates by Davies' method, whole-body positions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError
from screwkin.kinematics.arrays import Told, checked, one_batch, told
from screwkin.kinematics.status import Status
from screwkin.mechanism import davies, network, rates
from screwkin.mechanism import virtual_motion as virtual
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.singularity import refuse_singular
from screwkin.model.state import State


def network_matrix(mechanism: Mechanism, state: State, point: Any = None) -> Array:
    """Davies' network matrix N (..., 6 circuits, couplings): N q' = 0, rows [omega; v] of every circuit.

    Args:
        mechanism: from ``closed_mechanism``; its ``couplings`` name the columns.
        state: a (closed) state.
        point: world point (..., 3) [m] where the screws are told; default: the waist origin, which travels
            with the robot. A far point spoils the conditioning.

    Source: paper A, eq. 8-9.
    """
    at = {} if point is None else {"point": ("point", point, 3)}
    choice = mechanism.robot, mechanism.primary, mechanism.secondary
    found = davies.coupling_screws(*choice, point is None, told=told(mechanism.robot, state, at))
    return network.assembled(mechanism, found["S"])


def virtual_motion(
    mechanism: Mechanism, state: State, base_twist: Any, tip_twists: Mapping[str, Any]
) -> Array:
    """Rates (..., primary) of the primary virtual couplings that give base and tips their twists.

    Args:
        mechanism: its primary couplings must all belong to virtual chains.
        state: the present state.
        base_twist: [omega; v of the base origin] (..., 6), world axes; ignored with a fixed base.
        tip_twists: for every tip with primary couplings: [omega; v of the tip origin] (..., 6), or v alone
            (..., 3) where only translations are primary.

    Raises:
        InputError: a real joint is primary, or a tip's twist is missing or lacks a rotation.

    Source: paper A, eq. 7.
    """
    moving, whole = dict[str, Told](), []
    chains = virtual.imposing_chains(mechanism)
    for k, chain in enumerate(chains):
        wanted = [name for name in chain.names if name in mechanism.primary]
        given = base_twist if chain.limb is None else tip_twists.get(chain.name)
        named = "base_twist" if chain.limb is None else f"tip_twists[{chain.name!r}]"
        if given is None:
            lacks = "base_twist is None" if chain.limb is None else f"tip_twists lacks {chain.name}"
            raise InputError(f"{lacks}, but {', '.join(wanted)} are primary")
        size = 3 if _length(given) == 3 else 6
        if size == 6:
            whole.append(chain.name)
        elif any(name.split(".")[1][0] == "r" for name in wanted):
            raise InputError(f"the twist of {chain.name} has 3 components, but its rotations are primary")
        moving[f"twist_{k}"] = (named, given, size)
    virtually = {name for chain in chains for name in chain.names}
    real = [name for name in mechanism.primary if name not in virtually]
    if real:
        raise InputError(
            f"primary couplings {', '.join(real)} belong to no virtual chain; give their rates directly"
        )
    choice = mechanism.robot, mechanism.primary, mechanism.secondary
    return davies.primary_rates(*choice, tuple(whole), told=told(mechanism.robot, state, moving))["primary"]


def _length(value: Any) -> int:
    """Of the last axis; 0 for what is no array."""
    try:
        return int(np.shape(value)[-1])
    except (ValueError, IndexError):
        return 0


def secondary_rates(
    mechanism: Mechanism, state: State, primary_rates: Any, on_singular: Literal["raise", "status"] = "raise"
) -> Any:
    """Rates (..., secondary) of the computed couplings from those of the imposed ones, by Davies' method.

    Args:
        mechanism: from ``closed_mechanism``.
        state: a closed state.
        primary_rates: (..., primary), in ``mechanism.primary`` order [rad/s, m/s].
        on_singular: ``"raise"``, or ``"status"`` to get (rates, status (...,)) with ``Status.SINGULAR``
            marking samples solved by least squares. Traced JAX arrays cannot raise: use ``"status"`` there.

    Raises:
        SingularError: a limb is singular; names limb, sample and cause.

    Source: paper A, eq. 10-11.
    """
    primary = checked("primary_rates", primary_rates, len(mechanism.primary))
    if on_singular not in ("raise", "status"):
        raise InputError(f"on_singular is {on_singular!r}; valid: raise, status")
    arrays = told(mechanism.robot, state)
    T, q = arrays["T_world_base"], arrays["q"]
    one_batch({"state.T_world_base": (T, 2), "state.q": (q, 1), "primary_rates": (primary, 1)})
    solution = rates.secondary_rates(mechanism, T, q, primary)
    if on_singular == "status":
        return solution.values, _status(solution.singular.any(axis=-1), solution.values.shape[:-1])
    refuse_singular(mechanism, T, q, solution.singular)
    return solution.values


def _status(singular: Any, batch: tuple[int, ...]) -> Array:
    """Status (...,) of every sample, also where only the motion has a batch."""
    if is_jax(singular):
        import jax.numpy as jnp

        status = jnp.where(singular, int(Status.SINGULAR), int(Status.CONVERGED))
        shaped: Any = jnp.broadcast_to(status, batch)
        return shaped
    return np.broadcast_to(np.where(singular, Status.SINGULAR, Status.CONVERGED), batch).astype(int)
