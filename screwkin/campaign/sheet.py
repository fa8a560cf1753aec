"""The finished rows of a campaign as one CSV text and as arrays, in the order of the plan."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.campaign.outcome import MEASURES, STATUSES, Outcome
from screwkin.campaign.plan import Campaign, CampaignRow
from screwkin.campaign.statistics import Tally

Finished = Sequence[tuple[CampaignRow, Outcome]]


def finished_rows(campaign: Campaign, outcomes: Mapping[int, Outcome]) -> Finished:
    """Rows that ended, with their outcomes, in the order of the plan."""
    return [(row, outcomes[row.index]) for row in campaign.rows if row.index in outcomes]


def rows_csv(campaign: Campaign, rows: Finished) -> str:
    """Every row with its setting, seed and outcome, floats with every digit; empty: nothing was measured."""
    measured = [f.name for f in fields(Outcome) if f.name != "row"]
    head = ["row", "run", "seed", *campaign.axes, *measured]
    body = [
        [row.index, row.run, row.seed, *row.values.values(), *(getattr(o, name) for name in measured)]
        for row, o in rows
    ]
    return _csv([head, *body])


def settings_csv(campaign: Campaign, tallies: Sequence[Tally]) -> str:
    """Every setting with its counts."""
    names = [f.name for f in fields(Tally) if f.name != "interval"]
    head = ["setting", *campaign.axes, *names, "share", "low", "high"]
    body = [
        [k, *values.values(), *(getattr(t, name) for name in names), t.share, *(t.interval or (None, None))]
        for k, (values, t) in enumerate(zip(campaign.settings, tallies, strict=True))
    ]
    return _csv([head, *body])


def rows_arrays(campaign: Campaign, rows: Finished) -> dict[str, Array]:
    """One array a column, (rows,) each; NaN where nothing was measured. Reasons stand in the CSV file.

    ``status`` counts into ``statuses``, ``setting`` into ``settings`` (settings, keys) of texts, whose keys
    are ``keys``.
    """
    index = np.array([(r.index, r.setting, r.run, r.seed) for r, _ in rows], dtype=np.int64).reshape(-1, 4)
    measures = {
        name: np.array([_number(getattr(o, name)) for _, o in rows], dtype=np.float64) for name in MEASURES
    }
    return {
        **dict(zip(("row", "setting", "run", "seed"), index.T, strict=True)),
        "status": np.array([STATUSES.index(o.status) for _, o in rows], dtype=np.int64),
        "passed": np.array([o.passed for _, o in rows], dtype=bool),
        **measures,
        "statuses": np.array(STATUSES),
        "keys": np.array([*campaign.axes]),
        "settings": np.array([[*values.values()] for values in campaign.settings]),
    }


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _csv(lines: Sequence[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()
