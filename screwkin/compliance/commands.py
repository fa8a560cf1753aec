"""Commands of elastic drives, so that their joints stand where they should: for a control cycle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.scalar import is_jax
from screwkin.compliance.laws import Spring, checked_springs, spring_deflections
from screwkin.compliance.springs import SpringChoice, spring_stiffness
from screwkin.errors import LimitError, expect
from screwkin.kinematics import limits
from screwkin.kinematics.arrays import checked
from screwkin.model.robot import Robot
from screwkin.model.state import State


def compensate(
    robot: Robot,
    state: State,
    efforts: Any,
    stiffness: SpringChoice = None,
    springs: Mapping[str, Spring] | None = None,
) -> Array:
    """Positions to command to elastic drives so that the joints stand at the state under their efforts.

    Drive and joint are the ends of a spring: what its effort deflects it is added to the command. The joints
    then stand as they should, and frames beyond links that bend do not; ``elastic_commands`` undoes that too.

    Args:
        robot: n joints.
        state: where base and joints are to be, q (..., n).
        efforts: (..., n) of the joints there [N m or N]: ``inverse_dynamics`` beyond the base's six rows, or
            ``static_forces`` of a robot that stands.
        stiffness: one number for all joints, or by joint name with ``default`` [N m/rad or N/m], an array
            (...) of one for each sample where it changes with time; default: the table's. A joint without a
            motor has no drive to command: its position stays.
        springs: by joint name, springs whose stiffness changes with their deflection: tables of (deflection,
            effort), or functions of deflections (...) that return efforts (...) and their slopes (...).

    Returns:
        (..., n) positions to command [rad or m].

    Raises:
        UnknownNameError: no such joint. ShapeError: a wrong shape, NaN or infinity.
        InputError: a stiffness is no positive number, or a spring's table does not increase through zero.
        LimitError: a command is beyond a joint's limits, or an effort beyond the end of a spring's table.
        NoSolutionError: a spring's function does not reach the effort.

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
    q, load = (
        checked(what, x, len(robot.joints)) for what, x in (("state.q", state.q), ("efforts", efforts))
    )
    laws = checked_springs(robot, springs)
    k = spring_stiffness(robot, stiffness, [robot.joint_names[i] for i in laws])
    k = np.where(k > 0, k, np.inf)  # of a drive that is not there
    xp = numpy_of(q, load)
    deflection = load / k
    if laws:
        named = {robot.joint_names[i]: law for i, law in laws.items()}
        curved = dict(zip(laws, spring_deflections(named, [load[..., i] for i in laws]), strict=True))
        columns = [curved.get(i, deflection[..., i]) for i in range(load.shape[-1])]
        deflection = xp.stack(xp.broadcast_arrays(*columns), axis=-1)
    commands: Array = q + deflection
    if not is_jax(commands):
        check_commands(robot, commands)
    return commands


def check_commands(robot: Robot, commands: Array) -> None:
    """Refuse commands (..., n) beyond limits.

    Raises:
        LimitError: names the joint that is farthest beyond.
    """
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
