"""Elastic joints: how a robot yields under its own weight (virtual joint method).

Every joint is a rigid drive q followed by a spring with deflection theta, the virtual joint. The robot stands
on one frame; its weight bends the springs until they carry it: k theta + gravity torques = 0. Single support
needs no chains of its own: the stance leg's springs carry all that stands on them, force and moment, and what
they yield carries pelvis and swing leg along rigidly, because the tree is walked from the support.

Source: paper B, section 4, eq. 12-16; docs/papers.md says how they are read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton
from screwkin.algebra.pytrees import pytree
from screwkin.algebra.se3 import NO_TWIST, Pose, as_array, map_scalars, pose_from_array, rotation_log, unstack
from screwkin.compliance.settling import equilibrium, first_order
from screwkin.compliance.springs import StiffnessChoice, joint_stiffness
from screwkin.compliance.supported import Supported
from screwkin.dynamics.newton_euler import GRAVITY
from screwkin.errors import InputError, NoSolutionError, ShapeError, SingularError, UnknownNameError
from screwkin.kinematics.positions import frame_pose, link_displacements
from screwkin.model.robot import Robot
from screwkin.model.state import State

Method = Literal["linear", "nonlinear"]

SETTLED = 1e-12
"""Largest norm of theta + torque / k [rad or m] that counts as equilibrium."""
BLOCK = 4096
"""Samples of a large batch that the formulas compute together."""


@dataclass(frozen=True, eq=False)
@pytree("frames", "method")
class Deflection:
    """How a robot on one frame yields under its weight; B stands for any leading dimensions.

    Attributes:
        frames: ``base`` and the tips, the order of ``change``.
        theta: (B, n) deflection of each joint: it stands at q + theta [rad or m].
        torque: (B, n) of the springs on the joints [N m or N]: -k theta.
        state: the deflected robot; its support stands where it stood.
        change: (B, frames, 6) rotation vector [rad] and translation of the frame's origin [m], world axes;
            to first order for the linear method.
        residual: (B,) what lacks to equilibrium, norm of theta + gravity torque / k.
        iterations: (B,) Newton steps; 0 for the linear method.
        stable: (B,) bool: springs and weight together resist every further deflection; for the linear method
            as they do at the commanded posture.
    """

    frames: tuple[str, ...]
    method: Method
    theta: Array
    torque: Array
    state: State
    change: Array
    residual: Array
    iterations: Array
    stable: Array

    def of(self, frame: str) -> Array:
        """Change (B, 6) of one frame."""
        if frame not in self.frames:
            raise UnknownNameError("frame", frame, self.frames)
        return self.change[..., self.frames.index(frame), :]

    @property
    def converged(self) -> Array:
        """(B,) bool: equilibrium reached, which the linear method does not seek."""
        return (self.residual <= SETTLED) if self.method == "nonlinear" else np.isfinite(self.residual)

    def raise_on_failure(self) -> None:
        """Raise for the first sample whose equilibrium was not found or does not last.

        Raises:
            NoSolutionError: the springs are too soft for the robot's weight.
        """
        bad = np.flatnonzero(~(self.converged & self.stable))
        if len(bad):
            raise NoSolutionError(
                f"sample {bad[0]}: no stable equilibrium; {len(bad)} of {self.converged.size} samples "
                "collapse. The joints are too soft for the robot's weight; raise the stiffness"
            )


def static_deflection(
    robot: Robot,
    state: State,
    support: str,
    stiffness: StiffnessChoice = None,
    method: Method = "nonlinear",
    gravity: float = GRAVITY,
) -> Deflection:
    """Deflection of elastic joints under the robot's weight while one frame stands still.

    Args:
        robot: n joints, without loops of its own.
        state: the commanded configuration, T_world_base (..., 4, 4) and q (..., n).
        support: the frame that stands still: a foot's tip, a link, or ``base``.
        stiffness: see ``joint_stiffness``.
        method: ``linear`` takes the torques at the commanded posture; ``nonlinear`` finds the posture where
            springs and weight are in balance, for all samples at once, by Newton's method.
        gravity: [m/s^2], along -z of the world.

    Returns:
        Deflection; samples that collapse are told by its ``converged`` and ``stable``.

    Raises:
        InputError: stiffness or method is wrong, or the robot has closures. ShapeError: wrong shape, or NaN.

    Source: paper B, eq. 13 (given the load, find theta) and eq. 16 with the links' weights added.
    """
    if method not in ("linear", "nonlinear"):
        raise InputError(f"unknown method {method!r}; valid: linear, nonlinear")
    k = joint_stiffness(robot, stiffness)
    T, q, batch = _flat(robot, state)
    found = _by_kernels(robot, support, T, q, k, gravity, method)
    theta, base, change, residual, iterations, stable = found
    return Deflection(
        ("base", *robot.tip_names),
        method,
        theta.reshape(*batch, -1),
        (-k * theta).reshape(*batch, -1),
        State(base.reshape(*batch, 4, 4), (q + theta).reshape(*batch, -1)),
        change.reshape(*batch, *change.shape[1:]),
        residual.reshape(batch),
        iterations.reshape(batch),
        stable.reshape(batch),
    )


def _by_formulas(
    robot: Robot, support: str, T: Array, q: Array, k: Array, gravity: float, method: Method
) -> list[Array]:
    """theta, base's poses, change, residual, iterations and stable: as of ``Deflection``, the batch flat."""
    stand = _support_pose(robot, T, q, support)

    def balance(theta: Array, samples: Array) -> tuple[Array, Array]:
        here = Supported.of(robot, support, _picked(stand, samples), unstack(q[samples] + theta))
        torque, hessian = _gravity(here, len(samples), gravity)
        return -(theta + torque / k), np.eye(len(k)) + hessian / k[:, None]

    everyone = np.arange(len(q))
    theta, iterations = np.zeros_like(q), np.zeros(len(q), dtype=int)
    if method == "nonlinear":
        found = newton(balance, theta, tolerance=SETTLED / 10)
        theta, iterations = found.x, found.iterations
        lack, slope = balance(theta, everyone)
    else:
        theta, slope = balance(theta, everyone)
        lack, _ = balance(theta, everyone)
    base, change = _yielded(robot, support, stand, q, theta, method)
    stable = np.linalg.eigvalsh(slope * k[:, None]).min(axis=1, initial=np.inf) > 0
    return [theta, base, change, np.linalg.norm(lack, axis=1), iterations, stable]


