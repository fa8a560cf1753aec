"""Where a limb can put its tip with the tip's orientation locked, level by level below the waist.

At every point of a horizontal grid all branches of the limb's inverse kinematics are computed. A point is
reachable if one of them is within the joint limits; else the map says what cuts there: the limb's size, or
the limit of which joint. Inside, the inverse condition number says how near a singularity the limb is.

Source: paper B, section 3.3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import cross, dot, norm
from screwkin.compiler.program import Program
from screwkin.errors import InputError
from screwkin.ik.limb import resting
from screwkin.ik.limb_map import limb_map
from screwkin.ik.reach import OUT_OF_REACH, REACHABLE, cause_names, reach
from screwkin.ik.tied import refuse_tied
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot
from screwkin.model.sprung import refuse_sprung

Progress = Callable[[float], None]

LEVELS = (0.745, 0.80, 0.86, 0.915, 0.985)
"""Default heights as fractions of the straight limb: those at which paper B draws its maps."""
BLOCK = 32_768
"""Points solved together, between two calls of ``progress``."""
LARGEST_GRID = 2_000_000


@dataclass(frozen=True, eq=False)
class WorkspaceMap:
    """What a limb reaches at one height; grid points are x[i], y[j] in the waist frame.

    Attributes:
        limb: its name.
        tip: name of its tip.
        height: of the waist above the tip [m].
        resolution: of the grid [m].
        length: by which velocities are divided in the condition number [m].
        joint_names: of the limb.
        x: (X,) forward [m].
        y: (Y,) to the left [m].
        cause: (X, Y) index into ``causes``.
        causes: reachable, out of reach, then the lower and upper limit of every joint, linkages last.
        inverse_condition: (X, Y) in [0, 1], 0 singular; NaN where not reachable.
        q: (X, Y, n) joint positions inside the limits, nearest to the home posture; NaN where not reachable.
    """

    limb: str
    tip: str
    height: float
    resolution: float
    length: float
    joint_names: tuple[str, ...]
    x: Array
    y: Array
    cause: Array
    causes: tuple[str, ...]
    inverse_condition: Array
    q: Array

    @property
    def reachable(self) -> Array:
        """(X, Y) bool."""
        return self.cause == REACHABLE

    @property
    def area(self) -> float:
        """Reachable area [m^2]: number of reachable points times the area of a cell."""
        return float(self.reachable.sum() * self.resolution**2)

    @property
    def cuts(self) -> dict[str, float]:
        """Area [m^2] that each joint limit takes from what the limb's size allows, largest first."""
        counts = np.bincount(self.cause.ravel(), minlength=len(self.causes))
        order = sorted(range(OUT_OF_REACH + 1, len(counts)), key=lambda k: -counts[k])
        return {self.causes[k]: float(counts[k] * self.resolution**2) for k in order if counts[k]}

    @property
    def median_condition(self) -> float:
        """Median condition number over the reachable area; NaN if there is none."""
        values = self.inverse_condition[self.reachable]
        return float(1 / np.median(values)) if len(values) else float("nan")


def workspace(
    robot: Robot,
    limb: str,
    heights: Sequence[float] | None = None,
    resolution: float = 0.0025,
    progress: Progress = lambda share: None,
) -> list[WorkspaceMap]:
    """Maps of what a limb reaches with its tip oriented as in the zero pose, one for each height.

    Args:
        robot: the robot.
        limb: name of a limb with six joints or more.
        heights: of the waist above the tip [m]; default: ``default_heights``.
        resolution: distance of grid points [m].
        progress: called with the share done.

    Raises:
        InputError: the limb has too few joints, heights or resolution make no grid.
        UnknownNameError: no such limb.
    """
    refuse_sprung(robot, "workspace")
    refuse_tied(robot, robot.limb(limb).name, "workspace")
    chain = SerialChain.of(robot, limb)
    if len(chain.joints) < 6:
        raise InputError(
            f"{chain.limb} has {len(chain.joints)} joints; six are needed to hold its tip's orientation"
        )
    levels = list(default_heights(robot, limb) if heights is None else heights)
    if not levels or not np.isfinite(levels).all():
        raise InputError(f"heights {levels} make no map; give finite numbers in m, such as 0.35")
    if len(set(levels)) < len(levels):
        raise InputError(f"heights {levels} name one height twice; give each once")
    if not (np.isfinite(resolution) and resolution > 0):
        raise InputError(f"resolution is {resolution}; it must be a positive number of m, such as 0.0025")
    maps = []
    for k, height in enumerate(levels):
        share = lambda done, k=k: progress((k + done) / len(levels))  # noqa: E731
        maps.append(_level(robot, chain, float(height), resolution, share))
    return maps


