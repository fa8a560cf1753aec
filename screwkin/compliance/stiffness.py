"""Elastic joints: how a robot deflects under its own weight (virtual joint method).

Every joint is a rigid drive q followed by a spring with deflection theta, the virtual joint. The robot stands
on one frame; its weight bends the springs until they carry it: k theta + gravity torques = 0. Single support
needs no chains of its own: the stance leg's springs carry all that stands on them, force and moment, and
their deflection moves pelvis and swing leg rigidly, because the tree is walked from the support.

Source: paper B, section 4, eq. 12-16; docs/papers.md says how they are read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.pytrees import pytree
from screwkin.algebra.se3 import NO_TWIST, as_array, pose_from_array, unstack
from screwkin.compliance.deflection import frames
from screwkin.compliance.equilibrium import SETTLED, Loaded, equilibrium, first_order
from screwkin.compliance.springs import StiffnessChoice, joint_stiffness
from screwkin.compliance.supported import Supported
from screwkin.errors import InputError, NoSolutionError, ShapeError, SingularError, UnknownNameError
from screwkin.kinematics.mass import GRAVITY
from screwkin.kinematics.positions import link_displacements
from screwkin.model.robot import Robot, refuse_closures
from screwkin.model.state import State

Method = Literal["linear", "nonlinear"]


@dataclass(frozen=True, eq=False)
@pytree("frames", "method")
class Deflection:
    """How a robot on one frame deflects under its weight; B stands for any leading dimensions.

    Attributes:
        frames: ``base`` and the tips, the order of ``change``.
        theta: (B, n) deflection of each joint: it stands at q + theta [rad or m].
        torque: (B, n) of the springs on the joints [N m or N]: -k theta.
        state: the deflected robot; its support stands where it stood.
        change: (B, frames, 6) rotation vector [rad] and translation of the frame's origin [m], world axes;
            to first order for the linear method.
        residual: (B,) norm of theta + gravity torque / k at the deflected posture, 0 in equilibrium.
        iterations: (B,) Newton steps; 0 for the linear method.
        stable: (B,) bool: springs and weight together resist every further deflection; for the linear method
            as they do at the commanded posture.

    Where ``converged`` is False there is no equilibrium: theta and what follows from it are the last ones
    that were tried.
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
        """(B,) bool: equilibrium reached; for the linear method, which seeks none, a finite residual."""
        return (self.residual <= SETTLED) if self.method == "nonlinear" else np.isfinite(self.residual)

    def raise_on_failure(self) -> None:
        """Raise for the first sample without a stable equilibrium.

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
        method: ``linear`` takes the torques at the commanded posture; ``nonlinear`` solves for the posture
            where springs and weight are in balance, by Newton's method from the commanded one.
        gravity: [m/s^2], along -z of the world.

    Returns:
        Deflection; its ``converged`` and ``stable`` mark samples that collapse.

    Raises:
        InputError: stiffness or method is wrong, or the robot has closures or no mass. ShapeError: wrong
        shape, or NaN. UnknownNameError: no such frame or joint.

    Source: paper B, eq. 13 (given the load, find theta) and eq. 16 with the links' weights added.
    """
    if method not in ("linear", "nonlinear"):
        raise InputError(f"unknown method {method!r}; valid: linear, nonlinear")
    k = joint_stiffness(robot, stiffness)
    T, q, batch = _flat(robot, state)
    if not robot.mass > 0:
        raise InputError(f"{robot.name} has no mass, so that nothing bends its joints; give its links masses")
    loaded = Loaded(robot, support, T, q, k, gravity)
    solved = first_order(loaded) if method == "linear" else equilibrium(loaded)
    return Deflection(
        frames(robot),
        method,
        solved.theta.reshape(*batch, -1),
        (-k * solved.theta).reshape(*batch, -1),
        State(solved.T_world_base.reshape(*batch, 4, 4), (q + solved.theta).reshape(*batch, -1)),
        solved.change.reshape(*batch, *solved.change.shape[1:]),
        solved.residual.reshape(batch),
        solved.iterations.reshape(batch),
        solved.stable.reshape(batch),
    )


def cartesian_compliance(
    robot: Robot, state: State, support: str, frame: str, stiffness: StiffnessChoice = None
) -> Array:
    """Cartesian compliance J K^-1 J^T of a frame while another one stands still.

    Args:
        robot: n joints, without loops of its own.
        state: T_world_base (..., 4, 4) and q (..., n).
        support: the frame that stands still.
        frame: the frame that a wrench acts on: a tip, a link, or ``base``.
        stiffness: see ``joint_stiffness``.

    Returns:
        Compliance (..., 6, 6), rows twist [omega; v] in rad and m, columns wrench [m; f] in N m and N, world
        axes, at the frame's origin.

    Raises:
        InputError: the stiffness is wrong, or the robot has closures. ShapeError: wrong shape, or NaN.
        UnknownNameError: no such frame or joint.

    Source: paper B, eq. 15 with J_q absent, as there are no passive joints.
    """
    k = joint_stiffness(robot, stiffness)
    T, q, batch = _flat(robot, state)
    here = Supported(robot, support, pose_from_array(T), link_displacements(robot, unstack(q)))
    columns = here.jacobian(frame)
    twists = [columns.get(i, NO_TWIST) for i in range(len(k))]
    J = as_array(twists, (len(q),)).swapaxes(1, 2)
    return np.asarray((J / k) @ J.swapaxes(1, 2)).reshape(*batch, 6, 6)


def cartesian_stiffness(
    robot: Robot, state: State, support: str, frame: str, stiffness: StiffnessChoice = None
) -> Array:
    """Cartesian stiffness (J K^-1 J^T)^-1 (..., 6, 6), wrench [m; f] per twist [omega; v] of a frame.

    Arguments and errors as of ``cartesian_compliance``.

    Raises:
        SingularError: the frame is rigid in some direction, as with a straight leg or no leg between.
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
    refuse_closures(robot, "deflections", "no function computes those of closed loops yet")
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
