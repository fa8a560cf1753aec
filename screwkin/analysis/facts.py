"""The facts of a robot: its size, and its closed mechanism at a posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from screwkin.algebra.se3 import IDENTITY, ZERO, Vector
from screwkin.mechanism.choice import closed_mechanism, mobility_at
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import coupling_twists, network_of_twists
from screwkin.mechanism.singularity import LimbSingularity, singularity_report
from screwkin.model.coupled import coupling_of
from screwkin.model.robot import Robot
from screwkin.model.state import reference_posture


@dataclass(frozen=True, eq=False)
class Facts:
    """Counts and conditioning of a robot's closed mechanism at its home posture."""

    robot: Robot
    mechanism: Mechanism
    actuated_joints: tuple[str, ...]
    rank: int
    condition: float
    """cond(N_s), N_s being the secondary columns of N; NaN for a robot without circuits."""
    limbs: tuple[LimbSingularity, ...]

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
        }


def facts_of(
    robot: Robot,
    posture: str | None = None,
    place: Sequence[float] = (0.0, 0.0, 0.0),
    point: Sequence[float] | None = None,
) -> Facts:
    """The facts of a robot in a posture.

    Args:
        robot: humanoid or mechanism.
        posture: its name; default ``home``, else the first one, else all joints at zero.
        place: where its base stands in the world [m].
        point: world point [m] at which N is formed; default: the base origin, which travels with the robot.

    Raises:
        UnknownNameError: no such posture.
    """
    mechanism = closed_mechanism(robot)
    q = list(reference_posture(robot) if posture is None else robot.posture(posture).q)
    about = ZERO if point is None else Vector(*point) - Vector(*place)
    at_waist, N = (
        network_of_twists(mechanism, coupling_twists(mechanism, IDENTITY, q, p)) for p in (ZERO, about)
    )
    driven = set(mechanism.primary) if robot.closures else set(robot.joint_names)
    mobility = int(mobility_at(mechanism, at_waist)) if len(N) else len(mechanism.couplings)
    return Facts(
        robot=robot,
        mechanism=mechanism,
        actuated_joints=tuple(name for name in robot.joint_names if name in driven),
        rank=len(mechanism.couplings) - mobility,
        condition=_condition(N[:, mechanism.secondary_columns]),
        limbs=singularity_report(mechanism, at_waist) if mechanism.secondary else (),
    )


def _condition(Ns: Any) -> float:
    if min(Ns.shape) == 0:
        return float("nan")
    values = np.linalg.svd(Ns, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")
