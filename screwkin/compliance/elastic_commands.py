"""What drives must be told so that frames stand where they should, although joints and links bend.

Where springs are in balance, moving the commands by dq moves the coordinates by y = (P H P + 1 - P)^-1 P K dq
(see ``balance``: H of all forces, K of the springs alone), and a frame by its columns. Newton's method on
the frames' poses follows from that exactly, through links, loops and several supports alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pytrees import pytree
from screwkin.algebra.se3 import Pose, as_array, pose_from_array, rotation_log, unstack
from screwkin.compliance.balance import ElasticBalance, Loaded, spring_slopes
from screwkin.compliance.commands import check_commands
from screwkin.compliance.equilibrium import balances, resting_deflections
from screwkin.compliance.laws import Spring
from screwkin.compliance.springs import SpringChoice
from screwkin.compliance.stiffness import loaded_robot
from screwkin.errors import InputError, SingularError
from screwkin.kinematics.body import frame_pose
from screwkin.kinematics.mass import GRAVITY
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.mechanism.linkages import motor_joints
from screwkin.mechanism.scaling import characteristic_length
from screwkin.model.robot import Robot
from screwkin.model.state import State

STEPS = 30
"""Most steps of Newton's method."""
STILL = 1e-12
"""Change of the commands [rad or m] at which it ends."""
REGULAR = 1e-6
"""Singular value, over the largest, from which commands move the frames."""


@dataclass(frozen=True, eq=False)
@pytree("frames")
class ElasticCommands:
    """Commands under which an elastic robot stands as it should; B stands for any leading dimensions.

    Attributes:
        frames: what was to stand as asked, the order of ``apart``.
        state: base and joints to command: ``static_deflection`` of this state is where the robot settles.
        apart: (B, frames, 6) rotation vector [rad] and translation [m] that are left from where a frame
            settles to where it was asked, world axes: zero where the joints can undo all, else the least.
        iterations: number of steps.
    """

    frames: tuple[str, ...]
    state: State
    apart: Array
    iterations: int

    @property
    def residual(self) -> Array:
        """(B,) the largest rotation [rad] or translation [m] that is left."""
        turn, shift = (np.linalg.norm(part, axis=-1) for part in (self.apart[..., :3], self.apart[..., 3:]))
        return np.asarray(np.maximum(turn, shift).max(axis=-1))


def elastic_commands(
    robot: Robot,
    state: State,
    support: str | Sequence[str],
    frames: Sequence[str] | None = None,
    stiffness: SpringChoice = None,
    gravity: float = GRAVITY,
    *,
    loads: Mapping[str, Any] | None = None,
    springs: Mapping[str, Spring] | None = None,
    points: Sequence[str] = (),
) -> ElasticCommands:
    """Commands to motors that undo what joints and links bend under weight and loads.

    Args:
        robot: n joints; of its links those with a ``spring`` bend.
        state: where the robot would stand were it rigid, T_world_base (..., 4, 4) and q (..., n), closed.
        support: what stands still where the state has it, as for ``static_deflection``.
        frames: tips, links or ``base`` that shall settle where the state has them; default: ``base`` and all
            tips that are not supports.
        stiffness: as for ``static_deflection``.
        gravity: [m/s^2], along -z of the world.
        loads: as for ``static_deflection``, about where the state has what they act on.
        springs: as for ``static_deflection``.
        points: of the frames those whose origins alone count, as of a hand on three joints.

    Returns:
        ElasticCommands. Where the joints cannot undo all, the sum of squares of what is left is least,
        rotations times the size of the robot; where they can in many ways, they move least.

    Raises:
        InputError: a frame is a support, or a point none of the frames; or as for ``static_deflection``.
        LimitError: a command is beyond a joint's limits.
        NoSolutionError: there is no equilibrium.
        SingularError: something moves freely.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> told = sk.elastic_commands(robot, sk.home(robot), "right_foot", ["base"], 20.0)
        >>> bent = sk.static_deflection(robot, told.state, "right_foot", 20.0)
        >>> there = bent.state.T_world_base - sk.home(robot).T_world_base
        >>> bool(abs(there).max() < 1e-9), bool(abs(told.state.q - sk.home(robot).q).max() > 0.01)
        (True, True)

    Source: Klimchik, Chablat and Pashkevich (2014), section 5: compensation by the loaded equilibrium.
    """
    asked, supports, batch = loaded_robot(robot, state, support, stiffness, gravity, loads, springs)
    names = ("base", *robot.tip_names) if frames is None else tuple(frames)
    chosen = names if frames is not None else tuple(name for name in names if name not in supports)
    _check(robot, chosen, supports, points)
    model, n = asked.robot, len(robot.joints)
    motors = [robot.joint_names.index(name) for name in motor_joints(robot)]
    weights = np.array([[0.0 if f in points else characteristic_length(robot), 1.0] for f in chosen])
    weigh = np.repeat(weights.ravel(), 3)
    targets = [_posed(model, asked.T_world_base, asked.q, name) for name in chosen]
    told = replace(asked, placed=(asked.T_world_base, asked.q))
    for iteration in range(STEPS + 1):
        apart = np.zeros((len(told.q), len(chosen), 6))
        step = np.zeros_like(told.q)
        theta = _held_up(robot, told)
        for rows, here in balances(told, theta):
            apart[rows] = _apart(here, chosen, targets, rows)
            J = _by_commands(told, here, theta[rows], rows, chosen)[..., motors]
            left = apart[rows].reshape(len(rows), -1) * weigh
            undone = np.linalg.pinv(J * weigh[:, None], rcond=REGULAR) @ left[..., None]
            step[rows[:, None], motors] = undone[..., 0]
        if iteration == STEPS or np.abs(step).max(initial=0.0) < STILL:
            break
        told = _commanded(told, told.q + step)
    check_commands(robot, told.q[:, :n])
    apart[:, [name in points for name in chosen], :3] = 0.0
    commands = State(told.T_world_base.reshape(*batch, 4, 4), told.q[:, :n].reshape(*batch, n))
    return ElasticCommands(chosen, commands, apart.reshape(*batch, len(chosen), 6), iteration)


