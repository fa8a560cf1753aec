"""Comparison of inverse kinematics methods on one limb: over a walk, and over random poses inside the limits.

The walk and the cold start are those of paper B's Table 5. What the paper leaves out (gains, damping, start,
orientation tolerance, where the waist is) is chosen here and given with the results.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.ik_others import OTHERS, MethodOutcome
from screwkin.analysis.ik_targets import path_notes, random_targets, walking_path, walking_targets
from screwkin.errors import InputError
from screwkin.ik.closed import closed_form
from screwkin.ik.hybrid import spherical_variant
from screwkin.ik.methods import Method, solve_limb
from screwkin.ik.numeric import IkSettings
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot

PAPER_TABLE_5 = {
    "analytical": (1, 0.04),
    "hybrid DLS": (4, 0.24),
    "numerical DLS": (104, 4.46),
    "numerical pseudoinverse": (205, 14.24),
}
"""Paper B, Table 5: iterations and time [ms] per point of its 750-point gait, to 1e-6 m."""

OTHERS_POSES = 500
"""Random poses given to other libraries, whose Python interfaces take one at a time."""


@dataclass(frozen=True)
class Entry:
    """A method with its settings, as the table names it."""

    name: str
    method: Method
    settings: IkSettings
    start: str


@dataclass(frozen=True)
class IkRow:
    """One method on one set of targets; ``solved`` and ``in_limits`` are shares of the samples.

    Iterations count an unsolved sample with the cap. ``microseconds`` is wall time per sample, all samples
    being solved in one call.
    """

    data: str
    method: str
    mean_iterations: float
    max_iterations: int
    solved: float
    in_limits: float
    microseconds: float
    samples: int
    settings: str


@dataclass(frozen=True)
class IkStudy:
    """Rows for the walk and for random poses, and every setting that the rows do not tell."""

    robot: str
    limb: str
    rows: tuple[IkRow, ...]
    notes: tuple[str, ...]


def ik_study(
    robot: Robot,
    limb: str,
    poses: int = 10_000,
    seed: int = 0,
    cap: int = 500,
    waist: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> IkStudy:
    """Compare all methods that fit a limb, and other libraries where they are installed.

    Args:
        robot: the robot.
        limb: name of a limb or its tip; a leg also walks.
        poses: number of random poses, tips of uniformly random joint positions inside the limits.
        seed: of these.
        cap: bound on iterations.
        waist: height in the walk above the soles [m]; default: see ``walking_path``.
        progress: called with the share done.

    Raises:
        UnknownNameError: no such limb.
        InputError: a number out of range.
        UnreachableError: the walk is out of reach.
    """
    if poses < 1 or cap < 1:
        raise InputError(f"poses is {poses} and cap is {cap}; both must be at least 1")
    if seed < 0:
        raise InputError(f"seed is {seed}; expected a whole number, at least 0")
    chain = SerialChain.of(robot, limb)
    entries = fitting_entries(chain, cap)
    sets: list[tuple[str, Array]] = []
    notes = settings_notes(cap)
    if robot.limb(limb).kind == "leg":
        path = walking_path(chain, waist)
        sets.append(("gait", walking_targets(chain, path)))
        notes += path_notes(path, len(sets[0][1]))
    sets.append(("random", random_targets(chain, poses, seed)))
    notes.append(f"random: {poses} tips of joint positions uniform inside the limits, seed {seed}")
    rows, total = [], len(sets) * (len(entries) + len(OTHERS))
    for k, (data, target) in enumerate(sets):
        for i, entry in enumerate(entries):
            rows.append(measured_row(chain, data, target, entry))
            progress((k * total / len(sets) + i + 1) / total)
        for i, (name, start, solve) in enumerate(OTHERS):
            some = target if data == "gait" else target[:OTHERS_POSES]
            outcome = solve(chain, some, entries[-1].settings)
            if outcome is not None:
                rows.append(_row(chain, data, name, start, outcome, cap))
            progress((k * total / len(sets) + len(entries) + i + 1) / total)
    return IkStudy(robot.name, chain.limb, tuple(rows), tuple(notes))


def fitting_entries(chain: SerialChain, cap: int) -> list[Entry]:
    """The methods that fit a limb, from the best informed to the plainest."""
    base = IkSettings(position_tolerance=1e-6, rotation_tolerance=1e-6, max_iterations=cap, starts=1)
    soft = replace(base, damping=0.055)
    cold, seed = "from q = 0", "from the spherical variant"
    entries = []
    if _fits(closed_form, chain):
        entries.append(Entry("closed", "closed", base, f"{closed_form(chain).family}; all branches"))
    if _fits(spherical_variant, chain):
        for finish in ("newton", "lm", "dls", "pinv"):
            start = f"{seed}; lambda 0.01" if finish == "dls" else seed
            entries.append(Entry(f"hybrid-{finish}", "hybrid", replace(base, finish=finish), start))
    return [
        *entries,
        Entry("newton", "newton", base, f"{cold}; safeguarded"),
        Entry("lm", "lm", base, f"{cold}; damping half the squared error"),
        Entry("dls-0.01", "dls", base, f"{cold}; lambda 0.01"),
        Entry("dls-0.055", "dls", soft, f"{cold}; lambda 0.055"),
        Entry("pinv", "pinv", base, cold),
    ]


def _fits(recognise: Callable[[SerialChain], object], chain: SerialChain) -> bool:
    try:
        recognise(chain)
    except InputError:
        return False
    return True


def measured_row(chain: SerialChain, data: str, target: Array, entry: Entry) -> IkRow:
    """The row of one method on targets (B, 4, 4)."""
    count = len(target)
    start = np.zeros((count, len(chain.names)))
    begin = time.perf_counter()
    solution = solve_limb(chain, target, entry.method, start, entry.settings, (count,), nearest=False)
    seconds = time.perf_counter() - begin
    outcome = MethodOutcome(solution.best, solution.valid[:, 0], solution.iterations[:, 0], seconds)
    return _row(chain, data, entry.name, entry.start, outcome, entry.settings.max_iterations)


def _row(chain: SerialChain, data: str, name: str, start: str, outcome: MethodOutcome, cap: int) -> IkRow:
    iterations = np.where(outcome.solved, outcome.iterations, cap)
    inside = outcome.solved & chain.within(chain.wrapped(outcome.q))
    return IkRow(
        data,
        name,
        float(iterations.mean()),
        int(iterations.max()),
        float(outcome.solved.mean()),
        float(inside.mean()),
        1e6 * outcome.seconds / len(outcome.q),
        len(outcome.q),
        start,
    )


def settings_notes(cap: int) -> list[str]:
    """Settings common to all rows."""
    return [
        "solved: tip within 1e-6 m and 1e-6 rad (closed: 1e-12 in all); gain 1 everywhere",
        f"an unsolved sample counts {cap} iterations, a closed form 1, a seed that is already exact 0",
        "lambda^2 is added to J J^T, rows in rad and m unscaled; pinv drops singular values below 1e-15",
        "newton: full steps of at most 0.5 rad while they help, else damped; hybrid seeds prefer the limits",
        "time per sample: one call for all samples, one process; other libraries: one sample at a time",
    ]
