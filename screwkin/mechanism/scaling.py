"""Where screws are expressed and by what length their velocities are divided, read from lines alone.

A singular value mixes angular and linear velocities: it depends on a reference point and on a length. Both
are taken from geometry, so that neither the points that name the axes nor the base frame matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.linear import cramer
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import ZERO, Twist, Vector, X, Y, Z, as_array, cross, dot, norm, vector_from_array
from screwkin.compiler.program import kept
from screwkin.mechanism.mechanism import WAIST, Mechanism
from screwkin.model.robot import Robot

_FREE = 1e-9
"""Weight that settles a reference point along a direction that all axes share, where it does not matter."""


def skeleton(screws: Sequence[Screw], tip: Vector) -> list[Vector]:
    """One point on every axis of a limb, and the tip: each is the foot of the perpendicular from the next.

    The distances of neighbouring points do not change as revolute joints turn: the next point moves on a
    circle about the axis, and the foot is its centre. A prismatic joint has no line; its point is the next
    one.

    Args:
        screws: the limb's axes from the base to the tip.
        tip: its origin, in the same frame [m].

    Returns:
        len(screws) + 1 points, the tip last [m].
    """
    points = [tip]
    for screw in reversed(screws):
        p = points[0]
        foot = p if screw.is_translation else screw.s0 + screw.s * dot(screw.s, p - screw.s0)
        points.insert(0, foot)
    return points


def levers(screws: Sequence[Screw], tip: Vector) -> list[float]:
    """How far every axis of a limb can be from the tip: the length of the skeleton from there on [m]."""
    points = skeleton(screws, tip)
    steps = [float(norm(b - a)) for a, b in pairwise(points)]
    return [float(sum(steps[k:])) for k in range(len(steps))]


@kept
def characteristic_length(robot: Robot) -> float:
    """Size of the robot [m]: the length of its longest limb, along the limb's ``skeleton``.

    Of a loop it is the largest distance of its axes from their centre, in the zero pose. Joints of no limb
    and no loop count only where there are no others. A robot whose axes and tips all meet has size 1 m.
    """
    sizes = [
        levers([robot.joints[i].screw for i in robot.path_to(limb.link)], limb.frame.p)[0]
        for limb in robot.limbs
        if robot.path_to(limb.link)
    ]
    loops = [set(robot.path_to(c.link_a)) ^ set(robot.path_to(c.link_b)) for c in robot.closures]
    if not robot.limbs and not robot.closures:
        loops = [set(range(len(robot.joints)))]
    sizes += [_radius([robot.joints[i].screw for i in sorted(loop)]) for loop in loops]
    size = max(sizes, default=0.0)
    return size if size > 1e-9 else 1.0


def _radius(screws: Sequence[Screw]) -> float:
    lines = [screw for screw in screws if not screw.is_translation]
    if not lines:
        return 0.0
    p = centre([Screw(line.s, line.s0).twist for line in lines])
    return max(float(norm(cross(line.s, p - line.s0))) for line in lines)


def centre(twists: Sequence[Twist]) -> Vector:
    """The point nearest to the axes of some screws: the sum of the squared distances is least [m].

    Where all axes are parallel any point along them would do. A small weight settles it, and refinement takes
    the weight out of the other directions again.

    Args:
        twists: normalised screws at one origin, at least one; those without rotation have no line.
    """
    columns = [e * (_FREE * len(twists)) + _apart(twists, e) for e in (X, Y, Z)]
    wanted = ZERO
    for twist in twists:
        wanted = wanted + cross(twist.omega, twist.v)
    p = Vector(*cramer(columns, wanted)[0])
    for _ in range(2):
        p = p + Vector(*cramer(columns, wanted - _apart(twists, p))[0])
    return p


def _apart(twists: Sequence[Twist], p: Vector) -> Vector:
    """Sum of what points from every screw's axis, moved through the origin, to a point."""
    total = ZERO
    for twist in twists:
        w = twist.omega
        total = total + p * dot(w, w) - w * dot(w, p)
    return total


def reference_couplings(mechanism: Mechanism, circuit: Sequence[int]) -> list[int]:
    """Columns of the couplings whose ``centre`` is a circuit's reference point.

    The rotations of its tip's virtual chain, which meet in the tip; of a circuit without them all its joints.

    Args:
        mechanism: the closed mechanism.
        circuit: signs (couplings) of the circuit, a row of ``circuit_matrix``.
    """
    inside = [c for c, sign in enumerate(circuit) if sign]
    names = mechanism.couplings
    moving = [c for c in inside if not names[c].startswith(f"{WAIST}.")]
    tips = tuple(f"{chain.name}.r" for chain in mechanism.chains if chain.limb is not None)
    turning = [c for c in moving if tips and names[c].startswith(tips)]
    return turning if len(turning) > 1 else moving


def reference_points(mechanism: Mechanism, N: Array) -> Array:
    """Reference point of every circuit (..., circuits, 3), from the origin of N, world axes [m]."""
    xp = numpy_of(N)
    points = []
    for k, row in enumerate(mechanism.circuit_matrix.tolist()):
        block = N[..., 6 * k : 6 * k + 6, :]
        chosen = reference_couplings(mechanism, row)
        twists = [
            Twist(vector_from_array(block[..., :3, c]), vector_from_array(block[..., 3:, c])) for c in chosen
        ]
        points.append(as_array(centre(twists), N.shape[:-2]) if twists else xp.zeros((*N.shape[:-2], 3)))
    return xp.stack(points, axis=-2) if points else xp.zeros((*N.shape[:-2], 0, 3))


def referenced(mechanism: Mechanism, N: Array, points: Array | None = None) -> Array:
    """Screws of every circuit at its reference point, velocities divided by ``characteristic_length``.

    Args:
        mechanism: the closed mechanism.
        N: (..., 6 circuits, columns), formed at one origin, world axes.
        points: from ``reference_points``; default: those of N, whose columns are then all couplings.
    """
    xp = numpy_of(N)
    points = reference_points(mechanism, N) if points is None else points
    rows = N.reshape(*N.shape[:-2], N.shape[-2] // 6, 6, N.shape[-1])
    omega, v = rows[..., :3, :], rows[..., 3:, :]
    moved = v + xp.cross(omega, points[..., None], axis=-2)
    both = xp.concatenate([omega, moved / characteristic_length(mechanism.robot)], axis=-2)
    return both.reshape(N.shape)


def weighed(twist: Twist, length: float) -> list[Scalar]:
    """Components of a screw, velocities divided by a length."""
    return [*twist.omega, *(x / length for x in twist.v)]
