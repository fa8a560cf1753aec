"""Measures of a walk on elastic joints in the simulator, with and without compensation."""

from __future__ import annotations

from screwkin.analysis.compliance import TREATMENTS, Conditions, StudyRow, Trial, compliance_study
from screwkin.errors import one_of
from screwkin.papers.bench import Bench

FRICTIONS = (0.8, 1.0)
KEYS = ("x", "y", "cut x", "cut y", "fallen", "runs", "range x", "range y")


def row_of(bench: Bench, gait: str, treatment: str, stiffness: float) -> StudyRow:
    """The runs of a treatment, together with those without any."""
    account = bench.account(gait)
    one_of("treatment", treatment, TREATMENTS)
    conditions = Conditions(frictions=FRICTIONS, steps=Conditions().steps[:1])
    key = ("springs", account.trajectory.sha256, stiffness, *FRICTIONS)
    rows = bench.once(
        key,
        lambda: compliance_study(account.robot, account.trajectory, stiffness, conditions=conditions),
    )
    return next(row for row in rows if row.treatment == treatment)


def trial_of(bench: Bench, gait: str, treatment: str, stiffness: float) -> Trial:
    """The run at the largest friction, with its ZMP over time."""
    trials = row_of(bench, gait, treatment, stiffness).trials
    return max(trials, key=lambda trial: trial.friction)


def on_springs(
    bench: Bench, gait: str, treatment: str, key: str, stiffness: float
) -> float | str | list[float]:
    """Median over the runs of the largest ZMP error ``x`` or ``y`` [m], or how many fell.

    ``cut`` is the share by which the median is below that without compensation, ``range`` the least and the
    greatest. Runs that fall have no largest error: if all do, the measure says so.
    """
    one_of("number of walks on springs", key, KEYS)
    row = row_of(bench, gait, treatment, stiffness)
    what, _, axis = key.rpartition(" ")
    k = 0 if axis == "x" else 1
    if key in ("fallen", "runs"):
        return row.fallen if key == "fallen" else row.runs
    if row.median_mm is None or row.range_mm is None:
        return f"all {row.runs} runs fall"
    if what == "range":
        return [1e-3 * value for value in row.range_mm[k]]
    if what == "cut":
        return row.cut[k] if row.cut is not None else "none completes without it"
    return 1e-3 * row.median_mm[k]
