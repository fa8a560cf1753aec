"""Closed forms of limbs, recognised from the geometry of their screw tables, and certified over arrays.

A family is one file with a function ``recognise``, and one row of ``FAMILIES``. Those for poses are also
walked from the tip to the base. Directions of the axes may be any.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.newton import newton
from screwkin.algebra.scalar import cos, least
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import ZERO, Pose, Vector, unstack
from screwkin.errors import InputError
from screwkin.ik import parallel_axes, point_limb, spherical_hip
from screwkin.ik.family import Branch, Family, Formulas
from screwkin.ik.starts import box, spread
from screwkin.kinematics.serial_chain import (
    SerialChain,
    distance,
    forward,
    per_chain,
    residual,
    target_of,
    volume,
)

FAMILIES = (
    Family("spherical hip", ("No spherical hip", "no spherical wrist"), spherical_hip.recognise),
    Family("parallel axes", ("axes 3 to 5 do not serve", "nor axes 2 to 4"), parallel_axes.recognise),
    Family("shoulder", ("No shoulder",), point_limb.recognise, joints=3, position=True),
)
"""All closed forms; the first that fits a limb is taken."""
EXACT = 1e-12
"""Largest error [m and rad, norm] of a branch that counts as a solution."""
SAME = 1e-6
"""Branches closer than this [rad] are one: what rounding leaves of a double root."""
STILL = 1e-6
"""Sum of (1 - cos) of the turns of a tip below which it may stand still."""
POSITIONS = 64
"""Positions within the limits by which axes of a tip are compared."""
MOSTLY = 0.1
"""Share of them whose branches may be nearer to others."""
ASIDE = 0.5
"""How far from the tip such axes lie, over the limb's length, that do not pass through it."""
BLOCK = 4096
"""Samples computed together, which bounds the memory of a large batch."""


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """How a limb is solved: its family, and whether it is walked from the tip."""

    chain: SerialChain
    family: str
    backwards: bool
    position: bool
    formulas: Formulas

    def branches(self, target: Array) -> Array:
        """All candidate branches (B, k, n) for tip poses (B, 4, 4) or positions (B, 3), angles in (-pi, pi].

        Those that are no solutions bring the limb near its target.
        """
        return np.concatenate([self._block(target[block]) for block in _blocks(len(target))])

    def formula(self, target: Pose | Vector) -> list[Branch]:
        """All branches of a pose or position on any scalar: positions in the limb's order, and the slack."""
        return self.at(self._displacement(target))

    def at(self, wanted: Pose | Vector) -> list[Branch]:
        """The same of the displacement of the tip link, or of a position."""
        return self._in_order(self.formulas.formula(self._walked(wanted)))

    def ways(self, target: Pose) -> list[Branch]:
        """All that could be branches, each with how far it misses (``Formulas.ways``), if it has any."""
        ways = self.formulas.ways
        return self._in_order(ways(self._walked(self._displacement(target)))) if ways else []

    def _in_order(self, branches: list[Branch]) -> list[Branch]:
        order = slice(None, None, -1) if self.backwards else slice(None)
        return [(*branch[:-1][order], branch[-1]) for branch in branches]

    def arrays(self, wanted: Pose | Vector, count: int) -> Array:
        """Joint positions (k, n, count) of all branches of such displacements or positions, (count,) each."""
        walked = self._walked(wanted)
        if self.formulas.arrays:
            q = self.formulas.arrays(walked)
        else:
            batch, sets = np.zeros(count), self.formulas.formula(walked)
            q = np.stack([np.stack(np.broadcast_arrays(*angles, batch)[:-1]) for *angles, _ in sets])
        return q[:, ::-1] if self.backwards else q

    def _displacement(self, target: Pose | Vector) -> Pose | Vector:
        return target if isinstance(target, Vector) else target @ self.chain.tip.inverse

    def _walked(self, wanted: Pose | Vector) -> Pose | Vector:
        """What the family's formulas take: how far the tip link is displaced as it walks the chain."""
        return wanted.inverse if self.backwards and isinstance(wanted, Pose) else wanted

    def _block(self, target: Array) -> Array:
        q = self.arrays(self._displacement(target_of(np.asarray(target))), len(target))
        return self.chain.wrapped(np.moveaxis(q, -1, 0))


