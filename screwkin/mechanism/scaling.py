"""Where screws are expressed and by what length their velocities are divided, read from lines alone.

A singular value mixes angular and linear velocities: it depends on a reference point and on a length. Both
are taken from geometry, so that neither the points that name the axes nor the base frame matter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.algebra.arrays import Array, numpy_of
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import Twist, as_array
from screwkin.compiler.program import kept
from screwkin.kinematics.serial_chain import limb_levers
from screwkin.mechanism.mechanism import WAIST, Mechanism
from screwkin.model.robot import Robot

_FREE = 1e-9
"""Weight that settles a reference point along a direction that all axes share, where it does not matter."""

_CROSS = np.cross(np.eye(3)[:, None], np.eye(3)[None]).transpose(2, 0, 1)
"""a x b has the components a _CROSS[i] b; a contracted with it is the matrix of w x a, for any w."""


@kept
def characteristic_length(robot: Robot) -> float:
    """Size of the robot [m]: the length of its longest limb, from axis to axis and to the tip.

    Of a loop it is the largest distance of its axes from their centre, in the zero pose. Joints of no limb
    and no loop count only where there are no others. A robot whose axes and tips all meet has size 1 m.
    """
    sizes = [float(max(limb_levers(robot, limb), default=0.0)) for limb in robot.limbs]
    loops = [robot.around(closure) for closure in robot.closures]
    if not robot.limbs and not robot.closures:
        loops = [tuple(range(len(robot.tree)))]
    sizes += [_radius([robot.tree[i].screw for i in loop]) for loop in loops]
    size = max(sizes, default=0.0)
    return size if size > 1e-9 else 1.0


def _radius(screws: Sequence[Screw]) -> float:
    lines = [Screw(screw.s, screw.s0).twist for screw in screws if not screw.is_translation]
    if not lines:
        return 0.0
    S = as_array(lines).T
    apart = S[3:] + np.cross(S[:3], centre(S)[:, None], axis=0)
    return float(np.linalg.norm(apart, axis=0).max())


def centre(S: Array) -> Array:
    """The point (..., 3) nearest to the axes of some screws: the sum of the squared distances is least [m].

    Where all axes are parallel any point along them would do. A small weight settles it, and refinement takes
    the weight out of the other directions again.

    Args:
        S: normalised screws (..., 6, count) at one origin; those without rotation have no line.
    """
    xp, omega = numpy_of(S), S[..., :3, :]
    eye = np.eye(3).reshape(*(1 for _ in S.shape[:-2]), 3, 3)
    W = (omega * omega).sum(axis=(-2, -1))[..., None, None] * eye - omega @ omega.swapaxes(-1, -2)
    products = omega @ S[..., 3:, :].swapaxes(-1, -2)
    wanted = xp.tensordot(products, _CROSS, ((-2, -1), (1, 2)))[..., None]
    inverse = xp.linalg.inv(W + _FREE * eye)
    p = inverse @ wanted
    for _ in range(2):
        p = p + inverse @ (wanted - W @ p)
    return p[..., 0]


def reference_couplings(mechanism: Mechanism, circuit: Sequence[int]) -> list[int]:
    """Columns of the couplings whose ``centre`` is a circuit's reference point.

    The rotations of its tip's virtual chain, which meet in the tip; of a circuit without them all its joints.

    Args:
        mechanism: the closed mechanism.
        circuit: what of the couplings moves in the circuit, a row of ``involved``.
    """
    inside = [c for c, sign in enumerate(circuit) if sign]
    names = mechanism.couplings
    moving = [c for c in inside if not names[c].startswith(f"{WAIST}.")]
    tips = tuple(f"{chain.name}.r" for chain in mechanism.chains if chain.limb is not None)
    turning = [c for c in moving if tips and names[c].startswith(tips)]
    return turning if len(turning) > 1 else moving


@kept
def _reference_mask(mechanism: Mechanism) -> Array:
    """(circuits, 1, couplings) of 1.0 for ``reference_couplings``, else 0.0."""
    mask = np.zeros((len(mechanism.circuits), 1, len(mechanism.couplings)))
    for row, circuit in zip(mask, mechanism.involved.tolist(), strict=True):
        row[0, reference_couplings(mechanism, circuit)] = 1.0
    return mask


def reference_points(mechanism: Mechanism, N: Array) -> Array:
    """Reference point of every circuit (..., circuits, 3), from the origin of N, world axes [m]."""
    mask = _reference_mask(mechanism)
    return centre(_by_circuit(N) * mask.reshape(*(1 for _ in N.shape[:-2]), *mask.shape))


def _by_circuit(N: Array) -> Array:
    return N.reshape(*N.shape[:-2], N.shape[-2] // 6, 6, N.shape[-1])


def referenced(mechanism: Mechanism, N: Array, points: Array | None = None) -> Array:
    """Screws of every circuit at its reference point, velocities divided by ``characteristic_length``.

    Args:
        mechanism: the closed mechanism.
        N: (..., 6 circuits, columns), formed at one origin, world axes.
        points: from ``reference_points``; default: those of N, whose columns are then all couplings.
    """
    xp = numpy_of(N)
    points = reference_points(mechanism, N) if points is None else points
    rows = _by_circuit(N)
    omega, v = rows[..., :3, :], rows[..., 3:, :]
    moved = v + xp.tensordot(points, _CROSS, 1) @ omega
    both = xp.concatenate([omega, moved / characteristic_length(mechanism.robot)], axis=-2)
    return both.reshape(N.shape)


def weighed(twist: Twist, length: float) -> list[Scalar]:
    """Components of a screw, velocities divided by a length."""
    return [*twist.omega, *(x / length for x in twist.v)]
