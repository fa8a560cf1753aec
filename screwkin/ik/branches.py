"""All solutions of a limb by its program; what is in doubt is left to ``ik.closed``."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compiler.run import run
from screwkin.ik.closed import closed_form, solve_closed
from screwkin.ik.programs import limb_branches
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.kinematics.serial_chain import Chain
from screwkin.model.robot import Robot


def limb_solutions(
    robot: Robot, limb: str, target: Array, guess: Array, batch: tuple[int, ...], least_squares: bool = True
) -> LimbSolutions:
    """As ``ik.numeric.solve_limb`` with method "closed", for tip poses (B, 4, 4) and guesses (B, n)."""
    chain = Chain.of(robot, limb)
    found = run(limb_branches(robot, limb), {"T_base_tip": target, "guess": guess})
    kind, error = found["kind"], found["error"]
    steps = np.ones(kind.shape, dtype=int)
    program = LimbSolutions(
        chain.limb, chain.names, "closed", found["q"], kind > 0.5, kind > 1.5, error, steps
    )
    again = np.flatnonzero(found["sure"][:, 0] < 0.5)
    if len(again):
        form = closed_form(chain)
        q, left, valid = solve_closed(form, target[again], guess[again], least_squares)
        told = ordered(chain, "closed", q, valid, left, steps[again], guess[again], (len(again),))
        for name in ("q", "valid", "in_limits", "residual"):
            getattr(program, name)[again] = getattr(told, name)
    return _shaped(program, batch)


def _shaped(flat: LimbSolutions, batch: tuple[int, ...]) -> LimbSolutions:
    told = {field.name: getattr(flat, field.name) for field in fields(flat)}
    arrays = {name: a.reshape(*batch, *a.shape[1:]) for name, a in told.items() if isinstance(a, np.ndarray)}
    return LimbSolutions(**(told | arrays))