def _by_kernels(
    robot: Robot, support: str, T: Array, q: Array, k: Array, gravity: float, method: Method
) -> list[Array]:
    """The same of a large batch; samples that the kernels leave open are computed by the formulas."""
    if method == "linear":
        *found, sure = first_order(robot, support, T, q, k, gravity)
    else:
        *found, sure = equilibrium(robot, support, T, q, k, gravity, SETTLED / 10)
    open_ = np.flatnonzero(~sure)
    for rows in (open_[i : i + BLOCK] for i in range(0, len(open_), BLOCK)):
        some = _by_formulas(robot, support, T[rows], q[rows], k, gravity, method)
        for values, own in zip(found, some, strict=True):
            values[rows] = own
    return found


def _yielded(
    robot: Robot, support: str, stand: Pose, q: Array, theta: Array, method: Method
) -> tuple[Array, Array]:
    """Base poses (B, 4, 4) after the deflection, and the change (B, frames, 6) of base and tips."""
    count = (len(q),)
    before = Supported.of(robot, support, stand, unstack(q))
    after = Supported.of(robot, support, stand, unstack(q + theta))
    frames = ("base", *robot.tip_names)
    if method == "linear":
        moved = [(_jacobian(before, frame, len(q)) @ theta[..., None])[..., 0] for frame in frames]
    else:
        moved = [_moved(before.pose(frame), after.pose(frame), len(q)) for frame in frames]
    return as_array(after.base, count), np.stack(moved, axis=1)


def cartesian_compliance(
    robot: Robot, state: State, support: str, frame: str, stiffness: StiffnessChoice = None
) -> Array:
    """J K^-1 J^T (..., 6, 6): twist of a frame per wrench on it, world axes, at the frame's origin.

    Rows [omega; v] in rad and m, columns [m; f] in N m and N. Its inverse, where it has one, is the Cartesian
    stiffness.

    Source: paper B, eq. 15 with J_q absent, as there are no passive joints.
    """
    k = joint_stiffness(robot, stiffness)
    T, q, batch = _flat(robot, state)
    here = Supported.of(robot, support, _support_pose(robot, T, q, support), unstack(q))
    J = _jacobian(here, frame, len(q))
    return ((J / k) @ J.swapaxes(1, 2)).reshape(*batch, 6, 6)


