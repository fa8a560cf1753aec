"""Inverse kinematics of one limb."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError
from screwkin.ik.branches import closed_solutions
from screwkin.ik.closed import closed_form, recognised
from screwkin.ik.hybrid import hybrid_seed
from screwkin.ik.numeric import IkSettings, Numeric, arrived, solve_system
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.ik.system import System
from screwkin.kinematics.arrays import checked, one_batch
from screwkin.kinematics.rigid import nearest_poses
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot, refuse_closures
from screwkin.model.state import RIGID

Method = Literal["auto", "closed", "hybrid", "newton", "lm", "dls", "pinv"]


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
            orientation free.
        method: ``"closed"``, exact and with all branches, for limbs whose screw table allows it; numeric from
            the guess: ``"newton"``, ``"lm"`` (Levenberg-Marquardt), ``"dls"`` (damped least squares),
            ``"pinv"`` (pseudoinverse); ``"hybrid"``: numeric from the solution of a similar limb with a
            spherical hip; ``"auto"``: closed where possible, else newton.
        guess: positions (..., n) of the limb's joints [rad or m]; default: those of posture ``home``, without
            one the middle of the limits. Numeric methods start there, and branches near it come first.
        settings: tolerances, starts, damping and the like of the numeric methods. Within the tolerances a
            solution inside the limits is preferred to a more exact one outside.
        least_squares: spend time on the nearest reachable pose where the closed form has no solution.

    Returns:
        LimbSolutions: ``.q`` (..., branches, n) best first, ``.valid .in_limits .residual .iterations``
        (..., branches), ``.status`` (...,), ``.best`` (..., n), ``.path()``. Nothing is raised for samples
        without solution; their first branch is the least-squares answer. JAX arrays give JAX arrays, also
        traced (``jit``, ``vmap``, ``grad``): joints follow the target by the inverse of the Jacobian.

    Raises:
        UnknownNameError: no such limb.
        ShapeError: wrong shape, NaN or infinity.
        InputError: a pose that is none, an unknown method, or one that does not fit the limb (for
            ``"closed"`` the message says what the limb's geometry lacks); or the robot has closures.
    """
    if method not in get_args(Method):
        raise InputError(f"method is {method!r}; valid: {', '.join(get_args(Method))}")
    refuse_closures(robot, "limb_ik", "use close_loops")
    chain = SerialChain.of(robot, limb)
    poses = np.shape(T_base_tip)[-2:] == (4, 4)
    settings = settings or IkSettings()
    target = checked("T_base_tip", T_base_tip, *((4, 4) if poses else (3,)))
    start = checked("guess", resting(robot, chain) if guess is None else guess, len(chain.names))
    batch = one_batch({"T_base_tip": (target, 2 if poses else 1), "guess": (start, 1)})
    if is_jax(target) or is_jax(start):
        from screwkin.ik.implicit import limb_in_jax

        return limb_in_jax(chain, target, method, start, settings, batch, least_squares)
    return solve_arrays(chain, target, method, start, settings, batch, least_squares)


def solve_arrays(
    chain: SerialChain,
    target: Array,
    method: Method,
    guess: Array,
    settings: IkSettings,
    batch: tuple[int, ...],
    least_squares: bool,
) -> LimbSolutions:
    """As ``limb_ik``, for NumPy arrays that broadcast to a batch."""
    shape = (4, 4) if target.shape[-2:] == (4, 4) else (3,)
    target = rigid(target) if shape == (4, 4) else target
    count, n = int(np.prod(batch)), guess.shape[-1]
    flat = np.broadcast_to(target, (*batch, *shape)).reshape(count, *shape)
    flat_guess = np.broadcast_to(guess, (*batch, n)).reshape(count, n)
    return solve_limb(chain, flat, method, flat_guess, settings, batch, least_squares)


def solve_limb(
    chain: SerialChain,
    target: Array,
    method: Method,
    guess: Array,
    settings: IkSettings,
    batch: tuple[int, ...],
    nearest: bool = True,
) -> LimbSolutions:
    """Joint positions that put the tip of a limb at its targets.

    Args:
        chain: n joints.
        target: poses (B, 4, 4), or positions (B, 3), in the base frame.
        method: see ``limb_ik``.
        guess: (B, n).
        settings: of the numeric methods.
        batch: shape with B samples.
        nearest: see ``least_squares`` of ``limb_ik``.

    Raises:
        InputError: the method does not fit the limb or the target.
    """
    position = target.ndim == 2
    if method == "auto":
        method = "closed" if recognised(chain, position) else "newton"
    if method == "closed":
        if position and not recognised(chain, True):
            raise InputError(
                "method closed needs poses (..., 4, 4); positions (..., 3) of this limb need a numeric method"
            )
        closed_form(chain, position)
        return closed_solutions(chain, target, guess, batch, settings.tolerances, nearest)
    if method == "hybrid" and position:
        raise InputError("method hybrid needs poses (..., 4, 4); positions (..., 3) need another method")
    start = hybrid_seed(chain, target, guess) if method == "hybrid" else guess
    solver: Numeric = settings.finish if method == "hybrid" else method
    system = System([chain], [target])
    q, iterations = solve_system(system, solver, start, settings)
    lack, _ = system.residual(q, np.arange(len(q)))
    one = (slice(None), None)
    error, valid = np.linalg.norm(lack, axis=1), arrived(system, lack, settings)
    return ordered(chain, method, q[one], valid[one], error[one], iterations[one], guess, batch)


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


def resting(robot: Robot, chain: SerialChain) -> Array:
    """Positions (n,) of a limb in posture ``home``, without one the middle of its limits."""
    for posture in robot.postures:
        if posture.name == "home":
            return np.array(posture.q, dtype=float)[list(chain.joints)]
    lower, upper = (np.where(np.isfinite(limit), limit, 0.0) for limit in (chain.lower, chain.upper))
    return (lower + upper) / 2
