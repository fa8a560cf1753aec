"""Whole-body positions: base and tips where they are wanted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from screwkin.errors import InputError, UnknownNameError
from screwkin.ik.loops import PoseSolution
from screwkin.ik.loops import solve_pose as newton_pose
from screwkin.ik.whole_body import axes_of, solve_samples
from screwkin.kinematics.arrays import checked, one_batch, rigid
from screwkin.model.robot import Robot
from screwkin.model.state import State, home


def solve_pose(
    robot: Robot,
    targets: Mapping[str, Any],
    guess: State | None = None,
    method: Literal["auto", "newton"] = "auto",
) -> PoseSolution:
    """Joint positions that put base and tips where they are wanted, batched.

    Args:
        robot: the robot.
        targets: ``"base"`` (..., 4, 4) and tips by name: a pose (..., 4, 4), or a position (..., 3) with the
            orientation free; world frame.
        guess: a nearby state; default ``home``. Its base pose holds where ``"base"`` is not given.
        method: ``"newton"``, through the network matrix; ``"auto"``: for large batches the closed forms of
            the limbs, where they have some, of the solution nearest to the guess.

    Returns:
        PoseSolution with ``.state .status .residual .iterations`` (..., limbs). Nothing is raised for samples
        without solution; ``.raise_on_failure(robot)`` does.

    Raises:
        UnknownNameError: a target is no tip. ShapeError: wrong shape, NaN or infinity, or a pose
            that is not rigid.
    """
    if method not in ("auto", "newton"):
        raise InputError(f"method is {method!r}; valid: auto, newton")
    wanted = {}
    for name, value in targets.items():
        if name != "base" and name not in robot.tip_names:
            raise UnknownNameError("target", name, ("base", *robot.tip_names))
        pose = np.shape(value)[-2:] == (4, 4) or name == "base"
        told = f"targets[{name!r}]"
        wanted[name] = rigid(told, checked(told, value, 4, 4)) if pose else checked(told, value, 3)
    guess = home(robot) if guess is None else guess
    base = checked("guess.T_world_base", guess.T_world_base, 4, 4)
    base = base if "base" in wanted else rigid("guess.T_world_base", base)
    q = checked("guess.q", guess.q, len(robot.joints))
    named = {f"targets[{name!r}]": (a, axes_of(a)) for name, a in wanted.items()}
    one_batch(named | {"guess.T_world_base": (base, 2), "guess.q": (q, 1)})
    start = State(np.asarray(base, dtype=float), np.asarray(q, dtype=float))
    return (solve_samples if method == "auto" else newton_pose)(robot, wanted, start)
