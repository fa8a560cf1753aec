"""What elastic drives must be told so that their joints stand where they should: for a control cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.scalar import is_jax
from screwkin.compliance.springs import StiffnessChoice, joint_stiffness
from screwkin.errors import InputError, LimitError, expect, one_of
from screwkin.kinematics import limits
from screwkin.kinematics.arrays import checked
from screwkin.model.robot import Robot
from screwkin.model.state import State

Spring = Sequence[tuple[float, float]]
"""A spring as a table: pairs of deflection [rad or m] and effort [N m or N], increasing, through zero."""


def compensate(
    robot: Robot,
    state: State,
    efforts: Any,
    stiffness: StiffnessChoice = None,
    springs: Mapping[str, Spring] | None = None,
) -> Array:
    """Positions to command to elastic drives so that the joints stand at the state under their efforts.

    Drive and joint are the ends of a spring: what its effort deflects it is added to the command.

    Args:
        robot: n joints.
        state: where base and joints are to be, q (..., n).
        efforts: (..., n) of the joints there [N m or N]: ``inverse_dynamics`` beyond the base's six rows, or
            ``static_forces`` of a robot that stands.
        stiffness: one number for all joints, or by joint name with ``default`` [N m/rad or N/m]; default: the
            table's.
        springs: by joint name, springs whose stiffness changes: tables of (deflection, effort).

    Returns:
        (..., n) positions to command [rad or m].

    Raises:
        UnknownNameError: no such joint. ShapeError: a wrong shape, NaN or infinity.
        InputError: a stiffness is no positive number, or a spring's table does not increase through zero.
        LimitError: a command is beyond a joint's limits, or an effort beyond the end of a spring's table.

    Example:
        >>> import numpy as np, screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> commands = sk.compensate(robot, sk.home(robot), np.full(18, 0.2), stiffness=20)
        >>> bool(np.allclose(commands - sk.home(robot).q, 0.01))
        True

    Source: paper B, eq. 13, solved for the command.
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    expect(state, State, "state", "State(T_world_base, q)")
    count, tables = len(robot.joints), dict(springs or {})
    q, load = checked("state.q", state.q, count), checked("efforts", efforts, count)
    for name in tables:
        one_of("joint", name, robot.joint_names)
    k = _stiffness(robot, stiffness, tables)
    xp = numpy_of(q, load)
    columns = [
        _deflection(name, tables[name], load[..., i]) if name in tables else load[..., i] / k[i]
        for i, name in enumerate(robot.joint_names)
    ]
    commands: Array = q + xp.stack(columns, axis=-1) if columns else q
    if not is_jax(commands):
        _check_limits(robot, commands)
    return commands


def _stiffness(robot: Robot, choice: StiffnessChoice, tables: Mapping[str, Spring]) -> Array:
    """(n,) of all joints; those with a table need none."""
    if choice is None or not isinstance(choice, Mapping):
        return joint_stiffness(robot, choice)
    return joint_stiffness(robot, {**dict.fromkeys(tables, 1.0), **choice})


def _deflection(name: str, table: Spring, effort: Array) -> Array:
    """How far a spring given by a table is deflected by an effort."""
    pairs = checked(f"springs[{name!r}]", table, 2)
    if pairs.ndim != 2 or len(pairs) < 2 or (np.diff(pairs, axis=0) <= 0).any():
        raise InputError(f"springs[{name!r}]: deflections and efforts must increase from pair to pair")
    if abs(np.interp(0.0, pairs[:, 0], pairs[:, 1])) > 0 or not pairs[0, 0] <= 0 <= pairs[-1, 0]:
        raise InputError(f"springs[{name!r}] has an effort without deflection; give a pair (0, 0)")
    xp = numpy_of(effort)
    if not is_jax(effort) and ((effort < pairs[0, 1]) | (effort > pairs[-1, 1])).any():
        worst = float(np.ravel(effort)[np.abs(np.ravel(effort)).argmax()])
        raise LimitError(
            f"{name} carries {worst:.4g}, and its spring's table ends at {pairs[0, 1]:.4g} and "
            f"{pairs[-1, 1]:.4g}; give further pairs"
        )
    deflection: Array = xp.interp(effort, pairs[:, 1], pairs[:, 0])
    return deflection


def _check_limits(robot: Robot, commands: Array) -> None:
    lower, upper = limits.limits_of(robot)
    if limits.within(commands, lower, upper).all():
        return
    rows = commands.reshape(-1, len(lower))
    beyond = np.maximum(rows - upper, lower - rows)
    sample, i = (int(x) for x in np.unravel_index(beyond.argmax(), beyond.shape))
    raise LimitError(
        f"sample {sample}: {robot.joints[i].name} would be commanded to {rows[sample, i]:.4g}, beyond its "
        f"limits {lower[i]:.4g} and {upper[i]:.4g}; lower the load or stiffen the joint"
    )