def closed_form(chain: SerialChain, position: bool = False, family: str | None = None) -> ClosedForm:
    """The closed form of a limb.

    Args:
        chain: of the limb.
        position: for positions of the tip, its orientation being free.
        family: only this one.

    Raises:
        InputError: its geometry has none; the message says why it is of no family.
    """
    n = len(chain.screws)
    if n in (4, 5) and not position and chain.turning.all():
        return _with_free_tip(chain, family)
    rows = [row for row in FAMILIES if row.position == position and family in (None, row.name)]
    fitting = [row for row in rows if row.joints == n and chain.turning.all()]
    what = f"{chain.limb} has no closed form" + (" for positions" if position else "")
    if not fitting:
        mixed = ", some coupled" if chain.gears else "" if chain.turning.all() else ", not all revolute"
        kinds = f"{n} joints{mixed}"
        needed = " or ".join(_COUNTS.get(j, str(j)) for j in sorted({row.joints for row in rows}))
        raise InputError(f"{what}: it has {kinds}; {needed} revolute joints are needed. Use a numeric method")
    reasons = []
    for row in fitting:
        for backwards, label in enumerate(row.reasons):
            formulas = row.recognise(chain.reversed if backwards else chain)
            if isinstance(formulas, Formulas):
                return ClosedForm(chain, row.name, bool(backwards), position, formulas)
            reasons.append(f"{label}: {'; '.join(formulas)}")
    raise InputError(f"{what}. {'. '.join(reasons)}. Use a numeric method")


_COUNTS = {3: "three", 6: "six"}


def _with_free_tip(chain: SerialChain, family: str | None) -> ClosedForm:
    """The closed form of four or five joints, from that of six of which the last turn the tip.

    A branch is one of the limb's where these stand still. Of the axes that serve those are taken about which
    its branches are furthest apart.

    Raises:
        InputError: with no axis of the tip there is a closed form.
    """
    n, forms, faults = len(chain.screws), [], []
    for longer in completed(chain):
        try:
            form = closed_form(longer, family=family)
            forms.append((clearness(form, n), form))
        except InputError as error:
            faults.append(str(error))
    if not forms:
        raise InputError(faults[-1])
    _, form = max(forms, key=lambda rated: rated[0])

    def still(branch: Branch) -> Branch:
        turned = sum(1 - cos(angle) for angle in branch[n:-1])
        return (*branch[:n], least(branch[-1], STILL - turned))

    def arrays(D: Pose) -> Array:
        return form.arrays(D, int(np.prod(np.shape(D.p.x))))[:, :n]

    formulas = Formulas(lambda D: [still(branch) for branch in form.at(D)], arrays)
    return ClosedForm(chain, f"{form.family}, tip free", False, False, formulas)


def completed(chain: SerialChain) -> list[SerialChain]:
    """Limbs of six joints, of a limb of four or five: further ones turn the tip about axes of its own.

    The axes are parallel to the tip's, through the tip or aside: those through it lie in the plane in which
    many legs move, where branches share angles.
    """
    missing, tip = 6 - len(chain.screws), chain.tip.R
    wholes = []
    for free in combinations(("rx", "ry", "rz"), missing):
        whole = chain.freed(free, range(missing))
        for aside in (ZERO, tip.x, tip.y, tip.z):
            shift = aside * (chain.length * ASIDE)
            moved = (Screw(screw.s, screw.s0 + shift) for screw in whole.screws[-missing:])
            wholes.append(replace(whole, screws=(*chain.screws, *moved)))
    return wholes


def clearness(form: ClosedForm, own: int) -> float:
    """How far apart branches of six joints are, mostly, where those beyond the first ``own`` stand still.

    That is the slack of such positions within the limits.
    """
    low, high = box(form.chain)
    q = low + spread(6, POSITIONS, 0) * (high - low)
    q[:, own:] = 0.0
    tips, _ = forward(form.chain.screws, unstack(q), form.chain.tip)
    with np.errstate(all="ignore"):  # branches that are no solutions
        rows = [np.stack(np.broadcast_arrays(*row, q[:, 0])[:-1], axis=1) for row in form.formula(tips)]
    branches = np.nan_to_num(np.stack(rows, axis=1))
    far = np.sin((branches[..., :6] - q[:, None]) / 2) ** 2
    nearest = far.sum(axis=2).argmin(axis=1)
    return float(np.quantile(branches[np.arange(POSITIONS), nearest, 6], MOSTLY))


def conditioned(chain: SerialChain) -> float:
    """How well six joints are conditioned, mostly: mean volume of their screws within the limits."""
    low, high = box(chain)
    return float(volume(chain, low + spread(6, POSITIONS, 0) * (high - low)).mean())


@per_chain
def recognised(chain: SerialChain, position: bool = False) -> ClosedForm | None:
    """The closed form of a limb, None where it has none."""
    try:
        return closed_form(chain, position)
    except InputError:
        return None


