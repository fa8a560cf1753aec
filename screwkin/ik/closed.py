"""Closed forms of six-joint limbs, found from the geometry of their screw tables.

Two families are known, each also walked from the tip to the base: axes 1, 2, 3 meet in a point and 5, 6 in
another (a spherical hip), or axes 3, 4, 5 are parallel (an offset hip). Directions may be any.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton
from screwkin.algebra.scalar import Scalar
from screwkin.algebra.se3 import Pose, Vector, pose_from_array
from screwkin.errors import InputError
from screwkin.ik.parallel_axes import parallel_axes_branches, parallel_axes_points
from screwkin.ik.spherical_hip import spherical_hip_branches
from screwkin.kinematics.axis_geometry import meeting, parallel_axes_faults, spherical_hip_faults
from screwkin.kinematics.serial_chain import Chain, distance, missing

EXACT = 1e-12
"""Largest error [m and rad, norm] of a branch that counts as a solution."""
SAME = 1e-6
"""Branches closer than this [rad] are one: what rounding leaves of a double root."""
BLOCK = 4096
"""Samples computed together, which bounds the memory of a large batch."""


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """How a limb is solved: its family, whether it is walked from the tip, and the points where axes meet."""

    chain: Chain
    family: Literal["spherical hip", "parallel axes"]
    backwards: bool
    hip: Vector | None = None
    ankle: Vector | None = None

    def branches(self, target: Array) -> Array:
        """All eight candidate branches (B, 8, 6) for tip poses (B, 4, 4), angles in (-pi, pi].

        Those that are no solutions bring the limb near its target.
        """
        blocks = [self._block(target[i : i + BLOCK]) for i in range(0, len(target), BLOCK)]
        return np.concatenate(blocks) if blocks else np.zeros((0, 8, 6))

    def formula(self, target: Pose) -> list[tuple[Scalar, ...]]:
        """All eight branches of a pose on any scalar: six angles in the limb's order, and the branch's slack.

        The slack is negative where the branch is no solution, and near 0 where rounding leaves few digits.
        """
        chain, D = self._walked(target)
        if self.family == "spherical hip":
            sets = self._spherical(chain, D)
        else:
            sets = parallel_axes_points(chain.screws, D, chain.length)
        order = slice(None, None, -1) if self.backwards else slice(None)
        return [(*branch[:6][order], branch[6]) for branch in sets]

    def _walked(self, target: Pose) -> tuple[Chain, Pose]:
        """The chain as its family walks it, and how far it displaces its tip link."""
        D = target @ self.chain.tip.inverse
        return (self.chain.reversed, D.inverse) if self.backwards else (self.chain, D)

    def _spherical(self, chain: Chain, D: Pose) -> list[tuple[Scalar, ...]]:
        assert self.hip is not None
        assert self.ankle is not None
        return spherical_hip_branches(chain.screws, self.hip, self.ankle, D)

    def _block(self, target: Array) -> Array:
        chain, D = self._walked(pose_from_array(np.asarray(target)))
        if self.family == "spherical hip":
            sets = self._spherical(chain, D)
            q = np.stack([np.stack(np.broadcast_arrays(*angles)) for *angles, _ in sets])
        else:
            q = parallel_axes_branches(chain.screws, D, chain.length)
        q = np.moveaxis(q, -1, 0)
        return self.chain.wrapped(q[..., ::-1] if self.backwards else q)


def closed_form(chain: Chain) -> ClosedForm:
    """The closed form of a limb.

    Raises:
        InputError: its geometry has none; the message tells what each family lacks.
    """
    if len(chain.screws) != 6 or not chain.turning.all():
        kinds = f"{len(chain.screws)} joints" + ("" if chain.turning.all() else ", not all revolute")
        raise InputError(
            f"{chain.limb} has no closed form: it has {kinds}; six revolute joints are needed. "
            "Use a numeric method"
        )
    ways = [(False, chain), (True, chain.reversed)]
    lacks = []
    for backwards, walked in ways:
        lacks.append(spherical_hip_faults(walked))
        if not lacks[-1]:
            points = meeting(walked, (0, 1, 2)), meeting(walked, (4, 5))
            return ClosedForm(chain, "spherical hip", backwards, *points)
    for backwards, walked in ways:
        lacks.append(parallel_axes_faults(walked))
        if not lacks[-1]:
            return ClosedForm(chain, "parallel axes", backwards)
    told = ["; ".join(faults) for faults in lacks]
    raise InputError(
        f"{chain.limb} has no closed form. No spherical hip: {told[0]}; no spherical wrist: {told[1]}. "
        f"Its axes 3 to 5 do not serve: {told[2]}; nor its axes 2 to 4: {told[3]}. Use a numeric method"
    )


def solve_closed(
    form: ClosedForm, target: Array, guess: Array | None = None, least_squares: bool = True
) -> tuple[Array, Array, Array]:
    """All solutions of a limb for tip poses (B, 4, 4).

    Args:
        form: of the limb.
        target: tip poses.
        guess: (B, 6), default zero; it decides between least-squares answers that are equally good.
        least_squares: seek these where there is no solution.

    Returns:
        q (B, 8, 6) with angles in (-pi, pi]; error (B, 8) [m and rad, norm]; valid (B, 8) bool. A double
        root is valid once. Where no branch is valid, the first is the least-squares answer, if wanted, else
        the closed form's branch of least error.
    """
    guess = np.zeros((len(target), 6)) if guess is None else guess
    blocks = [slice(i, i + BLOCK) for i in range(0, max(len(target), 1), BLOCK)]
    parts = [_solved_block(form, target[block], guess[block], least_squares) for block in blocks]
    q, error, valid = (np.concatenate(part) for part in zip(*parts, strict=True))
    return q, error, valid


def _solved_block(
    form: ClosedForm, target: Array, guess: Array, least_squares: bool
) -> tuple[Array, Array, Array]:
    """The solutions of a few samples, see ``solve_closed``."""
    q, error = _refined(form.chain, form.branches(target), target)
    valid = _first_of_its_kind(q, error) & (error <= EXACT)
    lost = np.flatnonzero(~valid.any(axis=1))
    if len(lost):
        best = _likeliest(form.chain, q[lost], error[lost], guess[lost])
        if least_squares:
            best = form.chain.wrapped(nearest(form.chain, best, target[lost]))
        q[lost, 0] = best
        error[lost, 0] = distance(form.chain, q[lost, 0], target[lost])
        # A limb that can move with its tip held has a whole family of solutions: one of them is found here.
        valid[lost, 0] = error[lost, 0] <= EXACT
    return q, error, valid


def _likeliest(chain: Chain, q: Array, error: Array, guess: Array) -> Array:
    """Of the branches (B, k, n) about as near as the nearest: least beyond limits, then next to the guess."""
    far = error > 1.01 * error.min(axis=1, keepdims=True) + EXACT
    apart = np.linalg.norm(np.sin((q - guess[:, None]) / 2), axis=-1)
    best = np.lexsort((apart, chain.beyond(q), far), axis=1)[:, 0]
    return np.asarray(np.take_along_axis(q, best[:, None, None], axis=1)[:, 0])


def nearest(chain: Chain, q: Array, target: Array) -> Array:
    """Joint positions (B, n) that bring the tip nearest to its target in the sense of least squares.

    The squares are those of the rotation angle and of the distance over the limb's length.
    """
    scale = np.r_[np.ones(target.shape[-1] - 1), np.full(3, 1 / chain.length)][-6:]

    def residual(x: Array, samples: Array) -> tuple[Array, Array]:
        lack, J = missing(chain, x, target[samples])
        weights = scale[-lack.shape[1] :]
        return lack * weights, J * weights[:, None]

    return newton(residual, q, tolerance=1e-15).x


def _refined(chain: Chain, q: Array, target: Array, steps: int = 2) -> tuple[Array, Array]:
    """Branches (B, k, n) after Newton steps where rounding has left too much; and their errors (B, k).

    Near a singular position a closed form loses digits, as an arc cosine near 1 does; two steps on the whole
    limb restore them. Each is taken only where it helps.
    """
    count, k, n = q.shape
    flat, wanted = q.reshape(-1, n).copy(), np.repeat(target, k, axis=0)
    error = distance(chain, flat, wanted)
    for _ in range(steps):
        at = np.flatnonzero((error > 1e-14) & (error < 1e-4))
        if not len(at):
            break
        lack, J = missing(chain, flat[at], wanted[at])
        new = flat[at] + (np.linalg.pinv(J, rcond=1e-9) @ lack[..., None])[..., 0]
        new_error = distance(chain, new, wanted[at])
        better = new_error < error[at]
        flat[at[better]], error[at[better]] = new[better], new_error[better]
    return chain.wrapped(flat).reshape(count, k, n), error.reshape(count, k)


def _first_of_its_kind(q: Array, error: Array) -> Array:
    """(B, k) bool, False for a branch that repeats a more exact one."""
    same = np.ones((*error.shape, error.shape[1]), dtype=bool)
    for joint in range(q.shape[-1]):
        apart = np.abs(q[:, :, None, joint] - q[:, None, :, joint])
        same &= (apart < SAME) | (apart > 2 * np.pi - SAME)
    rank = error.argsort(axis=1, kind="stable").argsort(axis=1)
    return np.asarray(~(same & (rank[:, None, :] < rank[:, :, None])).any(axis=2))
