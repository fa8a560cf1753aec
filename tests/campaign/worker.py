"""A campaign of rows that cost nothing, some of which end their process; and a program that plays it.

python -m tests.campaign.worker FOLDER JOBS
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from screwkin.campaign.outcome import Outcome
from screwkin.campaign.plan import Campaign, CampaignRow
from screwkin.campaign.run import local_workers, outcomes
from screwkin.campaign.store import journal

PLAN = Campaign("", {}, {"Tc": tuple(map(str, range(4)))}, tuple(range(10, 20)), {})
LETHAL = 7
"""The row whose process dies."""


def play(row: CampaignRow) -> Outcome:
    """An outcome that tells rows apart."""
    return Outcome(row.index, "stood", margin_mm=row.seed / 3 + int(row.values["Tc"]))


def slow_play(row: CampaignRow) -> Outcome:
    time.sleep(0.02)
    return play(row)


def lethal_play(row: CampaignRow) -> Outcome:
    if row.index == LETHAL:
        os._exit(3)
    return play(row)


def threads(row: CampaignRow) -> Outcome:
    """What a worker's environment says of threads."""
    return Outcome(row.index, "stood", reason=os.environ["OMP_NUM_THREADS"] + os.environ["MKL_NUM_THREADS"])


def main() -> None:
    with journal(Path(sys.argv[1]), PLAN.to_dict()) as rows:
        left = [row for row in PLAN.rows if row.index not in rows.outcomes]
        for outcome in outcomes(slow_play, left, local_workers(int(sys.argv[2]))):
            rows.append(outcome)


if __name__ == "__main__":
    main()
