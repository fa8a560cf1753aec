"""Positions of any closed mechanism: Newton's method through the network matrix.

Coordinates are those of the couplings, virtual ones included, so any choice of primary couplings may be
imposed: the position of a four-bar's crank, the legs of a platform, a foot while the waist follows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import (
    ZERO,
    Pose,
    Twist,
    Vector,
    as_array,
    pose_from_array,
    rotation_log,
    unstack,
)
from screwkin.errors import InputError, NoSolutionError, one_of
from screwkin.kinematics import limits
from screwkin.kinematics.positions import closure_ends, link_displacements, pose_in_base
from screwkin.kinematics.status import CLOSED, SINGULAR, Status
from screwkin.mechanism.chains import chain_coordinates, chain_pose
from screwkin.mechanism.mechanism import Mechanism, unchosen
from screwkin.mechanism.network import coupling_twists, network_of_twists
from screwkin.mechanism.scaling import characteristic_length
from screwkin.model.robot import Robot
from screwkin.model.state import State


@dataclass(frozen=True, eq=False)
class ClosureSolution:
    """Closed positions of a batch.

    Attributes:
        state: T_world_base (..., 4, 4) and q (..., n).
        coordinates: (..., couplings) [m, rad].
        status: (...,) ``Status`` values.
        residual: (...,) closure error [m and rad, norm].
        iterations: (...,).
    """

    state: State
    coordinates: Array
    status: Array
    residual: Array
    iterations: Array


def coordinates_from_state(mechanism: Mechanism, T: Pose, q: Sequence[Scalar]) -> list[Scalar]:
    """Coordinates of all couplings at a state; virtual chains reach their bodies."""
    robot = mechanism.robot
    D = link_displacements(robot, q)
    values = dict(zip(robot.joint_names, q, strict=True))
    for chain in mechanism.chains:
        body = T if chain.limb is None else T @ pose_in_base(robot, D, chain.limb.tip)
        coordinates = chain_coordinates(chain.couplings, body, mechanism.held(chain, T))
        values |= zip(chain.names, coordinates, strict=True)
    carried = dict(zip(robot.link_names, D, strict=True))
    for chain in mechanism.added:
        values |= zip(chain.names, chain.coordinates(*chain.ends(robot, T, carried)), strict=True)
    return [values[name] for name in mechanism.couplings]


def base_pose(mechanism: Mechanism, coordinates: Sequence[Scalar], fixed: Pose) -> Pose:
    """Pose of the base at the end of the waist's chain, or the fixed one."""
    for chain in mechanism.chains:
        if chain.limb is None:
            return chain_pose(chain.couplings, [coordinates[mechanism.position[n]] for n in chain.names])
    return fixed


def closure_errors(mechanism: Mechanism, coordinates: Sequence[Scalar], fixed: Pose) -> list[Twist]:
    """What separates the ends of every closing, as small twists about the base origin, world axes.

    A twist moves end a onto end b; all are zero when the mechanism is closed.
    """
    robot = mechanism.robot
    q = [coordinates[mechanism.position[name]] for name in robot.joint_names]
    base = base_pose(mechanism, coordinates, fixed)
    D = link_displacements(robot, q)
    carried = dict(zip(robot.link_names, D, strict=True))
    ends: list[tuple[Pose, Pose, Vector]] = []
    for chain in mechanism.chains:
        if chain.limb is not None:
            values = [coordinates[mechanism.position[name]] for name in chain.names]
            end = chain_pose(chain.couplings, values, mechanism.held(chain, base))
            ends.append((base @ pose_in_base(robot, D, chain.limb.tip), end, base.p))
    for closure in robot.closures:
        a, b = closure_ends(closure, carried, base)
        ends.append((base @ a, base @ b, base.p))
    for chain in mechanism.added:
        start, end = chain.ends(robot, base, carried)
        values = [coordinates[mechanism.position[name]] for name in chain.names]
        ends.append((end, chain.reached(start, values), ZERO))
    errors = []
    for a, b, origin in ends:
        gap = Twist(rotation_log(b.R @ a.R.T), b.p - a.p)
        errors.append(at(origin - a.p, gap))
    return errors


