"""Whole-body positions: joint positions that put base and tips where they are wanted.

The loops of the closed mechanism, with waist and tips imposed, are closed by Newton's method. A block of the
network matrix is the Jacobian; limbs that share no joint are separate small systems. A position-only target
is a tip whose chain imposes its translations and lets its rotations monitor: their columns are eliminated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton
from screwkin.algebra.pattern import components
from screwkin.algebra.pytrees import pytree
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import as_array, pose_from_array, rotation_log, unstack, vector_from_array
from screwkin.errors import InputError, LimitError, ShapeError, SingularError, UnreachableError
from screwkin.kinematics.positions import chain_jacobian, successive_displacement
from screwkin.kinematics.status import CLOSED, SINGULAR, Status
from screwkin.mechanism.scaling import characteristic_length
from screwkin.model.robot import Joint, Limb, Robot
from screwkin.model.state import State


@dataclass(frozen=True, eq=False)
@pytree("limbs")
class PoseSolution:
    """Positions of a batch, with a status for every limb.

    Attributes:
        state: T_world_base (..., 4, 4) and q (..., n).
        limbs: names of the limbs that had a target.
        status: (..., limbs) ``Status`` values.
        residual: (..., limbs) closure error [m and rad, norm].
        distance: (..., limbs) how far the tip is from its target [m].
        angle: (..., limbs) how far it is turned from its target [rad]; 0 for a position-only target.
        iterations: (..., limbs).
        worst_joint: (..., limbs) index of the joint furthest beyond its limits.
    """

    state: State
    limbs: tuple[str, ...]
    status: Array
    residual: Array
    distance: Array
    angle: Array
    iterations: Array
    worst_joint: Array

    @property
    def ok(self) -> bool:
        """Every limb of every sample converged."""
        return bool((self.status == Status.CONVERGED).all())

    def replaced(self, samples: Array, other: PoseSolution) -> PoseSolution:
        """This solution with some samples (flat indices) taken from another one, a batch of just these."""
        count = int(np.prod(self.status.shape[:-1]))

        def mixed(mine: Array, theirs: Array, inner: tuple[int, ...]) -> Array:
            flat = mine.reshape(count, *inner).copy()
            flat[samples] = theirs
            return flat.reshape(mine.shape)

        names = ("status", "residual", "distance", "angle", "iterations", "worst_joint")
        parts: dict[str, Any] = {
            n: mixed(getattr(self, n), getattr(other, n), (len(self.limbs),)) for n in names
        }
        q = mixed(self.state.q, other.state.q, self.state.q.shape[-1:])
        return replace(self, state=State(self.state.T_world_base, q), **parts)

    def raise_on_failure(self, robot: Robot, time: Array | None = None) -> None:
        """Raise for the first sample that did not converge, naming limb, sample and how far.

        Raises:
            UnreachableError, SingularError, LimitError: as the status says.
        """
        if self.ok:
            return
        failed = np.argwhere(self.status.reshape(-1, len(self.limbs)) != Status.CONVERGED)
        sample, limb = (int(i) for i in failed[0])
        flat = {
            name: getattr(self, name).reshape(-1, len(self.limbs))
            for name in ("status", "distance", "angle", "worst_joint")
        }
        status, name = Status(int(flat["status"][sample, limb])), self.limbs[limb]
        where = f"{name}, sample {sample}" + ("" if time is None else f" (t = {float(time[sample]):.3f} s)")
        more = f"; {len(failed)} of {flat['status'].size} limb positions fail" if len(failed) > 1 else ""
        if status is Status.UNREACHABLE:
            far, turned = float(flat["distance"][sample, limb]), float(flat["angle"][sample, limb])
            by = f"{1e3 * far:.3g} mm" + (f" and {np.degrees(turned):.2g} deg" if turned > 1e-9 else "")
            raise UnreachableError(f"{where}: out of reach by {by}; {status.help}{more}", name, sample, far)
        if status is Status.SINGULAR:
            raise SingularError(f"{where}: singular; {status.help}{more}", name, sample)
        worst = int(flat["worst_joint"][sample, limb])
        q = float(np.reshape(self.state.q, (-1, len(robot.joints)))[sample, worst])
        told = f"{where}: {_beyond(robot.joints[worst], q)}; {status.help}{more}"
        raise LimitError(told, name, sample)


def _beyond(joint: Joint, q: float) -> str:
    """A joint's position and limits, in degrees or millimetres."""
    factor, unit = (1e3, "mm") if joint.type == "prismatic" else (180 / np.pi, "deg")
    lower, upper = factor * joint.lower, factor * joint.upper
    return f"{joint.name} at {factor * q:.1f} {unit}, limits {lower:.1f} to {upper:.1f} {unit}"


