"""A limb as a serial chain expressed in the base frame: its screws, its tip, its limits; and where it leads.

Formulas run over any scalar; ``residual`` and ``distance`` are their array functions. Which point of an axis
a table names means nothing: every axis is given by its point nearest to the next one towards the tip.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import wraps
from itertools import pairwise
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.scalar import Scalar, is_symbolic, sqrt, structural
from screwkin.algebra.screws import AT_REST, Displacement, Screw, advance, at, displacement, transport
from screwkin.algebra.se3 import (
    IDENTITY,
    Pose,
    Twist,
    Vector,
    as_array,
    dot,
    leaves,
    norm,
    pose_from_array,
    rotation_log,
    unstack,
    vector_from_array,
)
from screwkin.compiler.program import kept
from screwkin.kinematics import limits
from screwkin.model.robot import Limb, Robot, refuse_coupled

P = ParamSpec("P")
T = TypeVar("T")
SMALLEST = 1e-3
"""Least size of a limb [m]."""
COUPLED = "use limb_ik of NumPy arrays, solve_pose, or close_loops, which solve positions of coupled joints"

Gear = tuple[int, float, float]
"""Of a joint on the way: the place of what moves it among ``joints``, the ratio and the offset."""


@dataclass(frozen=True, eq=False)
class SerialChain:
    """The joints from the base to a limb's tip.

    Attributes:
        limb: its name.
        names: of the joints, in the order of the chain.
        joints: their indices in the robot's q.
        screws: their axes in the zero pose, base frame.
        tip: pose of the tip in the zero pose, base frame.
        lower: limits (n,) [rad or m].
        upper: limits (n,).
        turning: (n,) bool, False for prismatic and helical joints, whose positions are not wrapped.
        length: size of the limb [m], the way from axis to axis to the tip; it makes positions comparable
            with angles.
        gears: for every screw what moves it, where joints are coupled; empty where each has its own position.
    """

    limb: str
    names: tuple[str, ...]
    joints: tuple[int, ...]
    screws: tuple[Screw, ...]
    tip: Pose
    lower: Array
    upper: Array
    turning: Array
    length: float
    gears: tuple[Gear, ...] = ()
    memo: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False)

    def __reduce__(self) -> Any:
        """For pickles and copies: without what is cached."""
        return SerialChain, tuple(getattr(self, f.name) for f in fields(self) if f.init)

    @classmethod
    def of(cls, robot: Robot, limb: str, free: tuple[str, ...] = (), coupled: bool = False) -> SerialChain:
        """The chain of a limb, by its name or its tip's.

        Args:
            robot: the robot.
            limb: the limb.
            free: rotations of the tip that are free, see ``freed``; their virtual joints have places in q
                behind those of all joints, three to a limb.
            coupled: whether joints may be coupled: those of the chain are then the ones that lead.

        Raises:
            UnknownNameError: no such limb.
            InputError: one of its joints is coupled to another joint, and none may be.
        """
        chosen = robot.limb(limb)
        name = chosen.name
        if not coupled:
            refuse_coupled(robot, robot.path_to(chosen.link), f"the serial chain of {name}", COUPLED)
        return _freed_chain(robot, name, free) if free else _chain(robot, name)

    def freed(self, free: tuple[str, ...], places: Sequence[int]) -> SerialChain:
        """The chain with virtual joints behind its last one, about the tip's own axes through the tip.

        A limb that takes its tip to a pose but for rotations R_a R_b about these axes is a longer one that
        takes it to that pose: its virtual joints turn back by R_b, then by R_a. They have no limits.

        Args:
            free: names out of ``rx ry rz``, in the order in which they turn.
            places: indices of the virtual joints in q, likewise.
        """
        axes = {"rx": self.tip.R.x, "ry": self.tip.R.y, "rz": self.tip.R.z}
        back, ends = free[::-1], np.full(len(free), np.inf)
        return replace(
            self,
            names=(*self.names, *(f"{self.limb}.{name}" for name in back)),
            joints=(*self.joints, *places[::-1]),
            screws=(*self.screws, *(Screw(axes[name], self.tip.p) for name in back)),
            lower=np.concatenate([self.lower, -ends]),
            upper=np.concatenate([self.upper, ends]),
            turning=np.concatenate([self.turning, ends > 0]),
            gears=self.gears and (*self.gears, *((len(self.joints) + k, 1.0, 0.0) for k in range(len(free)))),
        )

    def thetas(self, q: Sequence[Scalar]) -> list[Scalar]:
        """Positions of all screws from those of the joints that lead."""
        if not self.gears:
            return list(q)
        return [q[place] * ratio + offset for place, ratio, offset in self.gears]

    def moved(self, q: Array) -> tuple[list[Scalar], Array | None]:
        """Positions of all screws, and their rates per unit rate of every joint; None where both agree.

        Args:
            q: (B, joints).
        """
        G = np.zeros((len(self.screws), len(self.joints)))
        for row, (place, ratio, _) in enumerate(self.gears):
            G[row, place] = ratio
        return self.thetas(unstack(q)), G if self.gears else None

    @property
    def reversed(self) -> SerialChain:
        """The same chain walked from its tip link to the base, which moves it by the inverse.

        Its joint positions are the same ones in the opposite order, and its tip is the base frame itself.
        """
        back = [Screw(-screw.s, screw.s0, screw.pitch) for screw in self.screws[::-1]]
        return replace(
            self,
            names=self.names[::-1],
            joints=self.joints[::-1],
            screws=tuple(back),
            tip=IDENTITY,
            lower=self.lower[::-1],
            upper=self.upper[::-1],
            turning=self.turning[::-1],
        )

    @property
    def levers(self) -> list[float]:
        """For every joint, a bound of its axis's distance from the tip in any position [m]."""
        return _levers(self.screws, self.tip.p)

    def excess(self, q: Array) -> Array:
        """(...,) how far the worst joint of q (..., n) lies beyond its limits, negative inside."""
        return limits.excess(q, self.lower, self.upper)

    def within(self, q: Array) -> Array:
        """(...,) bool: every joint of q (..., n) inside its limits, to ``LIMIT_TOLERANCE``."""
        return limits.within(q, self.lower, self.upper)

    def wrapped(self, q: Array) -> Array:
        """The same positions, angles in (-pi, pi] or one turn off where only that is in the limits."""
        return limits.wrapped(q, self.lower, self.upper, self.turning)

    def nearest_turn(self, q: Array, guess: Array) -> Array:
        """The same positions by the turns nearest to a guess, within the limits where any is."""
        return limits.nearest_turn(q, guess, self.lower, self.upper, self.turning)