def _blocks(count: int) -> list[slice]:
    return [slice(i, i + BLOCK) for i in range(0, max(count, 1), BLOCK)]


def solve_closed(
    form: ClosedForm, target: Array, guess: Array | None = None, least_squares: bool = True
) -> tuple[Array, Array, Array]:
    """All solutions of a limb, certified by their residual.

    Args:
        form: of the limb.
        target: tip poses (B, 4, 4), or positions (B, 3).
        guess: (B, n), default zero; it decides between least-squares answers that are equally good.
        least_squares: seek these where there is no solution.

    Returns:
        q (B, k, n) with angles in (-pi, pi]; error (B, k) [m and rad, norm]; valid (B, k) bool. A double
        root is valid once. Where no branch is valid, the first is the least-squares answer, if wanted, else
        the closed form's branch of least error.
    """
    guess = np.zeros((len(target), len(form.chain.names))) if guess is None else guess
    parts = [_solved_block(form, target[b], guess[b], least_squares) for b in _blocks(len(target))]
    q, error, valid = (np.concatenate(part) for part in zip(*parts, strict=True))
    return q, error, valid


def _solved_block(
    form: ClosedForm, target: Array, guess: Array, least_squares: bool
) -> tuple[Array, Array, Array]:
    """The solutions of a few samples, see ``solve_closed``."""
    q, error = refined(form.chain, form.branches(target), target)
    valid = first_of_its_kind(q, error)
    lost = np.flatnonzero(~valid.any(axis=1))
    if len(lost):
        best = likeliest(form.chain, q[lost], error[lost], guess[lost])
        if least_squares:
            best = form.chain.wrapped(nearest(form.chain, best, target[lost]))
        q[lost, 0] = best
        error[lost, 0] = distance(form.chain, q[lost, 0], target[lost])
        # A limb that can move with its tip held has a whole family of solutions: here is one of them.
        valid[lost, 0] = error[lost, 0] <= EXACT
    return q, error, valid


def likeliest(chain: SerialChain, q: Array, error: Array, guess: Array) -> Array:
    """Of the branches (B, k, n) about as near as the nearest: least beyond limits, then next to the guess."""
    far = error > 1.01 * error.min(axis=1, keepdims=True) + EXACT
    apart = np.linalg.norm(np.sin((q - guess[:, None]) / 2), axis=-1)
    best = np.lexsort((apart, np.maximum(chain.excess(q), 0.0), far), axis=1)[:, 0]
    return np.asarray(np.take_along_axis(q, best[:, None, None], axis=1)[:, 0])


def nearest(chain: SerialChain, q: Array, target: Array) -> Array:
    """Joint positions (B, n) that bring the tip nearest to its target in the sense of least squares.

    The squares are those of the rotation angle and of the distance over the limb's length.
    """
    scale = np.r_[np.ones(3), np.full(3, 1 / chain.length)]

    def lack(x: Array, samples: Array) -> tuple[Array, Array]:
        r, J = residual(chain, x, target[samples])
        weights = scale[-r.shape[1] :]
        return r * weights, J * weights[:, None]

    return newton(lack, q, tolerance=1e-15).x


def refined(chain: SerialChain, q: Array, target: Array, steps: int = 2) -> tuple[Array, Array]:
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
        lack, J = residual(chain, flat[at], wanted[at])
        new = flat[at] + (np.linalg.pinv(J, rcond=1e-9) @ lack[..., None])[..., 0]
        new_error = distance(chain, new, wanted[at])
        better = new_error < error[at]
        flat[at[better]], error[at[better]] = new[better], new_error[better]
    return chain.wrapped(flat).reshape(count, k, n), error.reshape(count, k)


def first_of_its_kind(q: Array, error: Array) -> Array:
    """(B, k) bool, False for a branch that is no solution, or repeats a more exact one."""
    valid = error <= EXACT
    pair = np.triu(np.ones((error.shape[1], error.shape[1]), dtype=bool), 1)
    sample, i, j = (alike(q[:, :, None, 0], q[:, None, :, 0]) & pair).nonzero()
    for joint in range(q.shape[-1]):
        both = alike(q[sample, i, joint], q[sample, j, joint]) & valid[sample, i] & valid[sample, j]
        sample, i, j = sample[both], i[both], j[both]
    worse = np.where(error[sample, j] < error[sample, i], i, j)
    valid[sample, worse] = False
    return np.asarray(valid)


def alike(a: Array, b: Array) -> Array:
    """Whether angles in (-pi, pi] are those of one branch."""
    apart = np.abs(a - b)
    return np.asarray((apart < SAME) | (apart > 2 * np.pi - SAME))