@dataclass(frozen=True)
class Target:
    """A limb's tip in the base frame: pose (B, 4, 4) or position (B, 3)."""

    limb: Limb
    value: Array

    @property
    def position_only(self) -> bool:
        """True if the orientation is free."""
        return self.value.ndim == 2

    def residual(self, robot: Robot, q: Sequence[Array], rows: Array) -> tuple[Array, dict[int, Array]]:
        """What is missing (A, 6 or 3), and its derivative's columns by joint index: [omega; v at the tip]."""
        path = robot.path_to(self.limb.link)
        screws, thetas = [robot.joints[i].screw for i in path], [q[i] for i in path]
        tip = successive_displacement(screws, thetas, A_ref_k=self.limb.frame)
        columns = [at(tip.p, column) for column in chain_jacobian(screws, thetas)]
        batch = (len(rows),)
        if self.position_only:
            missing = as_array(vector_from_array(self.value[rows]) - tip.p, batch)
            return missing, {i: as_array(c.v, batch) for i, c in zip(path, columns, strict=True)}
        wanted = pose_from_array(self.value[rows])
        turn = rotation_log(wanted.R @ tip.R.T)
        missing = np.concatenate([as_array(turn, batch), as_array(wanted.p - tip.p, batch)], axis=-1)
        return missing, {i: as_array(c, batch) for i, c in zip(path, columns, strict=True)}


def solve_pose(robot: Robot, targets: Mapping[str, Array], guess: State) -> PoseSolution:
    """Close all loops for imposed base and tips.

    Args:
        robot: the robot.
        targets: ``"base"`` (..., 4, 4) and any tips, each a pose (..., 4, 4) or a position (..., 3), world.
        guess: a state near the solution; joints of limbs without target keep its positions.

    Returns:
        PoseSolution; nothing is raised for samples without solution.

    Raises:
        InputError: no tip has a target, or the robot has loops of its own. ShapeError: batches do not fit.
    """
    if robot.closures:
        told = ", ".join(closure.name for closure in robot.closures)
        raise InputError(
            f"{robot.name} has closures ({told}), which limbs alone do not keep; use close_loops"
        )
    base = np.asarray(targets.get("base", guess.T_world_base), dtype=float)
    names = [name for name in targets if name != "base"]
    shapes = [base.shape[:-2], guess.q.shape[:-1]]
    shapes += [
        targets[n].shape[:-2] if targets[n].shape[-2:] == (4, 4) else targets[n].shape[:-1] for n in names
    ]
    try:
        batch = np.broadcast_shapes(*shapes)
    except ValueError:
        raise ShapeError(f"batches of base, targets and guess do not broadcast: {shapes}") from None
    count = int(np.prod(batch))
    size = len(robot.joints)
    q = np.broadcast_to(guess.q, (*batch, size)).reshape(count, size).astype(float)
    T = np.broadcast_to(base, (*batch, 4, 4)).reshape(count, 4, 4)
    into = [Target(robot.limb(n), _in_base(T, np.asarray(targets[n], dtype=float), batch)) for n in names]
    if not into:
        raise InputError("no targets; name at least one tip, such as " + ", ".join(robot.tip_names[:2]))
    parts = {
        name: np.zeros((count, len(into)))
        for name in ("status", "residual", "distance", "angle", "iterations", "worst_joint")
    }
    paths = [robot.path_to(target.limb.link) for target in into]
    shared = np.zeros((len(into), len(robot.joints)), dtype=np.int64)
    for row, path in enumerate(paths):
        shared[row, list(path)] = 1
    for block, joints in components(shared):
        _solve_block(robot, [into[i] for i in block], block, joints, q, parts)
    for row, path in enumerate(paths):
        _judge(robot, row, list(path), q, parts)
    shaped = {name: value.reshape(*batch, len(into)) for name, value in parts.items()}
    return PoseSolution(
        State(T.reshape(*batch, 4, 4), q.reshape(*batch, size)),
        tuple(target.limb.name for target in into),
        shaped["status"].astype(int),
        shaped["residual"],
        shaped["distance"],
        shaped["angle"],
        shaped["iterations"].astype(int),
        shaped["worst_joint"].astype(int),
    )


