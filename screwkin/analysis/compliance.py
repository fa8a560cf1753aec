"""What compensation is worth on elastic servos: a walk with and without it, under several conditions.

A single run proves little, for contact is chaotic: the same walk is played for every friction and every time
step, and what counts is the median and the range of the largest ZMP error. A run that falls has no largest
error; it is counted as fallen and enters no average.

Source: paper B, table 7; docs/papers.md says how it is read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.compliance.springs import StiffnessChoice
from screwkin.errors import InputError, one_of
from screwkin.gait.compensation import WAYS, compensate_walk, way_of
from screwkin.gait.ground import ground_of
from screwkin.model.robot import Robot
from screwkin.sim.compliant import STEP, Compliance, SpringServos
from screwkin.sim.measure import ZmpRecord, landing_leads, zmp_record
from screwkin.sim.pybullet import Physics, PyBulletBackend
from screwkin.sim.run import Schedule, simulate
from screwkin.sim.sweeps import sweeps
from screwkin.trajectory import Trajectory

Treatment = Literal["none", "swing", "joint", "dynamic"]
TREATMENTS: tuple[Treatment, ...] = ("none", "swing", "joint", "dynamic")
"""``none`` plays the plan itself, the others what ``compensate_walk`` returns in one of its ``WAYS``."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class Conditions:
    """Under which a walk is repeated: every friction with every time step [s].

    joint_damping [N m s/rad]; rotor_inertia [kg m^2]; sole_stiffness [N/m] and sole_damping [N s/m] of every
    point of contact, None for rigid soles; schedule: settling, holding, and when a fall is a fall.
    """

    frictions: tuple[float, ...] = (0.8, 1.0)
    steps: tuple[float, ...] = (STEP, 0.8 * STEP)
    joint_damping: float = 1.0
    rotor_inertia: float = 5e-4
    sole_stiffness: float | None = None
    sole_damping: float = 20.0
    schedule: Schedule = field(default_factory=lambda: Schedule(aftermath=0.0))


@dataclass(frozen=True)
class Trial:
    """One run: time of its fall [s] or None; largest |x| and |y| error of the ZMP [mm], up to a fall.

    zmp: its ZMP beside the planned one; leads: by how much every swinging foot touches the floor before its
    planned landing [s].
    """

    treatment: Treatment
    friction: float
    dt: float
    fell_at: float | None
    zmp_max_mm: Pair
    zmp: ZmpRecord | None = field(default=None, repr=False, compare=False)
    leads: tuple[float, ...] = field(default=(), repr=False, compare=False)


@dataclass(frozen=True)
class StudyRow:
    """A treatment over all conditions; lengths in mm, x and y, of the runs that did not fall.

    median_mm and range_mm (least, greatest; x, then y): of the largest ZMP error; None if all runs fell. cut:
    by which share the medians are below those without compensation; None if either has none.
    """

    treatment: Treatment
    runs: int
    fallen: int
    median_mm: Pair | None
    range_mm: tuple[Pair, Pair] | None
    cut: Pair | None
    trials: tuple[Trial, ...]

    def to_dict(self) -> dict[str, Any]:
        """All but the ZMPs over time and the landings, as JSON data."""
        bare = replace(self, trials=tuple(replace(trial, zmp=None) for trial in self.trials))
        data = asdict(bare)
        for trial in data["trials"]:
            del trial["zmp"], trial["leads"]
        return data


def compliance_study(
    robot: Robot,
    trajectory: Trajectory,
    stiffness: StiffnessChoice = None,
    treatments: Sequence[Treatment] = TREATMENTS,
    conditions: Conditions | None = None,
    *,
    passes: int = 1,
    progress: Callable[[float], None] | None = None,
) -> tuple[StudyRow, ...]:
    """Largest error of the contact ZMP against the planned one, with and without compensation.

    Args:
        robot: the trajectory's robot.
        trajectory: the planned walk, not compensated yet.
        stiffness: of the joints, in the simulation and for the compensation; see ``joint_stiffness``.
        treatments: ``none``; ``swing`` and ``joint``, by statics; ``dynamic``: joints by the walk's torques.
        conditions: what is varied, and what else is compliant.
        passes: of the compensation.
        progress: called now and then with the share done.

    Returns:
        One row per treatment.

    Raises:
        MissingDependencyError: pybullet is not installed. Others as of ``compensate_walk`` and
        ``SpringServos``.
    """
    if "compensation" in trajectory.meta:
        raise InputError("the trajectory is compensated already; give the walk as it was planned")
    for name in treatments:
        one_of("treatment", name, TREATMENTS)
    if not treatments:
        raise InputError(f"no treatment; valid: {', '.join(TREATMENTS)}")
    trials: list[Trial] = []
    for done, treatment in enumerate(treatments):
        commanded = trajectory
        if treatment != "none":
            method, model = WAYS[treatment]
            commanded = compensate_walk(robot, trajectory, stiffness, method, passes, model)

        def so_far(share: float, done: int = done) -> None:
            if progress is not None:
                progress((done + share) / len(treatments))

        trials += repeated(robot, commanded, stiffness, conditions, so_far)
    return summarised(trials)


