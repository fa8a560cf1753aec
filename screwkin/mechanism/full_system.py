"""Motions and actions in one system: what friction, springs and losses of gears tie together.

Davies' two laws are N q' = 0 and A x + loads = 0. Friction couples them, its effort being -c q'; so either
the rates or the efforts of the drives may be imposed, and one solve yields all the others. Inertia takes no
part: the motion is slow.

Source: Davies (1983), Mechanical networks III; Davies (2006), Freedom and constraint in coupling networks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, NoSolutionError, SingularError, expect, one_of
from screwkin.kinematics.arrays import checked
from screwkin.mechanism.action_choice import unit_wrenches, weighed_actions, with_efforts
from screwkin.mechanism.actions import ActionSystem, action_system
from screwkin.mechanism.choice import RANK_TOLERANCE
from screwkin.mechanism.loads import loads_on_links, sorted_loads
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.quantities import network_matrix
from screwkin.mechanism.scaling import characteristic_length, referenced
from screwkin.mechanism.statics import BALANCED, refuse_hanging, weighed_loads
from screwkin.model.robot import Robot
from screwkin.model.state import State

RESTING = 1e-12
"""Power relative to the largest below which a gear neither drives nor is driven."""


@dataclass(frozen=True)
class Resistance:
    """What acts along the screws of joints without a motor; by the name of a joint, also a coupled one.

    Attributes:
        damping: viscous friction c, effort -c q' [N m s/rad or N s/m].
        springs: (k, q0), effort -k (q - q0) [N m/rad or N/m; rad or m].
        efficiency: of the gear of a coupled joint, in (0, 1]: share of the power that goes through.
    """

    damping: Mapping[str, float]
    springs: Mapping[str, tuple[float, float]]
    efficiency: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class MotionsAndActions:
    """Rates of all couplings and magnitudes of all actions, by name.

    Attributes:
        rates: of the couplings [rad/s or m/s].
        actions: magnitudes [N m or N], as ``StaticForces`` has them.
        friction: efforts of dampers, by joint.
        springs: efforts of springs, by joint.
        undecided: names of the actions that are one choice of many, that of least squares.
        losses: power that friction and gears take [W].
    """

    rates: dict[str, float]
    actions: dict[str, float]
    friction: dict[str, float]
    springs: dict[str, float]
    undecided: tuple[str, ...]
    losses: float


def motions_and_actions(
    mechanism: Mechanism,
    state: State,
    rates: Mapping[str, float] | None = None,
    imposed: Mapping[str, float] | None = None,
    *,
    damping: Mapping[str, float] | None = None,
    springs: Mapping[str, tuple[float, float]] | None = None,
    efficiency: Mapping[str, float] | None = None,
    loads: Mapping[str, Any] | None = None,
    weights: bool = False,
    active: Sequence[str] | None = None,
    contacts: Sequence[str] | None = None,
) -> MotionsAndActions:
    """Rates and actions of a slow mechanism with friction, springs and lossy gears, in one solve.

    Args:
        mechanism: from ``closed_mechanism``; its choice of primary couplings does not matter here.
        state: one sample, closed.
        rates: of couplings that are imposed [rad/s or m/s].
        imposed: magnitudes of actions that are imposed [N m or N].
        damping: viscous friction by joint.
        springs: (stiffness, rest position) by joint.
        efficiency: of gears, by coupled joint.
        loads: as for ``static_forces``.
        weights: add the weights of all links.
        active: names of the joints with an effort; default as for ``action_matrix``.
        contacts: as for ``action_matrix``.

    Returns:
        MotionsAndActions.

    Raises:
        UnknownNameError: no such coupling, action or joint. InputError: a negative damping or stiffness, an
            efficiency outside (0, 1], rates against the loops.
        SingularError: a motion that nothing decides, or loads that nothing balances; names couplings.
        NoSolutionError: a gear that locks: driven backwards, it takes more power than there is.
    """
    expect(mechanism, Mechanism, "mechanism", "closed_mechanism(robot)")
    expect(state, State, "state", "State(T_world_base, q)")
    robot = mechanism.robot
    resistance = _resistance(robot, damping or {}, springs or {}, efficiency or {})
    bodily, given = sorted_loads(robot, loads or {})
    efforts = {name: float(checked(name, x)) for name, x in (given | dict(imposed or {})).items()}
    system = with_efforts(mechanism, list(efforts), active, contacts)
    refuse_hanging(robot, system)
    for name in efforts:
        one_of("action", name, system.names)
    problem = _Problem(mechanism, state, system, resistance, bodily, weights)
    start, free = _motions(mechanism, state, rates or {})
    return _solved(problem, start, free, efforts)


def _resistance(
    robot: Robot,
    damping: Mapping[str, float],
    springs: Mapping[str, tuple[float, float]],
    efficiency: Mapping[str, float],
) -> Resistance:
    joints, gears = [joint.name for joint in robot.tree], [joint.name for joint in robot.coupled]
    for name, c in damping.items():
        if not float(checked(f"damping[{one_of('joint', name, joints)!r}]", c)) >= 0:
            raise InputError(f"damping[{name!r}] is {c}; friction takes power, so it is not negative")
    for name, pair in springs.items():
        k, _ = checked(f"springs[{one_of('joint', name, joints)!r}]", pair, 2)
        if k < 0:
            raise InputError(f"springs[{name!r}] has stiffness {k}; it is not negative")
    for name, eta in efficiency.items():
        if name not in gears:
            one_of("coupled joint", name, gears or ["(none: the robot has no coupled joints)"])
        if not 0 < float(checked(f"efficiency[{name!r}]", eta)) <= 1:
            raise InputError(f"efficiency[{name!r}] is {eta}; it is above 0 and at most 1")
    return Resistance(damping, springs, efficiency)


class _Problem:
    """The rows of the equilibrium, without units."""

    def __init__(
        self,
        mechanism: Mechanism,
        state: State,
        system: ActionSystem,
        resistance: Resistance,
        bodily: Mapping[str, Array],
        weights: bool,
    ) -> None:
        robot = mechanism.robot
        self.mechanism, self.system, self.resistance = mechanism, system, resistance
        W = unit_wrenches(mechanism, system, state)
        self.A, self.unit, point = weighed_actions(mechanism, system, state, W)
        whole = action_system(mechanism, robot.joint_names, system.contacts)
        every, unit, _ = weighed_actions(mechanism, whole, state, unit_wrenches(mechanism, whole, state))
        names = whole.names
        columns = {name: (every / unit)[:, names.index(name)] for name in whole.active}
        for joint in robot.coupled:
            k = whole.names.index(joint.name)
            columns[joint.name] = every[:, k] / unit[k] + joint.ratio * columns[joint.leader]
        self.efforts = columns
        external = loads_on_links(robot, state, system, bodily, weights)
        self.b = -weighed_loads(system, external, point, characteristic_length(robot))
        position = dict(zip(robot.joint_names, np.asarray(state.q), strict=True))
        for joint in robot.coupled:
            position[joint.name] = joint.ratio * position[joint.leader] + joint.offset
        self.spring = {name: -k * (position[name] - q0) for name, (k, q0) in resistance.springs.items()}
        for name, effort in self.spring.items():
            self.b = self.b - columns[name] * effort

    def rates_of(self, rates: Array) -> dict[str, Array]:
        """Rates of all joints (...,) from those of the couplings (..., couplings)."""
        m = self.mechanism
        every = rates @ m.gears.T
        return {joint.name: every[..., m.position[joint.name]] for joint in m.robot.tree}

    def dragged(self, rates: Array) -> Array:
        """Rows (..., rows) of the dampers' efforts."""
        speeds, total = self.rates_of(rates), np.zeros((*rates.shape[:-1], len(self.b)))
        for name, c in self.resistance.damping.items():
            total = total - c * speeds[name][..., None] * self.efforts[name]
        return total

    def geared(self, losses: Mapping[str, float]) -> Array:
        """A, in which the leader of a lossy gear supplies so many times the power that goes through."""
        A = self.A.copy()
        for joint in self.mechanism.robot.coupled:
            k = self.system.names.index(joint.name)
            more = losses.get(joint.name, 1.0) - 1.0
            A[:, k] = A[:, k] - joint.ratio * more * self.efforts[joint.leader] * self.unit[k]
        return A


