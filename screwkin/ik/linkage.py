"""Positions of linkages: the joints that follow where a limb imposes a knee or an ankle.

Three unknown joints about parallel axes in one loop are a planar triangle, in closed form. All else is solved
by Newton's method along a straight way from the reference posture, in steps small enough to stay on its
branch. So every position of the imposed joints has one answer, whatever else is asked beside it: the way in
which the linkage is put together at the reference posture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton
from screwkin.algebra.pattern import components
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Screw, at, carry, displacement
from screwkin.algebra.se3 import Pose, as_array, cross, norm, rotation_log
from screwkin.compiler.program import kept
from screwkin.ik.planar_triangle import planar_branches
from screwkin.kinematics.limits import TURN, turns
from screwkin.kinematics.serial_chain import forward
from screwkin.mechanism.linkages import Linkage, loop_joints
from screwkin.model.records import Closure
from screwkin.model.robot import Robot
from screwkin.model.state import reference_posture

CLOSED = 1e-9
"""Largest gap of a closed linkage [m and rad, norm]."""
STEP = 0.25
"""Largest change of an imposed joint in one of Newton's steps along the way [rad or m]."""
PARALLEL = 1e-9
"""Sine of the angle between axes that count as parallel."""


@dataclass(frozen=True, eq=False)
class Completed:
    """Positions q (B, n) with every joint of a linkage, and gap (B,), what is left open [m and rad, norm]."""

    q: Array
    gap: Array

    @property
    def closed(self) -> Array:
        """(B,) bool."""
        return np.asarray(self.gap <= CLOSED)


def with_followers(
    robot: Robot, linkage: Linkage, q: Array, leading: Sequence[int] | None = None
) -> Completed:
    """Positions of the joints that follow in a linkage.

    Args:
        robot: of n joints.
        linkage: one of its ``linkages``.
        q: (B, n) [rad or m]; of the linkage the imposed joints on a limb's path count, without a limb all
            that are imposed; what else is imposed rests.

        leading: joints of the linkage that count instead, such as its motors.

    Returns:
        Completed; where the linkage does not reach so far, it is stretched, and its gap says so.
    """
    q, rest = q.copy(), np.array(reference_posture(robot), dtype=float)
    if leading is None:
        leading = linkage.imposed
        beside = [i for i in leading if linkage.path and i not in linkage.path]
        q[:, beside] = rest[beside]
    gaps = np.zeros(len(q))
    for closures, unknown in _parts(robot, linkage, tuple(leading)):
        triangle = _triangle(robot, closures, unknown)
        if triangle is not None:
            q[:, unknown] = _by_triangle(robot, triangle, unknown, q, rest)
        else:
            q[:, unknown] = _by_newton(robot, closures, leading, unknown, q, rest)
        gap, _ = loop_residual(robot, closures, q)
        gaps = np.hypot(gaps, np.linalg.norm(gap, axis=1))
    return Completed(q, gaps)


def loop_residual(robot: Robot, closures: Sequence[Closure], q: Array) -> tuple[Array, Array]:
    """What separates the two frames of every closure, and how their gap shrinks.

    Args:
        robot: of n joints.
        closures: k of its closures.
        q: (B, n).

    Returns:
        residual (B, 6 k): rotation vector and translation [rad, m] from frame a to frame b, in the axes of
        the link where the two ways part;
        Jacobian (B, 6 k, n) with J dq = residual towards closing.
    """
    count = len(q)
    rows, J = [], np.zeros((count, 6 * len(closures), len(robot.joints)))
    for k, closure in enumerate(closures):
        ends = []
        for sign, path, frame in zip((1, -1), _sides(robot, closure), _frames(closure), strict=True):
            screws, thetas = [robot.tree[i].screw for i in path], tree_thetas(robot, path, q)
            end, columns = forward(screws, thetas, frame)
            ends.append((sign, path, end, columns))
        a, b = ends[0][2], ends[1][2]
        rows += [as_array(rotation_log(b.R @ a.R.T), (count,)), as_array(b.p - a.p, (count,))]
        for sign, path, _, columns in ends:
            for i, column in zip(path, columns, strict=True):
                joint, ratio = robot.gears[i]
                J[:, 6 * k : 6 * k + 6, joint] += sign * float(ratio) * as_array(at(a.p, column), (count,))
    return np.concatenate(rows, axis=1), J