def repeated(
    robot: Robot,
    trajectory: Trajectory,
    stiffness: StiffnessChoice = None,
    conditions: Conditions | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Trial]:
    """One trial of a trajectory, compensated or not, per friction and time step; see ``compliance_study``."""
    chosen = conditions or Conditions()
    cases = [(friction, dt) for friction in chosen.frictions for dt in chosen.steps]
    if not cases:
        raise InputError("no conditions; give at least one friction and one time step")
    trials = []
    for friction, dt in cases:
        trials.append(_trial(robot, trajectory, stiffness, way_of(trajectory), friction, dt, chosen))
        if progress is not None:
            progress(len(trials) / len(cases))
    return trials


def summarised(trials: Sequence[Trial]) -> tuple[StudyRow, ...]:
    """One row per treatment, in the order in which they first appear."""
    rows: list[StudyRow] = []
    names = list(dict.fromkeys(trial.treatment for trial in trials))
    medians = {name: _median(_stood(trials, name)) for name in names}
    for name in names:
        own = tuple(trial for trial in trials if trial.treatment == name)
        errors = _stood(trials, name)
        x, y = errors.T
        span = ((float(x.min()), float(x.max())), (float(y.min()), float(y.max()))) if len(errors) else None
        cut = _cut(medians[name], medians.get("none"))
        rows.append(StudyRow(name, len(own), len(own) - len(errors), medians[name], span, cut, own))
    return tuple(rows)


def _trial(
    robot: Robot,
    commanded: Trajectory,
    stiffness: StiffnessChoice,
    treatment: Treatment,
    friction: float,
    dt: float,
    conditions: Conditions,
) -> Trial:
    """One run from settling to the end, or to its fall."""
    physics = Physics(
        dt=dt,
        iterations=sweeps(robot),
        friction=friction,
        sole_stiffness=conditions.sole_stiffness,
        sole_damping=conditions.sole_damping,
    )
    compliance = Compliance(stiffness, conditions.joint_damping, conditions.rotor_inertia)
    servos = SpringServos(robot, compliance, dt)
    backend = PyBulletBackend(robot, physics, servos=servos, terrain=ground_of(commanded))
    try:
        run = simulate(robot, commanded, backend, conditions.schedule)
    finally:
        backend.close()
    zmp = zmp_record(run, commanded)
    error = 1e3 * np.abs(zmp.contact - zmp.planned)
    error = error[np.isfinite(error).all(axis=1)]
    x, y = error.max(axis=0).tolist() if len(error) else (np.nan, np.nan)
    legs = tuple(limb.tip for limb in robot.limbs if limb.kind == "leg")
    leads = tuple(landing_leads(run, commanded, legs).tolist())
    return Trial(treatment, friction, dt, run.fallen_at, (x, y), zmp, leads)


def _stood(trials: Sequence[Trial], treatment: Treatment) -> Array:
    """Largest errors (m, 2) of the runs that did not fall."""
    largest = [trial.zmp_max_mm for trial in trials if trial.treatment == treatment and trial.fell_at is None]
    return np.array(largest, dtype=float).reshape(-1, 2)


def _median(errors: Array) -> Pair | None:
    if not len(errors):
        return None
    x, y = np.median(errors, axis=0).tolist()
    return (x, y)


def _cut(after: Pair | None, before: Pair | None) -> Pair | None:
    if after is None or before is None:
        return None
    return (1.0 - after[0] / before[0], 1.0 - after[1] / before[1])
