"""Measures of a walk on elastic joints in the simulator, with and without compensation."""

from __future__ import annotations

import numpy as np

from screwkin.analysis.account import Account
from screwkin.analysis.compliance import (
    TREATMENTS,
    Conditions,
    StudyRow,
    Treatment,
    Trial,
    compliance_study,
    summarised,
)
from screwkin.errors import InputError, one_of
from screwkin.papers.bench import Bench
from screwkin.papers.scatter import FEW, Scatter, shaken
from screwkin.sim.measure import landings

FRICTIONS = (0.8, 1.0)
KEYS = ("x", "y", "cut x", "cut y", "fallen")


def row_of(bench: Bench, gait: str, treatment: str, stiffness: float) -> StudyRow:
    """The runs of a treatment, together with those without any."""
    account = bench.account(gait)
    one_of("treatment", treatment, TREATMENTS)
    key = ("springs", account.trajectory.sha256, stiffness, *FRICTIONS)
    rows = bench.once(
        key,
        lambda: summarised(
            [trial for one in TREATMENTS for trial in _trials(bench, account, one, stiffness)]
        ),
    )
    return next(row for row in rows if row.treatment == treatment)


def _trials(bench: Bench, account: Account, treatment: Treatment, stiffness: float) -> list[Trial]:
    """Runs of a treatment that differ by friction and rounding."""
    conditions = Conditions(frictions=FRICTIONS, steps=Conditions().steps[:1])

    def pair(run: int) -> tuple[Trial, ...]:
        walk = shaken(account.trajectory, run)
        (row,) = compliance_study(account.robot, walk, stiffness, (treatment,), conditions)
        return row.trials

    def numbers(trials: tuple[Trial, ...]) -> list[float | None]:
        return [number for trial in trials for number in (trial.fell_at, *trial.zmp_max_mm)]

    pairs = min(FEW, -(-bench.runs // len(FRICTIONS)))  # a study of all treatments takes minutes
    repeated = bench.repeated(pair, pairs, numbers)
    return [trial for trials in repeated for trial in trials]


def trial_of(bench: Bench, gait: str, treatment: str, stiffness: float) -> Trial:
    """The run at the largest friction, with its ZMP over time."""
    trials = row_of(bench, gait, treatment, stiffness).trials
    return max(trials, key=lambda trial: trial.friction)


def on_springs(bench: Bench, gait: str, treatment: str, key: str, stiffness: float) -> float | str | Scatter:
    """Largest ZMP error ``x`` or ``y`` [m] of the runs that stand, or how many fell.

    ``cut`` is the share by which the median is below that without compensation. Runs that fall have no
    largest error: if all do, the measure says so.
    """
    one_of("number of walks on springs", key, KEYS)
    row = row_of(bench, gait, treatment, stiffness)
    what, _, axis = key.rpartition(" ")
    k = 0 if axis == "x" else 1
    if key == "fallen":
        return f"{row.fallen} of {row.runs}"
    if row.fallen == row.runs:
        return f"all {row.runs} runs fall"
    if what == "cut":
        return row.cut[k] if row.cut is not None else "none completes without it"
    return Scatter(tuple(1e-3 * one.zmp_max_mm[k] for one in row.trials if one.fell_at is None))


def landing(bench: Bench, gait: str, treatment: str, key: str, stiffness: float) -> float | str:
    """When swinging feet touch the floor, of the run at the largest friction.

    ``lead``: median of the times before the planned double support [s]; ``peak``: time from the beginning of
    the nearest planned double support to the largest ZMP error [s]; ``order``: whether most touch ``before``
    it.
    """
    trial = trial_of(bench, gait, treatment, stiffness)
    if trial.zmp is None or not trial.leads:
        raise InputError(f"the run with treatment {treatment} has no landings")
    lead = float(np.median(trial.leads))
    error = np.linalg.norm(trial.zmp.contact - trial.zmp.planned, axis=1)
    away = trial.zmp.time[int(np.nanargmax(error))] - landings(bench.account(gait).trajectory)
    return one_of(
        "number of a landing",
        key,
        {
            "lead": lead,
            "peak": float(away[np.abs(away).argmin()]),
            "order": "before" if lead > 0.0 else "not before",
        },
    )
