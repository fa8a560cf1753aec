"""The closed mechanism over arrays: network matrix, rates by Davies' method, whole-body positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, is_jax
from screwkin.algebra.se3 import ZERO, Pose, Twist, Vector, leaves
from screwkin.errors import InputError, expect
from screwkin.kinematics.arrays import checked_inputs
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Columns, Joints, TipTwists
from screwkin.kinematics.status import Status
from screwkin.mechanism import rates
from screwkin.mechanism.mechanism import WAIST, Mechanism
from screwkin.mechanism.network import coupling_twists, network_blocks
from screwkin.mechanism.secondary import formula_blocks, secondary_arguments
from screwkin.mechanism.singularity import refuse_singular
from screwkin.mechanism.virtual_motion import imposing_chains, primary_motion
from screwkin.model.state import State


@formula
def network_matrix(
    mechanism: Mechanism, T_world_base: Pose, q: Joints, point: Vector | None = None
) -> Columns:
    """Davies' network matrix N of the closed mechanism: N q' = 0 for the rates of all couplings.

    Args:
        mechanism: from ``closed_mechanism``; its ``couplings`` name the columns.
        state: closed, where the mechanism has loops of its own.
        point: world point [m] at which the screws are expressed; default: the base origin, which travels with
            the robot. A far point spoils the conditioning.

    Returns:
        N (..., 6 circuits, couplings), world axes, rows [omega; v at the point] of every circuit.

    Raises:
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[1])
        >>> sk.network_matrix(sk.closed_mechanism(robot), sk.home(robot)).shape
        (24, 54)

    Source: paper A, eq. 8-9.
    """
    at = ZERO if point is None else point - T_world_base.p
    blocks = network_blocks(mechanism, coupling_twists(mechanism, T_world_base, q, at))
    columns = range(len(mechanism.couplings))
    return [[x for circuit in blocks for x in leaves(circuit[c])] for c in columns]


@formula
def virtual_motion(
    mechanism: Mechanism, T_world_base: Pose, q: Joints, base_twist: Twist | None, tip_twists: TipTwists
) -> list[Scalar]:
    """Rates of the primary virtual couplings that give base and tips their twists.

    Args:
        mechanism: its primary couplings must all belong to virtual chains.
        state: the present state.
        base_twist: [omega; v of the base origin], world axes; without effect on a fixed base.
        tip_twists: for every tip with primary couplings [omega; v of the tip's origin], or v alone (..., 3)
            where only translations are primary; likewise for every further chain, of its end relative to its
            start, at the end's origin.

    Returns:
        (..., primary) in ``mechanism.primary`` order [rad/s, m/s].

    Raises:
        InputError: a real joint is primary, or a tip's twist is missing or has no rotation.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> rest = {tip: np.zeros(6) for tip in robot.tip_names}
        >>> rates = sk.virtual_motion(sk.closed_mechanism(robot), sk.home(robot), [0, 0, 0, 0.1, 0, 0], rest)
        >>> float(abs(rates).sum())                 # the waist slides along x at 0.1 m/s, the tips rest
        0.1

    Source: paper A, eq. 7.
    """
    given = {} if base_twist is None else {WAIST: base_twist}
    given |= tip_twists
    chains = imposing_chains(mechanism)
    for chain in chains:
        wanted = [name for name in chain.names if name in mechanism.primary]
        if chain.name not in given:
            absent = "base_twist is None" if chain.name == WAIST else f"tip_twists has no {chain.name}"
            raise InputError(f"{absent}, but {', '.join(wanted)} are primary")
        turning = any(name.split(".")[1][0] == "r" for name in wanted)
        if given[chain.name].omega is ZERO and turning:
            raise InputError(f"the twist of {chain.name} has 3 components, but its rotations are primary")
    virtually = {name for chain in chains for name in chain.names}
    real = [name for name in mechanism.primary if name not in virtually]
    if real:
        raise InputError(
            f"primary couplings {', '.join(real)} belong to no virtual chain; give their rates directly"
        )
    motion = primary_motion(mechanism, T_world_base, q, given)
    return [motion[name] for name in mechanism.primary]


def secondary_rates(
    mechanism: Mechanism, state: State, primary_rates: Any, on_singular: Literal["raise", "status"] = "raise"
) -> Array | tuple[Array, Array]:
    """Rates of the secondary couplings from those of the primary ones, by Davies' method.

    Args:
        mechanism: from ``closed_mechanism``.
        state: T_world_base (..., 4, 4) and q (..., n), closed.
        primary_rates: (..., primary), in ``mechanism.primary`` order [rad/s, m/s].
        on_singular: ``"raise"``, or ``"status"`` to get (rates, status (...,)) with ``Status.SINGULAR``
            marking samples solved by least squares. Traced JAX arrays cannot raise: use ``"status"`` there.

    Returns:
        (..., secondary), in ``mechanism.secondary`` order [rad/s, m/s].

    Raises:
        SingularError: a limb is singular; names limb, sample and cause.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> mechanism = sk.closed_mechanism(sk.load_robot(sk.robot_names()[0]))
        >>> rates = sk.secondary_rates(mechanism, sk.home(mechanism.robot), np.zeros(24))
        >>> rates.shape, float(abs(rates).max())
        ((24,), 0.0)

    Source: paper A, eq. 10-11.
    """
    if on_singular not in ("raise", "status"):
        raise InputError(f"on_singular is {on_singular!r}; valid: raise, status")
    expect(mechanism, Mechanism, "mechanism", "closed_mechanism(robot)")
    expect(state, State, "state", "State(T_world_base, q)")
    arrays: Sequence[Any] = (state.T_world_base, state.q, primary_rates)
    if not formula_blocks(mechanism) or not all(type(x) is np.ndarray for x in arrays):
        arguments = secondary_arguments(mechanism.robot, mechanism.primary)
        arrays, _ = checked_inputs(arguments, arrays)
    T, q, primary = arrays
    solution = rates.solve_rates(mechanism, T, q, primary)
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
