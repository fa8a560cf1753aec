"""Whole-body positions: base and tips where they are wanted.

Limbs that share no joint are solved one by one, by their closed forms where they have some; limbs that share
joints together, by Newton's method. Joints that no target needs rest at the guess.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, get_args

import numpy as np

from screwkin.algebra.scalar import is_jax
from screwkin.errors import InputError, ShapeError, UnknownNameError, one_of
from screwkin.ik.held import judged_limbs, with_held_targets
from screwkin.ik.numeric import IkSettings
from screwkin.ik.pose_solution import PoseSolution
from screwkin.ik.system import checked_free, refuse_free_in_jax
from screwkin.ik.whole_body import PRECISE, Method, axes_of, solve_whole_body
from screwkin.kinematics.arrays import checked, exact_target, of_shape, one_batch
from screwkin.mechanism.holds import on_floor
from screwkin.model.robot import Robot, refuse_closures
from screwkin.model.sprung import refuse_sprung
from screwkin.model.state import State, home


def solve_pose(
    robot: Robot,
    targets: Mapping[str, Any],
    guess: State | None = None,
    method: Method = "auto",
    *,
    settings: IkSettings | None = None,
    free: Mapping[str, Sequence[str]] | None = None,
) -> PoseSolution:
    """Joint positions that put base and tips where they are wanted, batched.

    Of several solutions of a limb the one nearest to the guess within the limits is taken, else the nearest
    outside. Joints that limbs share are solved for all of them together; joints that no target needs rest at
    the guess. Where loops run through a limb, its motors and pins follow, and limits are those of all. Tips
    that closures hold, to each other or on the floor, go where the others' targets say.

    Args:
        robot: the robot.
        targets: ``"base"`` (..., 4, 4) and tips by name: a pose (..., 4, 4), or a position (..., 3) with the
            orientation free; world frame [m].
        guess: a nearby state; default ``home``. Its base pose holds where ``"base"`` is not given.
        method: ``"auto"``: closed forms of limbs where they have some, else Newton's method; ``"newton"``:
            always that. Where it does not arrive within the limits, further starts by bounded least squares.
        settings: tolerances and number of starts; within the tolerances a solution inside the limits is
            preferred to a more exact one outside. Default: 1e-12, 64 starts.
        free: by tip, rotations of its target pose that need not be met, as ``limb_ik`` takes them: those that
            follow where a limb has fewer than six joints. NumPy arrays only.

    Returns:
        PoseSolution with ``.state .status .residual .iterations`` (..., limbs). Nothing is raised for samples
        without solution; ``.raise_on_failure(robot)`` does. JAX arrays give JAX arrays, also traced (``jit``,
        ``vmap``, ``grad``): joints follow the targets by the inverse of the Jacobian.

    Raises:
        UnknownNameError: a target is no tip.
        ShapeError: wrong shape, NaN or infinity, a pose that is not rigid, or batches that do not fit.
        InputError: no tip has a target, an unknown method, or JAX arrays for a robot with closures; or a
            closure holds a tip whose target is a position, or a link on the floor that ends no limb.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> T_world_foot = sk.frame_pose(robot, sk.home(robot), "right_foot")
        >>> T_world_foot[2, 3] += 0.02                  # lift the foot by 20 mm
        >>> sk.solve_pose(robot, {"right_foot": T_world_foot}).ok
        True
    """
    one_of("method", method, get_args(Method))
    given, labels = dict(targets), {name: f"targets[{name!r}]" for name in targets}
    guess = home(robot) if guess is None else guess
    if "base" not in given:
        given["base"], labels["base"] = guess.T_world_base, "guess.T_world_base"
    wanted = {}
    for name, value in given.items():
        if name != "base" and name not in robot.tip_names:
            raise UnknownNameError("target", name, ("base", *robot.tip_names))
        shape = (4, 4) if np.shape(value)[-2:] == (4, 4) or name == "base" else (3,)
        wanted[name] = of_shape(labels[name], value, *shape)
    refuse_sprung(robot, "solve_pose")
    if len(wanted) < 2 and not on_floor(robot):
        raise InputError("no targets; name at least one tip, such as " + ", ".join(robot.tip_names[:2]))
    q = checked("guess.q", guess.q, len(robot.joints))
    batch = one_batch({labels[n]: (a, axes_of(a)) for n, a in wanted.items()} | {"guess.q": (q, 1)})
    settings, open_ = settings or PRECISE, {name: checked_free(names) for name, names in (free or {}).items()}
    for name in open_:
        one_of("tip", name, robot.tip_names)
    if is_jax(q) or any(map(is_jax, wanted.values())):
        from screwkin.ik.implicit import pose_in_jax

        refuse_closures(robot, "solve_pose of JAX arrays", "give NumPy arrays")
        refuse_free_in_jax(open_)
        rigid = {name: checked(labels[name], target) for name, target in wanted.items()}
        return pose_in_jax(robot, rigid, q, batch, method, settings)
    if robot.closures:
        wanted = with_held_targets(robot, wanted)
    try:
        solution = solve_whole_body(robot, wanted, q, batch, method, settings, open_)
        return judged_limbs(robot, solution, settings) if robot.closures else solution
    except ShapeError:  # once more by the caller's names
        for name, target in wanted.items():
            exact_target(labels[name], checked(labels[name], target))
        raise
