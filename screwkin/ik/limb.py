"""Inverse kinematics of one limb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError, one_of
from screwkin.ik.linked import linked_chain, with_linkages
from screwkin.ik.methods import Method, solve_limb_arrays
from screwkin.ik.numeric import IkSettings
from screwkin.ik.solutions import LimbSolutions
from screwkin.ik.system import checked_free, refuse_free_in_jax
from screwkin.ik.tied import limb_chain
from screwkin.kinematics.arrays import of_shape
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.holds import joined_tips
from screwkin.mechanism.linkages import limb_linkages
from screwkin.model.robot import Robot, refuse_closures
from screwkin.model.sprung import refuse_sprung

DEFAULT = IkSettings()


def limb_ik(
    robot: Robot,
    limb: str,
    T_base_tip: Any,
    method: Method = "auto",
    guess: Any = None,
    *,
    settings: IkSettings | None = None,
    least_squares: bool = True,
    free: Sequence[str] = (),
) -> LimbSolutions:
    """Joint positions of a limb that put its tip where it is wanted, batched.

    Args:
        robot: the robot.
        limb: name of a limb, or of its tip.
        T_base_tip: wanted poses of the tip in the base frame (..., 4, 4) [m]; or positions (..., 3) with the
            orientation free.
        method: ``"closed"``, exact and with all branches, for limbs whose screw table allows it;
            ``"branches"``, all of them for four to six revolute joints of any geometry; numeric from the
            guess: ``"newton"``, ``"lm"`` (Levenberg-Marquardt), ``"dls"`` (damped least squares), ``"pinv"``
            (pseudoinverse); ``"hybrid"``: numeric from the solution of a similar limb with a spherical hip;
            ``"auto"``: closed where possible, else branches, else newton.
        guess: positions (..., n) of the limb's joints [rad or m]; default: those of posture ``home``, without
            one the middle of the limits. Numeric methods start there, and branches near it come first.
        settings: tolerances, starts, damping and the like of the numeric methods. Within the tolerances a
            solution inside the limits is preferred to a more exact one outside.
        least_squares: spend time on the nearest reachable pose where no branch is a solution.
        free: rotations of the tip that need not be met, out of ``rx ry rz``, in the order in which they turn
            it about its own axes: what a limb of fewer than six joints has to leave open. NumPy arrays only.

    Of a limb with coupled joints the joints are those that lead, one of them beside its way perhaps; their
    limits are those that the coupled ones leave them. Numeric methods solve it.

    Returns:
        LimbSolutions: ``.q`` (..., branches, n) best first, ``.valid .in_limits .residual .iterations``
        (..., branches), ``.status`` (...,), ``.best`` (..., n), ``.path()``. Where loops run through the
        limb, joints of its linkages, motors among them, stand behind its own: ``.joint_names`` names all, a
        branch is one where the linkages close, and limits are those of all. Nothing is raised for samples
        without solution; their first branch is the least-squares answer. JAX arrays give JAX arrays, also
        traced (``jit``, ``vmap``, ``grad``): joints follow the target by the inverse of the Jacobian.

    Raises:
        UnknownNameError: no such limb.
        ShapeError: wrong shape, NaN or infinity, or a pose that is not rigid.
        InputError: an unknown method, or one that does not fit the limb (for
            ``"closed"`` the message says why there is none); JAX arrays, and loops; or a closure
            that holds the tip to another limb's.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> home = sk.home(robot)
        >>> T_base_foot = sk.frame_pose(robot, sk.State(np.eye(4), home.q), "right_foot")
        >>> legs = sk.limb_ik(robot, "right_leg", T_base_foot)
        >>> legs.q.shape, bool(legs.valid[0])
        ((8, 6), True)
    """
    one_of("method", method, get_args(Method))
    refuse_sprung(robot, "limb_ik")
    chain = limb_chain(robot, limb)
    _refuse_joined(robot, chain.limb)
    settings, start = settings or DEFAULT, resting(robot, chain) if guess is None else guess
    solve = _linked_ik if limb_linkages(robot, limb) else _free_ik
    return solve(robot, chain, T_base_tip, method, start, settings, least_squares, free)


def _refuse_joined(robot: Robot, limb: str) -> None:
    """Refuse a limb whose tip a closure holds to another limb's, which would have to follow."""
    tip = robot.limb(limb).tip
    for pair in joined_tips(robot):
        if tip in pair:
            raise InputError(
                f"{robot.name}: a closure holds {pair[0]} to {pair[1]}, and limb_ik solves one limb alone; "
                "use solve_pose, where the other one follows"
            )


def _linked_ik(
    robot: Robot,
    chain: SerialChain,
    T_base_tip: Any,
    method: Method,
    start: Any,
    settings: IkSettings,
    least_squares: bool,
    free: Sequence[str],
) -> LimbSolutions:
    """The same for a limb with linkages."""
    if is_jax(T_base_tip) or is_jax(start):
        refuse_closures(robot, "limb_ik of JAX arrays", "give NumPy arrays")
    own, whole = len(chain.names), len(linked_chain(robot, chain).names)
    start = of_shape("guess", start, whole if np.shape(start)[-1:] == (whole,) else own)
    near = start[..., :own]
    solutions = _free_ik(robot, chain, T_base_tip, method, near, settings, least_squares, free)
    return with_linkages(robot, solutions, start)


def _free_ik(
    robot: Robot,
    chain: SerialChain,
    T_base_tip: Any,
    method: Method,
    start: Any,
    settings: IkSettings,
    least_squares: bool,
    free: Sequence[str],
) -> LimbSolutions:
    """Joint positions of a limb whose joints are free."""
    if is_jax(T_base_tip) or is_jax(start):
        from screwkin.ik.implicit import limb_in_jax

        SerialChain.of(robot, chain.limb)  # which refuses coupled joints
        refuse_free_in_jax(free)
        return limb_in_jax(chain, T_base_tip, method, start, settings, least_squares)
    if not free or np.shape(T_base_tip)[-2:] != (4, 4):
        return solve_limb_arrays(chain, T_base_tip, method, start, settings, least_squares)
    start = of_shape("guess", start, len(chain.names))
    longer = limb_chain(robot, chain.limb, checked_free(free))
    start = np.concatenate([start, np.zeros((*start.shape[:-1], len(free)))], axis=-1)
    solutions = solve_limb_arrays(longer, T_base_tip, method, start, settings, least_squares)
    own = solutions.q[..., : len(chain.names)]
    return replace(solutions, joint_names=chain.names, q=own, chain=chain)


def resting(robot: Robot, chain: SerialChain) -> Array:
    """Positions (n,) of a limb in posture ``home``, without one the middle of its limits."""
    for posture in robot.postures:
        if posture.name == "home":
            return np.array(posture.q, dtype=float)[list(chain.joints)]
    lower, upper = (np.where(np.isfinite(limit), limit, 0.0) for limit in (chain.lower, chain.upper))
    return (lower + upper) / 2