def _sides(robot: Robot, closure: Closure) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Indices in ``tree`` of the joints from the link where the two ways part to either end."""
    a, b = robot.path_to(closure.link_a), robot.path_to(closure.link_b)
    return tuple(i for i in a if i not in b), tuple(i for i in b if i not in a)


def _frames(closure: Closure) -> tuple[Pose, Pose]:
    return closure.frame_a, closure.frame_b


def tree_thetas(robot: Robot, path: Sequence[int], q: Array) -> list[Array]:
    """Positions (B,) of the joints on a way through the tree."""
    count = len(robot.joints)
    return [
        q[:, robot.gears[i][0]] * float(robot.gears[i][1])
        + (float(robot.coupled[i - count].offset) if i >= count else 0.0)
        for i in path
    ]


Part = tuple[tuple[Closure, ...], list[int]]


def _parts(robot: Robot, linkage: Linkage, leading: tuple[int, ...]) -> list[Part]:
    """Closures with their unknown joints, that no others of the linkage share."""
    followers = [i for i in linkage.joints if i not in leading]
    rows = [loop_joints(robot, closure) for closure in linkage.closures]
    pattern = np.array([[i in row for i in followers] for row in rows])
    return [
        (tuple(linkage.closures[k] for k in part), [followers[c] for c in columns])
        for part, columns in components(pattern)
    ]


def _by_newton(
    robot: Robot,
    closures: Sequence[Closure],
    imposed: Sequence[int],
    unknown: Sequence[int],
    q: Array,
    rest: Array,
) -> Array:
    """Unknown joints (B, k) by Newton's method along a straight way from the reference posture."""
    way = q[:, list(imposed)] - rest[list(imposed)]
    steps = np.maximum(np.ceil(np.abs(way).max(axis=1, initial=0.0) / STEP), 1.0)
    x = np.tile(rest[list(unknown)], (len(q), 1))
    for k in range(1, int(steps.max(initial=0.0)) + 1):
        now = np.flatnonzero(steps >= k)
        if not len(now):
            break
        full = q[now]
        full[:, list(imposed)] = rest[list(imposed)] + way[now] * (k / steps[now])[:, None]

        def residual(values: Array, samples: Array, full: Array = full) -> tuple[Array, Array]:
            here = full[samples]
            here[:, list(unknown)] = values
            gap, J = loop_residual(robot, closures, here)
            return gap, J[..., list(unknown)]

        result = newton(residual, x[now], max_iterations=40)
        x[now] = result.x
        steps[now[result.residual > CLOSED]] = 0.0  # stretched: there is no way on
    return x


@dataclass(frozen=True, eq=False)
class _Triangle:
    """A planar loop: its screws in order around it, as (joint, screw), the known one first.

    Where the loop is closed, the product of their displacements is ``close``.
    """

    known: tuple[int, Screw]
    unknown: tuple[tuple[int, Screw], ...]
    close: Pose


def _triangle(robot: Robot, closures: Sequence[Closure], unknown: Sequence[int]) -> _Triangle | None:
    """The loop as three unknown parallel axes beside one known one, where it is that."""
    return _triangle_of(robot, tuple(c.name for c in closures), tuple(unknown))


@kept
def _triangle_of(robot: Robot, names: tuple[str, ...], unknown: tuple[int, ...]) -> _Triangle | None:
    closures = [closure for closure in robot.closures if closure.name in names]
    if len(closures) != 1 or len(unknown) != 3:
        return None
    (closure,) = closures
    first, second = _sides(robot, closure)
    loop = [*first, *second]
    joints = [robot.tree[i] for i in loop]
    if len(loop) != 4 or max(loop) >= len(robot.joints) or any(j.type != "revolute" for j in joints):
        return None
    shift = closure.frame_a @ closure.frame_b.inverse
    back = [carry(shift, Screw(-robot.tree[i].screw.s, robot.tree[i].screw.s0)) for i in reversed(second)]
    around = [*((i, robot.tree[i].screw) for i in first), *zip(reversed(second), back, strict=True)]
    s = around[0][1].s
    if any(float(norm(cross(s, screw.s))) > PARALLEL for _, screw in around):
        return None
    return _rotated(around, shift.inverse, unknown)


def _rotated(around: list[tuple[int, Screw]], close: Pose, unknown: tuple[int, ...]) -> _Triangle:
    """The same loop begun at its known joint."""
    place = next(k for k, (i, _) in enumerate(around) if i not in unknown)
    moved = [(i, carry(close.inverse, screw)) for i, screw in around[:place]]
    return _Triangle(around[place], (*around[place + 1 :], *moved), close)


def _by_triangle(robot: Robot, loop: _Triangle, unknown: Sequence[int], q: Array, rest: Array) -> Array:
    """Unknown joints (B, 3) in closed form, on the branch of the reference posture."""
    count, (known, screw) = len(q), loop.known
    home, every = (_triangles(loop, displacement(screw, -x[:, known]), len(x)) for x in (rest[None], q))
    order = [i for i, _ in loop.unknown]
    branch = int(np.argmax(np.cos(home[:, 0] - rest[order]).sum(axis=1)))
    angles = every[branch] - rest[order]
    placed = np.empty((count, 3))
    placed[:, [list(unknown).index(i) for i in order]] = rest[order] + angles - TURN * turns(angles)
    return placed


def _triangles(loop: _Triangle, back: Pose, count: int) -> Array:
    """Both solutions (2, B, 3) of the three unknown joints in their order."""
    parallel = [_along(loop.unknown[0][1], screw) for _, screw in loop.unknown]
    signs = np.array([sign for sign, _ in parallel])
    branches = planar_branches([screw for _, screw in parallel], back @ loop.close)
    return signs * np.stack([_columns(branch[:3], count) for branch in branches])


def _along(first: Screw, screw: Screw) -> tuple[float, Screw]:
    """A parallel axis with the direction of the first, and the sign of its angle."""
    same = float(sum(x * y for x, y in zip(first.s, screw.s, strict=True))) > 0
    return (1.0, screw) if same else (-1.0, Screw(-screw.s, screw.s0))


def _columns(values: Sequence[Scalar], count: int) -> Array:
    return np.stack([np.broadcast_to(np.asarray(x, dtype=float), (count,)) for x in values], axis=-1)


def needs_newton(robot: Robot, linkage: Linkage) -> bool:
    """Whether a part of a linkage has no closed form."""
    return any(_triangle(robot, *part) is None for part in _parts(robot, linkage, linkage.imposed))