def per_chain(function: Callable[Concatenate[SerialChain, P], T]) -> Callable[Concatenate[SerialChain, P], T]:
    """A function of a chain and of hashable arguments, computed once for as long as the chain is there."""

    @wraps(function)
    def once(chain: SerialChain, *about: P.args, **named: P.kwargs) -> T:
        key = (function, about, *named.items())
        if key not in chain.memo:
            chain.memo[key] = function(chain, *about, **named)
        value: T = chain.memo[key]
        return value

    return once  # type: ignore[return-value]


def limb_levers(robot: Robot, limb: Limb) -> list[float]:
    """``SerialChain.levers`` of a limb, coupled joints among its own or not."""
    screws = [robot.tree[i].screw for i in robot.path_to(limb.link)]
    return _levers(nearest_points(screws, limb.frame.p), limb.frame.p)


def _levers(screws: Sequence[Screw], tip: Vector) -> list[float]:
    steps = [float(norm(b - a)) for a, b in pairwise([*(screw.s0 for screw in screws), tip])]
    return np.cumsum(steps[::-1])[::-1].tolist()


@kept
def _chain(robot: Robot, limb: str) -> SerialChain:
    chosen = robot.limb(limb)
    path = robot.path_to(chosen.link)
    leading = tuple(dict.fromkeys(robot.gears[i][0] for i in path))
    gears = _gears(robot, path, leading) if max(path, default=0) >= len(robot.joints) else ()
    joints = [robot.joints[i] for i in leading]
    lower, upper = (end[list(leading)] for end in limits.limits_of(robot))
    several = {place for place, *_ in gears if [one for one, *_ in gears].count(place) > 1}
    own = [k not in several and leading[k] in path for k in range(len(leading))]
    turning = np.array([j.type == "revolute" and one for j, one in zip(joints, own, strict=True)], dtype=bool)
    for array in (lower, upper, turning):
        array.flags.writeable = False
    screws = nearest_points([robot.tree[i].screw for i in path], chosen.frame.p)
    places = [*(screw.s0 for screw in screws), chosen.frame.p]
    size = sum(_number(norm(b - a)) for a, b in pairwise(places))
    sliding = [joint.screw.is_translation for joint in joints]
    size += sum(float(way) for way in (upper - lower)[sliding] if np.isfinite(way))
    return SerialChain(
        chosen.name,
        tuple(joint.name for joint in joints),
        leading,
        screws,
        chosen.frame,
        lower,
        upper,
        turning,
        max(SMALLEST, size),
        gears,
    )


def _gears(robot: Robot, path: Sequence[int], leading: Sequence[int]) -> tuple[Gear, ...]:
    """What moves every joint on a way."""
    count, gears = len(robot.joints), []
    for i in path:
        leader, ratio = robot.gears[i]
        offset = float(robot.coupled[i - count].offset) if i >= count else 0.0
        gears.append((leading.index(leader), float(ratio), offset))
    return tuple(gears)


@kept
def _freed_chain(robot: Robot, limb: str, free: tuple[str, ...]) -> SerialChain:
    first = len(robot.joints) + 3 * [one.name for one in robot.limbs].index(limb)
    return _chain(robot, limb).freed(free, [first + "xyz".index(name[1]) for name in free])


def _number(x: Scalar) -> float:
    return 0.0 if is_symbolic(x) else float(x)