def _check(robot: Robot, frames: Sequence[str], supports: Sequence[str], points: Sequence[str]) -> None:
    for name in frames:
        robot.frame(name)
        if name in supports:
            raise InputError(f"{name} is a support, which stands still by itself; leave it out of frames")
    if not frames or len(set(frames)) < len(frames):
        raise InputError(f"frames is {frames!r}; name one that shall settle as asked, or several, each once")
    if other := [name for name in points if name not in frames]:
        raise InputError(f"points names {', '.join(other)}, none of the frames {', '.join(frames)}")


def _posed(robot: Robot, T_world_base: Array, q: Array, frame: str) -> Array:
    return np.asarray(frame_pose(robot, State(T_world_base, q), frame))


def _commanded(told: Loaded, q: Array) -> Loaded:
    """The same under other commands: the base goes along, so that the support stays."""
    assert told.placed is not None
    stand = _posed(told.robot, *told.placed, told.support)
    back = as_array(
        pose_in_base(told.robot, link_displacements(told.robot, unstack(q)), told.support).inverse
    )
    return replace(told, q=q, T_world_base=stand @ np.broadcast_to(back, stand.shape))


def _apart(here: ElasticBalance, frames: Sequence[str], targets: Sequence[Array], rows: Array) -> Array:
    """(A, frames, 6) rotation vectors and translations from where frames are to where they were asked."""
    found = np.zeros((len(rows), len(frames), 6))
    for k, (name, target) in enumerate(zip(frames, targets, strict=True)):
        pose: Pose = here.here.pose(name)
        wanted = pose_from_array(target[rows])
        apart = [rotation_log(wanted.R @ pose.R.T), wanted.p - pose.p]
        found[:, k] = as_array(apart, (len(rows),)).reshape(len(rows), 6)
    return found


def _held_up(robot: Robot, told: Loaded) -> Array:
    """Deflections (B, n) at rest, where nothing moves freely."""
    theta, stable = resting_deflections(told)
    if len(free := np.flatnonzero(~stable)):
        raise SingularError(
            f"sample {free[0]}: {robot.name} moves freely in some direction, or is unstable, so that no "
            "command decides where it stands; give its joints springs",
            sample=int(free[0]),
        )
    return theta


def _by_commands(
    told: Loaded, here: ElasticBalance, theta: Array, rows: Array, frames: Sequence[str]
) -> Array:
    """(A, 6 frames, n) displacements of frames per unit of every command."""
    pulled = here.P @ spring_slopes(told, theta, rows, here.unit)
    moved = np.linalg.solve(here.left, pulled * np.sqrt(here.unit)[..., None, :])
    return np.concatenate([here.columns(name) @ moved for name in frames], axis=1)
