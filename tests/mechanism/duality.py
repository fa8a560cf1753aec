"""Power of the actions of a mechanism on its motions: zero where N and A are dual."""

from __future__ import annotations

from typing import Any

import numpy as np

import screwkin as sk
from screwkin.mechanism.actions import action_system
from screwkin.model.robot import Robot


def every_effort(mechanism: Any) -> Any:
    """All joints active, nothing on the floor but what is bolted there."""
    return action_system(mechanism, mechanism.robot.joint_names, ())


def null(matrix: Any) -> Any:
    """An orthonormal basis of the null space, as rows."""
    _, sigma, V = np.linalg.svd(matrix)
    return V[int((sigma > 1e-9 * sigma[0]).sum()) :]


def duality(robot: Robot) -> float:
    """Largest power of any self-stress and effort in equilibrium on any motion that the loops allow."""
    mechanism = sk.closed_mechanism(robot)
    system, home = every_effort(mechanism), sk.home(robot)
    A = sk.action_matrix(mechanism, home, robot.joint_names, ())
    motions, actions = null(sk.network_matrix(mechanism, home)), null(A)
    efforts = actions[:, [system.names.index(name) for name in robot.joint_names]]
    rates = motions[:, [mechanism.position[name] for name in robot.joint_names]]
    return float(np.abs(efforts @ rates.T).max(initial=0))