def _motions(mechanism: Mechanism, state: State, rates: Mapping[str, float]) -> tuple[Array, Array]:
    """Rates (couplings,) that close the loops with those imposed, and a basis (k, couplings) of the rest."""
    for name in rates:
        one_of("coupling", name, mechanism.couplings)
    N = referenced(mechanism, network_matrix(mechanism, state))
    _, sigma, V = np.linalg.svd(N)
    count = int((sigma > RANK_TOLERANCE * sigma[:1]).sum())
    basis = V[count:] if len(N) else np.eye(len(mechanism.couplings))
    columns = [mechanism.position[name] for name in rates]
    wanted = np.array([float(checked(f"rates[{name!r}]", x)) for name, x in rates.items()])
    imposed = basis[:, columns].T
    share = np.linalg.lstsq(imposed, wanted, rcond=RANK_TOLERANCE)[0] if columns else np.zeros(len(basis))
    if columns and np.abs(imposed @ share - wanted).max() > 1e-9 * max(1.0, np.abs(wanted).max()):
        raise InputError(f"the loops do not admit these rates together: {', '.join(rates)}; impose fewer")
    _, sigma, V = np.linalg.svd(imposed) if columns else (None, np.zeros(0), np.eye(len(basis)))
    left = V[int((sigma > RANK_TOLERANCE).sum()) :]
    return share @ basis, left @ basis