def close_loops(mechanism: Mechanism, guess: State, imposed: Mapping[str, Array]) -> ClosureSolution:
    """Positions at which all loops close, for imposed coordinates of primary couplings.

    Args:
        mechanism: its primary couplings keep the guess's coordinates, or get those imposed.
        guess: a state near the solution, batched or not.
        imposed: coordinate (...,) [rad or m] by primary coupling.

    Returns:
        ClosureSolution; nothing is raised for samples without solution.

    Raises:
        UnknownNameError: a name is no coupling. InputError: it is secondary.

    Example:
        >>> import screwkin as sk
        >>> mechanism = sk.closed_mechanism(sk.load_robot("linkages/four-bar"))
        >>> closed = sk.close_loops(mechanism, sk.home(mechanism.robot), {"crank": 0.9})
        >>> int(closed.status), round(float(closed.state.q[0]), 12)
        (0, 0.9)
    """
    for name in imposed:
        if one_of("coupling", name, mechanism.couplings) in mechanism.secondary:
            raise InputError(f"{name} is secondary and follows; impose primary couplings only")
    T, q = np.asarray(guess.T_world_base, dtype=float), np.asarray(guess.q, dtype=float)
    values = {name: np.asarray(value, dtype=float) for name, value in imposed.items()}
    batch = np.broadcast_shapes(T.shape[:-2], q.shape[:-1], *(v.shape for v in values.values()))
    count, columns = int(np.prod(batch)), mechanism.secondary_columns
    flat_T = np.broadcast_to(T, (*batch, 4, 4)).reshape(count, 4, 4)
    flat_q = np.broadcast_to(q, (*batch, q.shape[-1])).reshape(count, -1)
    x = as_array(coordinates_from_state(mechanism, pose_from_array(flat_T), unstack(flat_q)), (count,))
    for name, value in values.items():
        x[:, mechanism.position[name]] = np.broadcast_to(value, batch).reshape(count)

    length = characteristic_length(mechanism.robot)
    scale = np.tile([1.0, 1.0, 1.0, 1 / length, 1 / length, 1 / length], len(mechanism.closings))

    def residual(secondary: Array, samples: Array) -> tuple[Array, Array]:
        full = x[samples]
        full[:, columns] = secondary
        scalars, fixed = unstack(full), pose_from_array(flat_T[samples])
        missing = as_array(closure_errors(mechanism, scalars, fixed), (len(samples),)).reshape(
            len(samples), -1
        )
        joints = [scalars[mechanism.position[name]] for name in mechanism.robot.joint_names]
        twists = coupling_twists(mechanism, base_pose(mechanism, scalars, fixed), joints, ZERO, scalars)
        N = network_of_twists(mechanism, twists, (len(samples),), mechanism.closing_matrix)
        return missing * scale, N[..., columns] * scale[:, None]

    result = newton(residual, x[:, columns])
    x[:, columns] = result.x
    _, Ns = residual(result.x, np.arange(count))
    sigma = np.linalg.svd(Ns, compute_uv=False)[:, : len(columns)].min(axis=-1)
    closed = result.residual * max(1.0, length) <= CLOSED
    status = np.where(
        closed, np.where(sigma < SINGULAR, Status.SINGULAR, Status.CONVERGED), Status.UNREACHABLE
    )
    status = np.where(
        (status == Status.CONVERGED) & _beyond_limits(mechanism, x), Status.OUT_OF_LIMITS, status
    )
    poses = as_array(base_pose(mechanism, unstack(x), pose_from_array(flat_T)), (count,))
    joints = x[:, [mechanism.position[name] for name in mechanism.robot.joint_names]]
    return ClosureSolution(
        State(poses.reshape(*batch, 4, 4), joints.reshape(*batch, -1)),
        x.reshape(*batch, -1),
        status.reshape(batch),
        result.residual.reshape(batch),
        result.iterations.reshape(batch),
    )


def nearest_closed(robot: Robot, q: Array, held: Sequence[str] = ()) -> Array:
    """Joint positions (n,) near q at which every closure of a table closes: for a posture written by eye.

    Args:
        robot: of n joints.
        q: (n,) [rad or m].
        held: names of joints that stay where they are.

    Raises:
        NoSolutionError: Newton's method finds none from there; the message names the residual.
        UnknownNameError: no such joint.
    """
    mechanism = unchosen(replace(robot, limbs=(), soles=()))
    if held:
        primary = tuple(one_of("joint", name, robot.joint_names) for name in held)
        others = tuple(name for name in mechanism.secondary if name not in primary)
        mechanism = replace(mechanism, primary=primary, secondary=others)
    solution = close_loops(mechanism, State(np.eye(4), q), {})
    if solution.residual > CLOSED:
        raise NoSolutionError(
            f"{robot.name}: no closed posture near this one; {float(solution.residual):.3g} is left"
        )
    return np.asarray(solution.state.q)


def _beyond_limits(mechanism: Mechanism, x: Array) -> Array:
    joints = mechanism.robot.joints
    q = x[:, [mechanism.position[joint.name] for joint in joints]]
    return np.asarray(~limits.within(q, *limits.limits_of(mechanism.robot)))
