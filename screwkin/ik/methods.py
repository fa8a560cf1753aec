"""All methods of one limb over arrays: its closed form, a hybrid, and numeric iterations."""

from __future__ import annotations

from typing import Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.ik.branches import closed_solutions
from screwkin.ik.closed import closed_form, recognised
from screwkin.ik.hybrid import hybrid_seed
from screwkin.ik.numeric import IkSettings, Numeric, arrived, solve_system
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.ik.system import System
from screwkin.kinematics.rigid import nearest_poses
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.state import RIGID

Method = Literal["auto", "closed", "hybrid", "newton", "lm", "dls", "pinv"]


def solve_limb_arrays(
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
        if not recognised(chain, position):
            closed_form(chain, position)  # it says why there is none
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