def nearest_points(screws: Sequence[Screw], tip: Vector) -> tuple[Screw, ...]:
    """The same axes, each through its point nearest to that of the next one; the last nearest to the tip.

    These points do not depend on joint positions, nor on which points a table names.
    """
    near, through = tip, list[Screw]()
    for screw in reversed(screws):
        if any(is_symbolic(x) for x in leaves(screw.s0 - near)):
            near = screw.s0
        elif screw.is_translation:
            pass
        else:
            near = _slid(screw, float(dot(screw.s, near - screw.s0)))
        through.insert(0, Screw(screw.s, near, screw.pitch))
    return tuple(through)


def _slid(screw: Screw, along: float) -> Vector:
    """The point of an axis that far from s0; what rounding leaves of a zero is none."""
    rounding = 4e-16 * max(1.0, abs(along))
    if abs(along) <= rounding:
        return screw.s0
    moved = screw.s0 + screw.s * along
    return Vector(*(structural(0.0 if abs(x) <= rounding else x) for x in moved))


def forward(screws: Sequence[Screw], thetas: Sequence[Scalar], tip: Pose) -> tuple[Pose, list[Twist]]:
    """Pose of the tip, and each joint's twist where the joints before it have carried it (at the origin)."""
    columns, before = [], IDENTITY
    for screw, theta in zip(screws, thetas, strict=True):
        columns.append(transport(before, screw.twist))
        before = before @ displacement(screw, theta)
    return before @ tip, columns


def separation(chain: SerialChain, q: Sequence[Scalar], target: Pose | Vector) -> tuple[Scalar, Scalar]:
    """How far the tip is from a pose or a position, any scalar.

    The two halves of the chain are compared where they join, so that branches share the half that they have
    in common, and closed forms the turns that they have made of it.

    Returns:
        Squared sine of half the angle between the orientations (0 for a position), squared distance [m^2].
    """
    joints, half = list(zip(chain.screws, q, strict=True)), len(chain.screws) // 2
    first, last = (_advanced(part) for part in (joints[:half], joints[half:]))
    place = first @ (last @ chain.tip.p)
    if isinstance(target, Vector):
        return 0, dot(place - target, place - target)
    R, apart = first.R, place - target.p
    wanted = (target.R @ chain.tip.R.T) @ last.R.T
    columns = zip((R.x, R.y, R.z), (wanted.x, wanted.y, wanted.z), strict=True)
    return sum(dot(a - b, a - b) for a, b in columns) / 8, dot(apart, apart)


def _advanced(joints: Sequence[tuple[Screw, Scalar]]) -> Displacement:
    """What the body behind these joints undergoes, seen from the body before them."""
    D = AT_REST
    for screw, theta in joints:
        D = advance(D, screw, theta)
    return D


def miss(chain: SerialChain, q: Sequence[Scalar], target: Pose | Vector) -> Scalar:
    """Norm of the residual [m and rad] on any scalar; large angles are given by their chord."""
    half, far = separation(chain, q, target)
    return sqrt(4 * half + far)


def volume(chain: SerialChain, q: Array) -> Array:
    """(B,) size of the determinant of six joints' columns at q (B, 6), velocities over the limb's size."""
    J = jacobian(chain, q)[1]
    J[:, 3:] /= chain.length
    return np.asarray(np.abs(np.linalg.det(J)))


def distance(chain: SerialChain, q: Array, target: Array) -> Array:
    """(B,) norm of the residual [m and rad] of q (B, n) for poses (B, 4, 4) or positions (B, 3).

    The angle of the missing rotation is taken from the chord between the two rotations, which is exact also
    where the angle is small and costs less than its axis.
    """
    half, far = separation(chain, unstack(q), target_of(target))
    turn = 2 * np.arcsin(np.minimum(np.sqrt(half), 1.0))
    return np.asarray(np.sqrt(turn * turn + far))


def target_of(target: Array) -> Pose | Vector:
    """Poses (B, 4, 4) or positions (B, 3) as a record."""
    return vector_from_array(target) if target.ndim == 2 else pose_from_array(target)


def jacobian(chain: SerialChain, q: Array) -> tuple[Pose, Array]:
    """Pose of the tip at q (B, n), and its Jacobian (B, 6, n) at the tip's origin, of coupled joints too."""
    thetas, rates = chain.moved(q)
    tip, columns = forward(chain.screws, thetas, chain.tip)
    J = as_array([at(tip.p, column) for column in columns], (len(q),)).astype(float).swapaxes(1, 2)
    return tip, J if rates is None else J @ rates


def residual(chain: SerialChain, q: Array, target: Array) -> tuple[Array, Array]:
    """What separates the tip from its target, and how the tip moves.

    Args:
        chain: n joints.
        q: (B, n).
        target: poses (B, 4, 4), or positions (B, 3) with the orientation free.

    Returns:
        residual (B, 6): rotation vector and translation [rad, m] from the tip to the target, base axes;
        Jacobian (B, 6, n), rows [omega; v of the tip's origin]. For positions the last three rows only.
    """
    tip, J = jacobian(chain, q)
    count = (len(q),)
    if target.ndim == 2:
        return target - as_array(tip.p, count), J[:, 3:]
    wanted = pose_from_array(target)
    turn = rotation_log(wanted.R @ tip.R.T)
    return np.concatenate([as_array(turn, count), as_array(wanted.p - tip.p, count)], axis=1), J