def _solved(problem: _Problem, start: Array, free: Array, efforts: Mapping[str, float]) -> MotionsAndActions:
    """The solution; gears are tried as driving first, then as what their power says."""
    driving: dict[str, float] = {}
    eta = problem.resistance.efficiency
    for _ in range(2 ** len(eta) + 1):
        rates, x, undecided = _linear(problem, problem.geared(driving), start, free, efforts)
        speeds = problem.rates_of(rates)
        through = {name: x[problem.system.names.index(name)] * float(speeds[name]) for name in eta}
        largest = max((abs(p) for p in through.values()), default=0.0)
        wanted = {
            name: 1.0 if abs(p) <= RESTING * largest else 1 / eta[name] if p > 0 else eta[name]
            for name, p in through.items()
        }
        if wanted == driving or not eta:
            return _named(problem, rates, x, undecided, driving)
        driving = wanted
    raise NoSolutionError(
        f"the gears of {', '.join(eta)} lock: no direction of power agrees with their losses"
    )


def _linear(
    problem: _Problem, A: Array, start: Array, free: Array, efforts: Mapping[str, float]
) -> tuple[Array, Array, tuple[str, ...]]:
    """Rates, actions and the names of undecided ones, for gears of given losses."""
    system, names = problem.system, problem.system.names
    columns = [names.index(name) for name in efforts]
    others = [a for a in range(len(names)) if a not in columns]
    fixed = np.array([efforts[name] for name in efforts]) / problem.unit[columns]
    right = problem.b - problem.dragged(start) - A[:, columns] @ fixed
    M = np.concatenate([problem.dragged(free).T, A[:, others]], axis=1)
    size = np.linalg.norm(M, axis=0)
    size = np.where(size > 0, size, 1.0)
    U, sigma, V = np.linalg.svd(M / size, full_matrices=False)
    V, U = V[sigma > RANK_TOLERANCE * sigma[:1]], U[:, sigma > RANK_TOLERANCE * sigma[:1]]
    z = V.T @ ((U.T @ right) / sigma[: len(V)]) / size
    rest = M @ z - right
    if np.abs(rest).max(initial=0) > BALANCED * max(np.abs(right).max(initial=0), 1e-300):
        motion = np.abs(np.einsum("ie,ik->ek", system.cut_sets, rest.reshape(-1, 6))).max(axis=1)
        moving = [name for name, m in zip(system.edges, motion, strict=True) if m > 1e-3 * motion.max()]
        raise SingularError(
            f"nothing balances the loads: they move {', '.join(moving)}; impose a rate of one of them, or "
            "let it be active or damped"
        )
    open_ones = 1 - (V**2).sum(axis=0) > 1e-9
    count = len(free)
    if open_ones[:count].any():
        size = np.abs(free[open_ones[:count]]).max(axis=0)
        moving = [n for n, x in zip(problem.mechanism.couplings, size, strict=True) if x > 1e-3]
        raise SingularError(
            f"nothing decides the motion of {', '.join(moving)}: impose a rate, or damp one of them"
        )
    x = np.zeros(len(names))
    x[columns], x[others] = fixed, z[count:]
    undecided = tuple(names[a] for a, is_open in zip(others, open_ones[count:], strict=True) if is_open)
    return start + z[:count] @ free, x * problem.unit, undecided


def _named(
    problem: _Problem, rates: Array, x: Array, undecided: tuple[str, ...], driving: Mapping[str, float]
) -> MotionsAndActions:
    speeds, names = problem.rates_of(rates), problem.system.names
    friction = {name: -c * float(speeds[name]) for name, c in problem.resistance.damping.items()}
    losses = -sum(effort * float(speeds[name]) for name, effort in friction.items())
    for name, factor in driving.items():
        losses += (factor - 1) * x[names.index(name)] * float(speeds[name])
    return MotionsAndActions(
        dict(zip(problem.mechanism.couplings, map(float, rates), strict=True)),
        dict(zip(names, map(float, x), strict=True)),
        friction,
        {name: float(effort) for name, effort in problem.spring.items()},
        undecided,
        float(losses),
    )