def default_heights(robot: Robot, limb: str) -> list[float]:
    """Heights of the waist above the tip [m], from a bent limb to a nearly straight one, to 5 mm.

    Raises:
        InputError: the limb does not hang down in the zero pose.
    """
    chain = SerialChain.of(robot, limb)
    top = float(chain.screws[0].s0.z)
    drop = top - float(chain.tip.p.z)
    if drop < 0.02:
        raise InputError(f"{chain.limb} does not hang down in the zero pose; give heights")
    return [round(round((fraction * drop - top) / 0.005) * 0.005, 9) for fraction in LEVELS]


def map_program(robot: Robot, chain: SerialChain) -> Program:
    """The program that a workspace of a limb with a closed form runs."""
    return limb_map(robot, chain.limb, tuple(resting(robot, chain).tolist()), normalising_length(chain))


def normalising_length(chain: SerialChain) -> float:
    """Length [m] that makes velocities comparable with angular ones: thigh and shin.

    The sum of the distances between neighbouring parallel axes; the limb's size if there are none.
    """
    total = 0.0
    for a, b in pairwise(chain.screws):
        if float(norm(cross(a.s, b.s))) < 1e-9:
            gap = b.s0 - a.s0
            total += float(norm(gap - a.s * dot(a.s, gap)))
    return total if total > 1e-3 else chain.length


def _level(
    robot: Robot, chain: SerialChain, height: float, resolution: float, progress: Progress
) -> WorkspaceMap:
    """The map of one height."""
    x, y, near = _grid(chain, height, resolution)
    n, count = len(chain.joints), near.size
    cause = np.full(count, OUT_OF_REACH, dtype=np.int16)
    inverse, q = np.full(count, np.nan), np.full((count, n), np.nan)
    length, guess = normalising_length(chain), resting(robot, chain)
    tried = np.flatnonzero(near)
    for begin in range(0, len(tried), BLOCK):
        here = tried[begin : begin + BLOCK]
        row, column = np.divmod(here, len(y))
        points = np.stack([x[row], y[column], np.full(len(here), -height)], axis=1)
        cause[here], q[here], inverse[here] = reach(robot, chain.limb, points, guess, length)
        progress((begin + len(here)) / len(tried))
    rows, columns = _window((cause != OUT_OF_REACH).reshape(len(x), len(y)))
    shape = (len(x), len(y))
    return WorkspaceMap(
        chain.limb,
        robot.limb(chain.limb).tip,
        height,
        resolution,
        length,
        chain.names,
        x[rows],
        y[columns],
        cause.reshape(shape)[rows, columns],
        cause_names(robot, chain.limb),
        inverse.reshape(shape)[rows, columns],
        q.reshape(*shape, n)[rows, columns],
    )


def _grid(chain: SerialChain, height: float, resolution: float) -> tuple[Array, Array, Array]:
    """Multiples of the resolution x (X,), y (Y,), and which points (X, Y) the limb's size may allow.

    With the tip's orientation held, a point of the last axis moves as the tip does; from the first axis it
    is never further than the distances from axis to axis add up to, and what the joints can slide.
    """
    points = [screw.s0 for screw in chain.screws]
    reach = sum(float(norm(b - a)) for a, b in pairwise(points))
    slide = [
        0.0 if turns else max(abs(low), abs(high))
        for turns, low, high in zip(chain.turning, chain.lower, chain.upper, strict=True)
    ]
    reach += float(sum(slide))
    if not np.isfinite(reach):
        raise InputError(f"{chain.limb} slides without limits; give its prismatic joints limits")
    last = points[-1] - chain.tip.p
    middle = points[0] - last
    deep = float(middle.z) + height
    radius = float(np.sqrt(max(reach**2 - deep**2, 0.0))) + 2 * resolution
    if (2 * radius / resolution) ** 2 > LARGEST_GRID:
        fit = 2 * radius / LARGEST_GRID**0.5
        raise InputError(f"resolution {resolution} m makes over 2 million points; take {fit:.2g} m or more")
    ends = [
        (np.ceil((float(c) - radius) / resolution), np.floor((float(c) + radius) / resolution))
        for c in (middle.x, middle.y)
    ]
    x, y = (np.arange(low, high + 1) * resolution for low, high in ends)
    near = (x[:, None] - float(middle.x)) ** 2 + (y - float(middle.y)) ** 2 <= radius**2
    return x, y, near


def _window(seen: Array) -> tuple[slice, slice]:
    """Rows and columns around what is true of (X, Y), one point wider."""
    spans = []
    for axis in (1, 0):
        hits = np.flatnonzero(seen.any(axis=axis))
        size = seen.shape[1 - axis]
        spans.append(slice(max(hits[0] - 1, 0), min(hits[-1] + 2, size)) if len(hits) else slice(0, size))
    return spans[0], spans[1]