def cartesian_stiffness(
    robot: Robot, state: State, support: str, frame: str, stiffness: StiffnessChoice = None
) -> Array:
    """Cartesian stiffness K_C = (J K^-1 J^T)^-1 (..., 6, 6): wrench [m; f] per twist [omega; v] of a frame.

    Raises:
        SingularError: joints alone cannot yield in some direction, as with a straight leg or no leg between.
    """
    C = cartesian_compliance(robot, state, support, frame, stiffness)
    flat = C.reshape(-1, 6, 6)
    scale = 1 / np.sqrt(np.maximum(np.diagonal(flat, axis1=1, axis2=2), 1e-300))
    values = np.linalg.eigvalsh(flat * scale[:, :, None] * scale[:, None, :])
    rigid = np.flatnonzero(values[:, 0] < 1e-12)
    if len(rigid):
        raise SingularError(
            f"sample {rigid[0]}: {frame} on {support} is rigid in some direction, so that it has no "
            "stiffness matrix; bend the limb, or use the compliance",
            sample=int(rigid[0]),
        )
    return np.linalg.inv(flat).reshape(C.shape)


def _flat(robot: Robot, state: State) -> tuple[Array, Array, tuple[int, ...]]:
    """Base poses (B, 4, 4), positions (B, n) and the batch's shape of a checked state."""
    if robot.closures:
        told = ", ".join(closure.name for closure in robot.closures)
        raise InputError(f"{robot.name} has closures ({told}); deflections are computed for trees only")
    if not robot.mass > 0:
        raise InputError(f"{robot.name} has no mass, so that nothing bends its joints; give its links masses")
    T, q = np.asarray(state.T_world_base, dtype=float), np.asarray(state.q, dtype=float)
    n = len(robot.joints)
    if T.shape[-2:] != (4, 4) or q.shape[-1:] != (n,):
        raise ShapeError(f"state has shapes {T.shape} and {q.shape}, expected (..., 4, 4) and (..., {n})")
    if not (np.isfinite(T).all() and np.isfinite(q).all()):
        raise ShapeError("state holds NaN or infinity; every number must be finite")
    try:
        batch = np.broadcast_shapes(T.shape[:-2], q.shape[:-1])
    except ValueError:
        raise ShapeError(
            f"batch of T_world_base {T.shape[:-2]} and of q {q.shape[:-1]} do not broadcast"
        ) from None
    return (
        np.broadcast_to(T, (*batch, 4, 4)).reshape(-1, 4, 4),
        np.broadcast_to(q, (*batch, n)).reshape(-1, n),
        batch,
    )


def _support_pose(robot: Robot, T: Array, q: Array, support: str) -> Pose:
    """Where the support stands before anything yields, components (B,)."""
    stands = pose_from_array(T) @ frame_pose(robot, link_displacements(robot, unstack(q)), support)
    return pose_from_array(as_array(stands, (len(q),)))


def _picked(pose: Pose, samples: Array) -> Pose:
    """The poses of some samples."""
    picked: Pose = map_scalars(lambda x: x[samples], pose)
    return picked


def _gravity(here: Supported, count: int, gravity: float) -> tuple[Array, Array]:
    """Gravity torques (B, n) and their derivatives (B, n, n)."""
    n = len(here.robot.joints)
    torque, hessian = np.zeros((count, n)), np.zeros((count, n, n))
    for j, value in enumerate(here.gravity_torques(gravity)):
        torque[:, j] = value
    for (i, j), value in here.gravity_stiffness(gravity).items():
        hessian[:, i, j] = hessian[:, j, i] = value
    return torque, hessian


def _jacobian(here: Supported, frame: str, count: int) -> Array:
    """Jacobian (B, 6, n) of a frame while the support stands still."""
    columns = here.jacobian(frame)
    twists = [columns.get(i, NO_TWIST) for i in range(len(here.robot.joints))]
    return as_array(twists, (count,)).swapaxes(1, 2)


def _moved(before: Pose, after: Pose, count: int) -> Array:
    """Rotation vector and translation (B, 6) from one pose to another."""
    turn = as_array(rotation_log(after.R @ before.R.T), (count,))
    return np.concatenate([turn, as_array(after.p - before.p, (count,))], axis=1)
