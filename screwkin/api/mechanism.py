"""The closed mechanism over arrays: network matrix, rates by Davies' method, whole-body positions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from screwkin.api.arrays import Array, Told, checked, one_batch, rigid, told
from screwkin.api.body import home
from screwkin.errors import InputError, UnknownNameError
from screwkin.kernel import davies
from screwkin.kernel.pose import axes_of, solve_samples
from screwkin.kernel.run import pays
from screwkin.kernel.secondary import secondary_rates as kernel_rates
from screwkin.mechanism import network
from screwkin.mechanism import virtual_motion as virtual
from screwkin.mechanism.mechanism import Mechanism
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.scalar import is_jax
from screwkin.solve import rates
from screwkin.solve.pose import PoseSolution
from screwkin.solve.pose import solve_pose as newton_pose
from screwkin.solve.singularity import refuse_singular
from screwkin.solve.status import Status


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
    fast = _by_program(mechanism, state, primary)
    if fast is not None:
        values, singular = fast
        if on_singular == "status":
            return values, _status(singular, values.shape[:-1])
        if not singular.any():
            return values
    N = network_matrix(mechanism, state)
    solution = rates.secondary_rates(mechanism, N, primary)
    singular = solution.singular
    if on_singular == "status":
        return solution.values, _status(singular.any(axis=-1), solution.values.shape[:-1])
    refuse_singular(mechanism, N, solution)
    return solution.values


def _by_program(mechanism: Mechanism, state: State, primary: Array) -> tuple[Array, Array] | None:
    """Secondary rates by the kernel, and which samples are singular; None where no program pays."""
    arrays = told(mechanism.robot, state)
    T, q = arrays["T_world_base"], arrays["q"]
    if any(map(is_jax, (T, q, primary))):
        return None
    batch = one_batch({"state.T_world_base": (T, 2), "state.q": (q, 1), "primary_rates": (primary, 1)})
    choice = mechanism.primary, mechanism.secondary
    if not pays("secondary_rates", mechanism.robot, *choice, count=math.prod(batch)):
        return None
    flat = [
        np.broadcast_to(a, (*batch, *inner)).reshape(-1, *inner)
        for a, inner in ((T, T.shape[-2:]), (q, q.shape[-1:]), (primary, primary.shape[-1:]))
    ]
    found = kernel_rates(mechanism, *flat)
    if found is None:
        return None
    return found[0].reshape(*batch, len(mechanism.secondary)), found[1].reshape(batch)


def _status(singular: Array, batch: tuple[int, ...]) -> Array:
    """Status (...,) of every sample, also where only the motion has a batch."""
    if is_jax(singular):
        import jax.numpy as jnp

        status = jnp.where(singular, int(Status.SINGULAR), int(Status.CONVERGED))
        return jnp.broadcast_to(status, batch)
    return np.broadcast_to(np.where(singular, Status.SINGULAR, Status.CONVERGED), batch).astype(int)


def solve_pose(
    robot: Robot,
    targets: Mapping[str, Any],
    guess: State | None = None,
    method: Literal["auto", "newton"] = "auto",
) -> PoseSolution:
    """Joint positions that put base and tips where they are wanted, batched.

    Args:
        robot: the robot.
        targets: ``"base"`` (..., 4, 4) and tips by name: a pose (..., 4, 4), or a position (..., 3) with the
            orientation free; world frame.
        guess: a nearby state; default ``home``. Its base pose holds where ``"base"`` is not given.
        method: ``"newton"``, through the network matrix; ``"auto"``: for large batches the closed forms of
            the limbs, where they have some, of the solution nearest to the guess.

    Returns:
        PoseSolution with ``.state .status .residual .iterations`` (..., limbs). Nothing is raised for samples
        without solution; ``.raise_on_failure(robot)`` does.

    Raises:
        UnknownNameError: a target is no tip. ShapeError: wrong shape, NaN or infinity, or a pose
            that is not rigid.
    """
    if method not in ("auto", "newton"):
        raise InputError(f"method is {method!r}; valid: auto, newton")
    wanted = {}
    for name, value in targets.items():
        if name != "base" and name not in robot.tip_names:
            raise UnknownNameError("target", name, ("base", *robot.tip_names))
        pose = np.shape(value)[-2:] == (4, 4) or name == "base"
        told = f"targets[{name!r}]"
        wanted[name] = rigid(told, checked(told, value, 4, 4)) if pose else checked(told, value, 3)
    guess = home(robot) if guess is None else guess
    base = checked("guess.T_world_base", guess.T_world_base, 4, 4)
    base = base if "base" in wanted else rigid("guess.T_world_base", base)
    q = checked("guess.q", guess.q, len(robot.joints))
    named = {f"targets[{name!r}]": (a, axes_of(a)) for name, a in wanted.items()}
    one_batch(named | {"guess.T_world_base": (base, 2), "guess.q": (q, 1)})
    start = State(np.asarray(base, dtype=float), np.asarray(q, dtype=float))
    return (solve_samples if method == "auto" else newton_pose)(robot, wanted, start)
