"""``screwkin sweep --optimise``: the best gait within bounds, stored as a gait file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

from screwkin.campaign.optimum import Optimum, Search, check_search, optimum
from screwkin.campaign.outcome import Outcome
from screwkin.campaign.plan import CampaignRow
from screwkin.campaign.row import gait_of, played_row
from screwkin.campaign.run import Workers, outcomes, standing_workers
from screwkin.campaign.statistics import tally
from screwkin.campaign.store import journal
from screwkin.cli.folder import output_folder
from screwkin.cli.output import print_json, progress_bar, say
from screwkin.errors import InputError
from screwkin.files import atomic_write
from screwkin.gait.write import gait_toml

OPTIMUM = "optimum.toml"


def bounds_of(assignments: Sequence[str]) -> tuple[dict[str, tuple[float, float]], list[str]]:
    """Bounds of ``KEY=LEAST:GREATEST`` texts by key, and the texts that are no bounds.

    Raises:
        InputError: an end is no number, or a key has bounds twice.
    """
    bounds: dict[str, tuple[float, float]] = {}
    others = []
    for text in assignments:
        key, _, value = (part.strip() for part in text.partition("="))
        if value.count(":") != 1 or value.startswith("["):
            others.append(text)
            continue
        if key in bounds:
            raise InputError(f"--set {key} is given twice; once is enough")
        try:
            least, most = (float(end) for end in value.split(":"))
        except ValueError:
            raise InputError(
                f"--set {text!r} are no bounds; write KEY=LEAST:GREATEST, as Tc=0.8:1.2"
            ) from None
        bounds[key] = least, most
    return bounds, others


def optimise(
    robot: str,
    search: Search,
    workers: AbstractContextManager[Workers],
    output: Path | None,
    as_json: bool,
) -> int:
    """Search, write the optimum as a gait file and print it; 1 if a row crashed.

    Raises:
        InputError: the search is none. NoSolutionError: no setting is a walk.
    """
    check_search(search)
    campaign = search.campaign
    for end in (0, 1):  # keys and values, before anything is played
        gait_of(
            campaign, campaign.settings[0] | {key: f"{ends[end]:g}" for key, ends in search.bounds.items()}
        )
    with output_folder(output, "sweep", robot) as folder:
        with journal(folder, search.to_dict()) as rows, workers as some, standing_workers(some) as ready:
            with progress_bar("search") as done:

                def play(batch: Sequence[CampaignRow]) -> Mapping[int, Outcome]:
                    left = [row for row in batch if row.index not in rows.outcomes]
                    for outcome in outcomes(partial(played_row, campaign), left, ready):
                        rows.append(outcome)
                        done(min(1.0, len(rows.outcomes) / (search.evaluations * len(campaign.seeds))))
                    return rows.outcomes

                best = optimum(search, play)
            total = tally([*rows.outcomes.values()])
        with atomic_write(folder / OPTIMUM) as file:
            file.write(gait_toml(gait_of(campaign, best.values)))
    if as_json:
        counts = {"rows": total.rows, "falls": total.fell, "interval": total.interval}
        values = {key: float(best.values[key]) for key in search.bounds}
        costs = {"cost": best.cost, "first": best.first, "evaluations": best.evaluations}
        about = {"objective": search.objective, "crashed": total.crashed, "folder": str(folder)}
        print_json({**counts, "optimum": values, **costs, **about})
    else:
        say(_text(search, best))
        say(f"gait in {folder / OPTIMUM}: screwkin walk {robot} --gait {folder / OPTIMUM}")
    return 1 if total.crashed else 0


def _text(search: Search, best: Optimum) -> str:
    """The best values, and what they gain."""
    values = ", ".join(f"{key} {best.values[key]}" for key in search.bounds)
    if search.objective == "margin":
        first = f"{-best.first:.2f} mm" if best.first < float("inf") else "no walk"
        gain = f"least margin {-best.cost:.2f} mm, of the gait as it stands {first}"
    else:
        first = f"{round(best.first)}" if best.first < float("inf") else "no walk"
        runs = len(search.campaign.seeds)
        gain = f"{round(best.cost)} falls in {runs} runs, of the gait as it stands {first}"
    return f"{values}: {gain}; {best.evaluations} settings tried"