def _in_base(T: Array, target: Array, batch: tuple[int, ...]) -> Array:
    """A world target, flat batch, in the base frame: nothing depends on where the robot stands."""
    if target.shape[-2:] == (4, 4):
        flat = np.broadcast_to(target, (*batch, 4, 4)).reshape(len(T), 4, 4).copy()
        flat[:, :3, 3] -= T[:, :3, 3]
        flat[:, :3] = T[:, :3, :3].swapaxes(1, 2) @ flat[:, :3]
        return flat
    flat = np.broadcast_to(target, (*batch, 3)).reshape(len(T), 3) - T[:, :3, 3]
    return (T[:, :3, :3].swapaxes(1, 2) @ flat[..., None])[..., 0]


def _solve_block(
    robot: Robot, targets: list[Target], rows: list[int], joints: list[int], q: Array, parts: dict[str, Array]
) -> None:
    """Newton on the limbs that share joints; fills q and the statistics of their columns."""
    length = characteristic_length(robot)
    sizes = [3 if target.position_only else 6 for target in targets]
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    weights = np.concatenate([np.r_[np.ones(size - 3), np.full(3, 1 / length)] for size in sizes])
    place = {joint: k for k, joint in enumerate(joints)}

    def residual(x: Array, samples: Array) -> tuple[Array, Array]:
        full = q[samples]
        full[:, joints] = x
        scalars = unstack(full)
        r = np.zeros((len(samples), offsets[-1]))
        J = np.zeros((len(samples), offsets[-1], len(joints)))
        for k, target in enumerate(targets):
            missing, columns = target.residual(robot, scalars, samples)
            here = slice(offsets[k], offsets[k + 1])
            r[:, here] = missing
            for i, column in columns.items():
                J[:, here, place[i]] = column
        return r * weights, J * weights[:, None]

    result = newton(residual, q[:, joints])
    q[:, joints] = unwound([robot.joints[i] for i in joints], result.x, q[:, joints])
    r, J = residual(q[:, joints], np.arange(len(q)))
    sigma = np.linalg.svd(J, compute_uv=False)[:, -1] if offsets[-1] else np.ones(len(q))
    for k, row in enumerate(rows):
        here = slice(offsets[k], offsets[k + 1])
        missing = r[:, here] / weights[here]
        parts["residual"][:, row] = np.linalg.norm(missing, axis=1)
        parts["distance"][:, row] = np.linalg.norm(missing[:, -3:], axis=1)
        parts["angle"][:, row] = np.linalg.norm(missing[:, :-3], axis=1)
        parts["iterations"][:, row] = result.iterations
        closed = parts["residual"][:, row] <= CLOSED
        parts["status"][:, row] = np.where(
            closed, np.where(sigma < SINGULAR, Status.SINGULAR, Status.CONVERGED), Status.UNREACHABLE
        )


def unwound(joints: Sequence[Joint], x: Array, guess: Array) -> Array:
    """Whole turns of revolute joints taken back: nearest to the guess, or else within the limits."""
    lower, upper = np.array([j.lower for j in joints]), np.array([j.upper for j in joints])
    near = x - 2 * np.pi * np.round((x - guess) / (2 * np.pi))
    wrapped = (x + np.pi) % (2 * np.pi) - np.pi
    outside = (near < lower) | (near > upper)
    fits = (wrapped >= lower) & (wrapped <= upper)
    turned = np.where(outside & fits, wrapped, near)
    return np.where([j.type == "revolute" for j in joints], turned, x)


def _judge(robot: Robot, row: int, path: list[int], q: Array, parts: dict[str, Array]) -> None:
    """Mark converged samples with a joint beyond its limits."""
    lower = np.array([robot.joints[i].lower for i in path])
    upper = np.array([robot.joints[i].upper for i in path])
    beyond = np.maximum(lower - q[:, path], q[:, path] - upper)
    parts["worst_joint"][:, row] = np.array(path)[beyond.argmax(axis=1)]
    outside = (beyond.max(axis=1) > 1e-9) & (parts["status"][:, row] == Status.CONVERGED)
    parts["status"][outside, row] = Status.OUT_OF_LIMITS
