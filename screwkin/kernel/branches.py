"""All branches of a limb's closed form by its program; what is in doubt is left to ``solve.closed``."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwkin.kernel.limbs import DOUBT, limb_branches
from screwkin.kernel.run import run
from screwkin.model.robot import Robot
from screwkin.solve.branches import LimbSolutions, ordered
from screwkin.solve.chain import Chain
from screwkin.solve.closed import EXACT, closed_form, solve_closed

Array = Any


def limb_solutions(
    robot: Robot, limb: str, target: Array, guess: Array, batch: tuple[int, ...], least_squares: bool = True
) -> LimbSolutions:
    """As ``solve.ik.solve_limb`` with method "closed", for tip poses (B, 4, 4) and guesses (B, n)."""
    chain = Chain.of(robot, limb)
    found = run(limb_branches(robot, limb), {"T_base_tip": target})
    q, error, slack = found["q"], found["error"], found["slack"]
    with np.errstate(invalid="ignore"):
        valid = error <= EXACT
        clear = np.where(slack > 0, valid, ~valid) & (np.abs(slack) > DOUBT)
    again = np.flatnonzero(~(clear.all(axis=1) & valid.any(axis=1)))
    if len(again):
        form = closed_form(chain)
        part = solve_closed(form, target[again], guess[again], least_squares)
        q[again], error[again], valid[again] = part
    return ordered(chain, "closed", q, valid, error, np.ones(error.shape, dtype=int), guess, batch)
