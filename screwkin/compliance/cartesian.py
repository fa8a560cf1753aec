"""How stiff a frame of an elastic robot is, where it stands under its loads.

The loaded equilibrium is moved by a small wrench F at the frame: C = J (P H P)^-1 J^T over the motions that
supports and loops leave, with H of springs, weight, loads and constraints (see ``balance``). Passive joints
without a spring make C infinite in some directions, where K = C^-1 is zero; so K is computed with a spring S
added at the frame, and S subtracted from the result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compliance.balance import ElasticBalance
from screwkin.compliance.equilibrium import balances, resting_deflections
from screwkin.compliance.laws import Spring
from screwkin.compliance.springs import SpringChoice
from screwkin.compliance.stiffness import loaded_robot
from screwkin.errors import SingularError
from screwkin.kinematics.mass import GRAVITY
from screwkin.model.robot import Robot
from screwkin.model.state import State

RIGID = 1e-12
"""Least eigenvalue of a frame's mobility, without units and over the largest, from which it is not rigid."""


def cartesian_compliance(
    robot: Robot,
    state: State,
    support: str | Sequence[str],
    frame: str,
    stiffness: SpringChoice = None,
    gravity: float = GRAVITY,
    *,
    loads: Mapping[str, Any] | None = None,
    springs: Mapping[str, Spring] | None = None,
) -> Array:
    """Cartesian compliance (..., 6, 6) of a frame at the loaded equilibrium, twist per wrench.

    Arguments and frames as of ``cartesian_stiffness``, whose inverse it is; also of a frame that is rigid in
    some direction.

    Raises:
        SingularError: joints without springs leave some motion free, or the equilibrium is unstable.
        InputError, ShapeError, UnknownNameError, NoSolutionError: as for ``cartesian_stiffness``.
    """
    loaded, _, batch = loaded_robot(robot, state, support, stiffness, gravity, loads, springs)
    theta, stable = resting_deflections(loaded)
    C = np.empty((len(loaded.q), 6, 6))
    for rows, here in balances(loaded, theta):
        free = np.flatnonzero(~stable[rows])
        if len(free):
            raise SingularError(
                f"sample {rows[free[0]]}: {robot.name} moves freely in some direction, or is unstable, so "
                f"that {frame} has no compliance; give its joints springs, or use the stiffness",
                sample=int(rows[free[0]]),
            )
        B = here.columns(frame)
        C[rows] = B @ np.linalg.solve(here.left, B.swapaxes(1, 2))
    return C.reshape(*batch, 6, 6)


def cartesian_stiffness(
    robot: Robot,
    state: State,
    support: str | Sequence[str],
    frame: str,
    stiffness: SpringChoice = None,
    gravity: float = GRAVITY,
    *,
    loads: Mapping[str, Any] | None = None,
    springs: Mapping[str, Spring] | None = None,
) -> Array:
    """Cartesian stiffness of a frame at the loaded equilibrium, while other frames stand still.

    Args:
        robot: n joints.
        state: the commanded configuration, T_world_base (..., 4, 4) and q (..., n), closed.
        support: the frame that stands still, or several, such as both feet.
        frame: the frame that a small wrench moves: a tip, a link, or ``base``.
        stiffness: of the joints [N m/rad or N/m], as for ``static_deflection``, like all that follows. Joints
            without springs are no hindrance: the frame yields freely in some directions.
        gravity: [m/s^2]; 0, without loads, for (J K^-1 J^T)^-1 of the posture that is commanded.
        loads: what acts already [N m, N].
        springs: laws of springs whose stiffness changes.

    Returns:
        Stiffness (..., 6, 6), rows wrench [m; f] in N m and N, columns twist [omega; v] in rad and m, world
        axes, at the frame's origin. It is symmetric unless a moment loads the robot.

    Raises:
        SingularError: the frame is rigid in some direction, as with a straight leg or no leg between.
        NoSolutionError: there is no equilibrium.
        InputError, ShapeError, UnknownNameError: as for ``static_deflection``.

    Example:
        >>> import numpy as np, screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> feet = [limb.tip for limb in robot.limbs if limb.kind == "leg"]
        >>> K = sk.cartesian_stiffness(robot, sk.home(robot), feet, "base", 20.0)
        >>> bool(np.allclose(K, K.T)), bool(np.linalg.eigvalsh(K)[0] > 0)
        (True, True)

    Source: paper B, eq. 15; Klimchik, Chablat and Pashkevich (2014).
    """
    loaded, _, batch = loaded_robot(robot, state, support, stiffness, gravity, loads, springs)
    theta, _ = resting_deflections(loaded)
    K = np.empty((len(loaded.q), 6, 6))
    for rows, here in balances(loaded, theta):
        B = here.columns(frame)
        mobility = B @ B.swapaxes(1, 2)
        scale = 1 / np.sqrt(np.maximum(np.diagonal(mobility, axis1=1, axis2=2), 1e-300))
        values = np.linalg.eigvalsh(mobility * scale[:, :, None] * scale[:, None, :])
        rigid = np.flatnonzero(values[:, 0] < RIGID)
        if len(rigid):
            raise SingularError(
                f"sample {rows[rigid[0]]}: {frame} on {support} is rigid in some direction, so that it has "
                "no stiffness matrix; bend the limb, or use the compliance",
                sample=int(rows[rigid[0]]),
            )
        K[rows] = _without(here, B, scale**2)
    return K.reshape(*batch, 6, 6)


def _without(here: ElasticBalance, B: Array, spring: Array) -> Array:
    """Stiffness (A, 6, 6) at a frame of columns B (A, 6, n): with a spring (A, 6) there, less the spring."""
    S, Bt = spring[:, :, None] * np.eye(6), B.swapaxes(1, 2)
    return np.asarray(np.linalg.inv(B @ np.linalg.solve(here.left + Bt @ S @ B, Bt)) - S)
