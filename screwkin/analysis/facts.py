"""The facts of a robot: its size, and its closed mechanism at a posture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from screwkin.algebra.se3 import IDENTITY, ZERO, Vector, as_array
from screwkin.errors import UnreachableError, one_of
from screwkin.mechanism.choice import CLOSED, closed_mechanism, mechanism_imposing, mobility_at
from screwkin.mechanism.closure import close_loops
from screwkin.mechanism.linkages import motor_joints
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import coupling_twists, network_of_twists
from screwkin.mechanism.quantities import secondary_rates
from screwkin.mechanism.singularity import LimbSingularity, singularity_report
from screwkin.mechanism.virtual_chain import VirtualChain
from screwkin.model.coupled import coupling_of
from screwkin.model.robot import Robot
from screwkin.model.state import State, reference_base, reference_posture

STEPS = 12
"""In which a mechanism goes to imposed coordinates, so that it stays on its branch."""


@dataclass(frozen=True, eq=False)
class Facts:
    """Counts and conditioning of a robot's closed mechanism at its home posture."""

    robot: Robot
    mechanism: Mechanism
    actuated_joints: tuple[str, ...]
    rank: int
    condition: float
    """cond(N_s), N_s being the secondary columns of N; NaN for a robot without circuits."""
    state: State
    """Where the singular values are taken, the base at the world's origin."""
    limbs: tuple[LimbSingularity, ...]
    coordinates: Mapping[str, float]
    """Of all couplings, where chains are added [rad or m]."""
    rates: Mapping[str, float]
    """Of all couplings, where some are imposed [rad/s or m/s]."""

    @property
    def network_shape(self) -> tuple[int, int]:
        """Rows and columns of N."""
        return 6 * len(self.mechanism.circuit_matrix), len(self.mechanism.couplings)

    @property
    def mobility(self) -> int:
        """Couplings less the rank of N."""
        return len(self.mechanism.couplings) - self.rank

    def to_dict(self) -> dict[str, Any]:
        """The facts as JSON data."""
        mechanism = self.mechanism
        return {
            "robot": self.robot.name,
            "description": self.robot.description,
            "mass": float(self.robot.mass),
            "bodies": len(self.robot.links),
            "joints": len(self.robot.joints),
            "actuated_joints": len(self.actuated_joints),
            "coupled_joints": {joint.name: coupling_of(joint) for joint in self.robot.coupled},
            "couplings": len(mechanism.couplings),
            "links": len(mechanism.links),
            "circuits": len(mechanism.circuit_matrix),
            "mobility": self.mobility,
            "kutzbach": mechanism.kutzbach,
            "network_shape": list(self.network_shape),
            "secondary": list(mechanism.secondary),
            "primary": list(mechanism.primary),
            "rank": self.rank,
            "condition": self.condition,
            "singularity": [
                {key: value for key, value in asdict(limb).items() if key != "sample"} for limb in self.limbs
            ],
            **({"coordinates": dict(self.coordinates)} if self.coordinates else {}),
            **({"rates": dict(self.rates)} if self.rates else {}),
        }


def facts_of(
    robot: Robot,
    posture: str | None = None,
    place: Sequence[float] = (0.0, 0.0, 0.0),
    point: Sequence[float] | None = None,
    primary: Sequence[str] | None = None,
    imposed: Mapping[str, float] | None = None,
    chains: Sequence[VirtualChain] = (),
    rates: Mapping[str, float] | None = None,
) -> Facts:
    """The facts of a robot in a posture.

    Args:
        robot: humanoid or mechanism.
        posture: its name; default ``home``, else the first one, else all joints at zero.
        place: where its base stands in the world [m].
        point: world point [m] at which N is formed; default: the base origin, which travels with the robot.
        primary: names of the couplings to impose; default: those of ``closed_mechanism``.
        imposed: coordinates [rad or m] to which couplings go from the posture, the other primary ones at
            rest; of a real joint one that is primary by default.
        chains: further virtual chains.
        rates: of couplings [rad/s or m/s], the other primary ones at rest.

    Raises:
        UnknownNameError: no such posture or coupling. UnreachableError: the loops do not close there.
    """
    mechanism = closed_mechanism(robot, primary, chains)
    q = list(reference_posture(robot) if posture is None else robot.posture(posture).q)
    if imposed:
        q = _moved(robot, q, imposed, chains)
    about = ZERO if point is None else Vector(*point) - Vector(*place)
    at_waist, N = (
        network_of_twists(mechanism, coupling_twists(mechanism, IDENTITY, q, p)) for p in (ZERO, about)
    )
    state = State(np.eye(4), np.array(q, dtype=float))
    mobility = int(mobility_at(mechanism, at_waist)) if len(N) else len(mechanism.couplings)
    return Facts(
        robot=robot,
        mechanism=mechanism,
        actuated_joints=motor_joints(robot),
        rank=len(mechanism.couplings) - mobility,
        condition=_condition(N[:, mechanism.secondary_columns]),
        state=state,
        limbs=singularity_report(mechanism, state) if mechanism.secondary else (),
        coordinates=_coordinates(mechanism, state),
        rates=_rates(robot, state, rates, chains) if rates else {},
    )


def _coordinates(mechanism: Mechanism, state: State) -> dict[str, float]:
    """Of all couplings in a posture [rad or m]; none where no chain is added."""
    if not mechanism.added:
        return {}
    x = close_loops(mechanism, state, {}).coordinates
    return dict(zip(mechanism.couplings, map(float, x), strict=True))


def _rates(
    robot: Robot, state: State, imposed: Mapping[str, float], chains: Sequence[VirtualChain]
) -> dict[str, float]:
    """Rates of all couplings where some are imposed [rad/s or m/s]."""
    mechanism = mechanism_imposing(robot, tuple(imposed), chains)
    primary = np.array([imposed.get(name, 0.0) for name in mechanism.primary])
    following = secondary_rates(mechanism, state, primary)
    names = (*mechanism.primary, *mechanism.secondary)
    values = dict(zip(names, (*primary, *following), strict=True))
    return {name: float(values[name]) for name in mechanism.couplings}


def _moved(
    robot: Robot, q: Sequence[float], imposed: Mapping[str, float], chains: Sequence[VirtualChain]
) -> list[float]:
    """The posture to which couplings have gone from another one, in steps along which loops close."""
    mechanism = closed_mechanism(robot, chains=chains)
    added = {name for chain in mechanism.added for name in chain.names}
    if added & {*imposed}:
        mechanism = mechanism_imposing(robot, tuple(imposed), chains)
    base = reference_base(robot) if any(c.on_floor for c in robot.closures) else IDENTITY
    state = State(as_array(base).astype(float), np.array(q, dtype=float))
    start = dict(zip(mechanism.couplings, close_loops(mechanism, state, {}).coordinates, strict=True))
    for share in np.linspace(0, 1, STEPS + 1)[1:]:
        here = {
            name: (1 - share) * start[one_of("coupling", name, mechanism.couplings)] + share * x
            for name, x in imposed.items()
        }
        solution = close_loops(mechanism, state, here)
        if solution.residual > CLOSED:
            there = ", ".join(f"{name} = {x:.6g}" for name, x in here.items())
            raise UnreachableError(f"{robot.name}: the loops do not close at {there}; impose less")
        state = solution.state
    return [float(x) for x in state.q]


def _condition(Ns: Any) -> float:
    if min(Ns.shape) == 0:
        return float("nan")
    values = np.linalg.svd(Ns, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")
