"""Inverse kinematics of one limb over arrays."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.ik.branches import limb_solutions
from screwkin.ik.numeric import IkSettings, Method, solve_limb
from screwkin.ik.programs import solvable
from screwkin.ik.solutions import LimbSolutions
from screwkin.kinematics.arrays import checked, one_batch
from screwkin.kinematics.rigid import nearest_poses
from screwkin.kinematics.serial_chain import Chain
from screwkin.model.robot import Robot
from screwkin.model.state import RIGID


def limb_ik(
    robot: Robot,
    limb: str,
    T_base_tip: Any,
    method: Method = "auto",
    guess: Any = None,
    *,
    settings: IkSettings | None = None,
    least_squares: bool = True,
) -> LimbSolutions:
    """Joint positions of a limb that put its tip where it is wanted, batched.

    Args:
        robot: the robot.
        limb: name of a limb, or of its tip.
        T_base_tip: wanted poses of the tip in the base frame (..., 4, 4) [m]; or positions (..., 3) with the
            orientation free, for numeric methods.
        method: ``"closed"``, exact and with all branches, for limbs whose screw table allows it; numeric from
            the guess: ``"newton"``, ``"lm"`` (Levenberg-Marquardt), ``"dls"`` (damped least squares),
            ``"pinv"`` (pseudoinverse); ``"hybrid"``: numeric from the solution of a similar limb with a
            spherical hip; ``"auto"``: closed where possible, else newton.
        guess: positions (..., n) of the limb's joints [rad or m]; default: those of posture ``home``, without
            one the middle of the limits. Numeric methods start there, and branches near it come first.
        settings: tolerances, damping and the like of the numeric methods.
        least_squares: spend time on the nearest reachable pose where the closed form has no solution.

    Returns:
        LimbSolutions: ``.q`` (..., branches, n) best first, ``.valid .in_limits .residual .iterations``
        (..., branches), ``.status`` (...,), ``.best`` (..., n), ``.path()``. Nothing is raised for samples
        without solution; their first branch is the least-squares answer.

    Raises:
        UnknownNameError: no such limb.
        ShapeError: wrong shape, NaN or infinity.
        InputError: a pose that is none, an unknown method, or one that does not fit the limb; for
            ``"closed"`` the message tells what the limb's geometry lacks.
    """
    if method not in get_args(Method):
        raise InputError(f"method is {method!r}; valid: {', '.join(get_args(Method))}")
    chain = Chain.of(robot, limb)
    poses = np.shape(T_base_tip)[-2:] == (4, 4)
    target = np.asarray(checked("T_base_tip", T_base_tip, *((4, 4) if poses else (3,))), dtype=float)
    target = rigid(target) if poses else target
    around = 2 if poses else 1
    start = _default_guess(robot, chain) if guess is None else guess
    start = np.asarray(checked("guess", start, len(chain.names)), dtype=float)
    batch = one_batch({"T_base_tip": (target, around), "guess": (start, 1)})
    count = int(np.prod(batch))
    shape = target.shape[target.ndim - around :]
    flat = np.broadcast_to(target, (*batch, *shape)).reshape(count, *shape)
    flat_start = np.broadcast_to(start, (*batch, start.shape[-1])).reshape(count, start.shape[-1])
    closed = poses and (method == "closed" or (method == "auto" and solvable(robot, limb, True)))
    if closed:
        return limb_solutions(robot, chain.limb, flat, flat_start, batch, least_squares)
    return solve_limb(chain, flat, method, flat_start, settings or IkSettings(), batch, least_squares)


def rigid(T: Array) -> Array:
    """Poses (..., 4, 4) with their rotations made exact to the last digit.

    Raises:
        InputError: a matrix is no pose.
    """
    wrong, exact = nearest_poses(T)
    if wrong.size and wrong.max() > RIGID:
        sample = int(wrong.argmax())
        raise InputError(
            f"T_base_tip, sample {sample}, is no pose: its upper left 3 x 3 must be a rotation and its last "
            "row 0 0 0 1"
        )
    return exact


def _default_guess(robot: Robot, chain: Chain) -> Array:
    for posture in robot.postures:
        if posture.name == "home":
            return np.array(posture.q, dtype=float)[list(chain.joints)]
    lower, upper = (np.where(np.isfinite(limit), limit, 0.0) for limit in (chain.lower, chain.upper))
    return (lower + upper) / 2
