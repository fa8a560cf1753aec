"""Statics by Davies' method: actions of all couplings in equilibrium with loads anywhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError, SingularError, expect, one_of
from screwkin.kinematics.arrays import checked
from screwkin.mechanism.action_choice import (
    check_imposed,
    imposed_names,
    unit_wrenches,
    weighed_actions,
    with_efforts,
)
from screwkin.mechanism.actions import ActionSystem
from screwkin.mechanism.choice import RANK_TOLERANCE
from screwkin.mechanism.loads import loads_on_links, sorted_loads
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.rates import least_squares
from screwkin.mechanism.scaling import characteristic_length
from screwkin.model.robot import Robot
from screwkin.model.state import State

BALANCED = 1e-7
"""Largest rest of the equilibrium, relative to the loads, lengths in sizes of the robot."""
DECIDED = 1e-9
"""Share of an action's unit vector in the null space of A below which equilibrium alone decides it."""


@dataclass(frozen=True, eq=False)
class StaticForces:
    """Actions in equilibrium.

    Attributes:
        system: the actions and their couplings.
        values: magnitudes (..., actions) [N m or N], in the order of ``names``.
        wrenches: of every coupling (..., couplings, 6), in the order of ``couplings``: [m about the world's
            origin; f], world axes, exerted by the carrying link on the carried one, by the floor on a tip.
        decided: (..., actions) bool: equilibrium alone decides the magnitude; else it is one choice of many,
            the one of least squares, with moments divided by the robot's size.
        residual: (...) what is left of the equilibrium, relative to the loads.
    """

    system: ActionSystem
    values: Array
    wrenches: Array
    decided: Array
    residual: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the actions."""
        return self.system.names

    @property
    def couplings(self) -> tuple[str, ...]:
        """Names of the couplings: joints, then contacts."""
        return self.system.edges

    @cached_property
    def efforts(self) -> dict[str, Array]:
        """Effort (...) of every coupling with a motor, by name [N m or N]."""
        return {name: self[name] for name in self.system.active}

    def wrench(self, coupling: str) -> Array:
        """Wrench (..., 6) of one coupling, as in ``wrenches``."""
        k = self.couplings.index(one_of("coupling", coupling, self.couplings))
        return self.wrenches[..., k, :]

    def force(self, coupling: str) -> Array:
        """Force (..., 3) that one coupling transmits, world axes [N]."""
        return self.wrench(coupling)[..., 3:]

    def __getitem__(self, action: str) -> Array:
        """Magnitude (...) of one action."""
        value: Array = self.values[..., self.names.index(one_of("action", action, self.names))]
        return value


def static_forces(
    mechanism: Mechanism,
    state: State,
    loads: Mapping[str, Any] | None = None,
    imposed: Mapping[str, Any] | None = None,
    *,
    weights: bool = False,
    active: Sequence[str] | None = None,
    contacts: Sequence[str] | None = None,
) -> StaticForces:
    """Efforts, pin forces and contact wrenches that balance loads, by Davies' cut-set law.

    Args:
        mechanism: from ``closed_mechanism``.
        state: T_world_base (..., 4, 4) and q (..., n), closed.
        loads: by name of a link, tip or frame: a force (..., 3) at its origin [N], or a wrench (..., 6)
            [m about the world's origin; f], world axes. By name of a joint: an effort (...) that it exerts on
            the link which it carries [N m or N], as with ``imposed``.
        imposed: magnitude (...) of primary actions, by name: a motor's effort, the squeeze of a grip.
        weights: add the weights of all links.
        active: names of the joints with an effort; default as for ``action_matrix``.
        contacts: names of tips on the floor and of held closures; default as for ``action_matrix``.

    Returns:
        StaticForces. Where equilibrium leaves actions undecided (redundant constraints, two feet on the
        floor) they are those of least squares, and marked.

    Raises:
        UnknownNameError: no such link, tip, joint or action.
        InputError: imposed actions that equilibrium decides already, or a base that nothing supports.
        SingularError: no actions balance the loads; names the joints that would move.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import screwkin as sk
        >>> mechanism = sk.closed_mechanism(sk.load_robot("linkages/four-bar"))
        >>> forces = sk.static_forces(mechanism, sk.home(mechanism.robot), {"rocker": 10})   # N m
        >>> f"{forces['crank']:.4f} N m"
        '-2.4088 N m'

    Source: Davies (1983), Mechanical networks III; Davies (2006), Freedom and constraint.
    """
    expect(mechanism, Mechanism, "mechanism", "closed_mechanism(robot)")
    expect(state, State, "state", "State(T_world_base, q)")
    robot = mechanism.robot
    bodily, efforts = sorted_loads(robot, loads or {})
    efforts |= {name: checked(f"imposed[{name!r}]", value) for name, value in (imposed or {}).items()}
    system = with_efforts(mechanism, list(efforts), active, contacts)
    names = imposed_names(system, list(efforts))
    refuse_hanging(robot, system)
    check_imposed(mechanism, system, names)
    W = unit_wrenches(mechanism, system, state)
    A, unit, point = weighed_actions(mechanism, system, state, W)
    external = loads_on_links(robot, state, system, bodily, weights)
    b = -weighed_loads(system, external, point, characteristic_length(robot))
    x, decided = solve_actions(
        A, b, [system.names.index(n) for n in names], [efforts[n] for n in names], unit
    )
    residual = _residual(A, x, b)
    if not is_jax(residual) and (residual > BALANCED).any():
        raise SingularError(_unbalanced(system, A, x, b, residual))
    values = x * unit
    return StaticForces(system, values, coupling_wrenches(system, W, values, state), decided, residual)


def refuse_hanging(robot: Robot, system: ActionSystem) -> None:
    """Raise an InputError for a floating base that nothing supports."""
    if not system.held:
        raise InputError(
            f"{robot.name} has a floating base and nothing supports it; name tips on the floor or held "
            f"closures in contacts, such as {', '.join(robot.tip_names) or 'a closure'}"
        )


def weighed_loads(system: ActionSystem, external: Array, point: Array, length: float) -> Array:
    """Rows (..., 6 cut-sets) of loads (..., vertices, 6), in the units of ``weighed_actions``."""
    xp = numpy_of(external, point)
    f = external[..., 3:]
    m = (external[..., :3] - xp.cross(point[..., None, :], f)) / length
    both = xp.concatenate([m, xp.broadcast_to(f, m.shape)], axis=-1)
    rows: Array = xp.matmul(system.load_cut_sets.astype(float), both)
    return rows.reshape(*rows.shape[:-2], -1)


def solve_actions(
    A: Array, b: Array, columns: Sequence[int], fixed: Sequence[Array], unit: Array
) -> tuple[Array, Array]:
    """x (..., actions) of least squares with A x = b and some components given, and which are decided.

    Args:
        A: (..., rows, actions) and
        b: (..., rows), both without units.
        columns: of the components that are given.
        fixed: their values (...), with units.
        unit: of every component (actions,).
    """
    xp, count = numpy_of(A, b, *fixed), A.shape[-1]
    others = [a for a in range(count) if a not in columns]
    batch = np.broadcast_shapes(A.shape[:-2], b.shape[:-1], *map(np.shape, fixed))
    given = xp.zeros((*batch, 0))
    if fixed:
        given = xp.stack([xp.broadcast_to(x, batch) for x in fixed], axis=-1) / unit[list(columns)]
    rest = xp.broadcast_to(b, (*batch, b.shape[-1])) - (A[..., list(columns)] @ given[..., None])[..., 0]
    free = A[..., others]
    if is_jax(free) or is_jax(rest):
        inverse = xp.linalg.pinv(free, rtol=RANK_TOLERANCE)
        x, null = (inverse @ rest[..., None])[..., 0], np.eye(len(others)) - inverse @ free
        share = xp.diagonal(null, axis1=-2, axis2=-1)
    else:
        x, sigma, V = least_squares(np.broadcast_to(free, (*batch, *free.shape[-2:])), rest[..., None])
        regular = sigma > RANK_TOLERANCE * sigma[..., :1]
        x, share = x[..., 0], 1 - (V**2 * regular[..., None]).sum(axis=-2)
    order = np.argsort([*columns, *others])
    decided = xp.concatenate(
        [xp.ones(given.shape, dtype=bool), xp.broadcast_to(share < DECIDED, x.shape)], axis=-1
    )
    return xp.concatenate([given, x], axis=-1)[..., order], decided[..., order]


def coupling_wrenches(system: ActionSystem, W: Array, values: Array, state: State) -> Array:
    """Wrench (..., couplings, 6) of every coupling about the world's origin."""
    xp = numpy_of(W, values)
    actions, edges, factors = (np.array(x) for x in zip(*system.terms, strict=True))
    single = xp.swapaxes(W, -1, -2) * (values[..., actions] * factors)[..., None]
    total = xp.swapaxes(xp.swapaxes(single, -1, -2) @ np.eye(len(system.edges))[edges], -1, -2)
    base, f = state.T_world_base[..., None, :3, 3], total[..., 3:]
    m = total[..., :3] + xp.cross(base, f)
    return xp.concatenate([m, xp.broadcast_to(f, m.shape)], axis=-1)


def _residual(A: Array, x: Array, b: Array) -> Array:
    """What is left (...), relative to the loads and the largest action."""
    xp = numpy_of(A, x, b)
    rest = xp.abs((A @ x[..., None])[..., 0] - b).max(axis=-1)
    scale = xp.maximum(xp.abs(b).max(axis=-1), xp.abs(x).max(axis=-1))
    return rest / xp.where(scale > 0, scale, 1.0)


def _unbalanced(system: ActionSystem, A: Array, x: Array, b: Array, residual: Array) -> str:
    """Why the worst sample has no equilibrium: the rest is a virtual motion on which no action does work."""
    sample = np.unravel_index(int(residual.argmax()), residual.shape)
    rest = np.broadcast_to((A @ x[..., None])[..., 0] - b, (*residual.shape, b.shape[-1]))[sample]
    motion = np.abs(np.einsum("ie,ik->ek", system.cut_sets, rest.reshape(-1, 6))).max(axis=1)
    moving = [name for name, size in zip(system.edges, motion, strict=True) if size > 1e-3 * motion.max()]
    where = f" (sample {', '.join(map(str, sample))})" if sample else ""
    idle = [name for name in moving if name not in (*system.active, *system.contacts)]
    return f"no actions balance the loads{where}: nothing holds the motion of {', '.join(moving)}; " + (
        f"add the effort of one of them to active, such as {idle[0]}" if idle else "the posture is singular"
    )
