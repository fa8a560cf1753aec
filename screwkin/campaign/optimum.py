"""The best values of a gait's parameters within bounds, by the model's own margin or by campaigns of falls.

The search is scipy's differential evolution: a generation is a batch of settings, whose rows workers play as
those of any campaign. It is a function of its plan, so the rows that ended are not played again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.campaign.outcome import Outcome
from screwkin.campaign.plan import Campaign, CampaignRow
from screwkin.campaign.statistics import tally
from screwkin.errors import InputError, NoSolutionError, one_of

OBJECTIVES = ("margin", "falls")
MEMBERS = 6
"""Settings of a generation for every parameter."""
DIGITS = 6
"""Significant digits of a parameter."""

Batch = Callable[[Sequence[CampaignRow]], Mapping[int, Outcome]]
"""Plays rows, if they have not ended yet, and returns outcomes by number, theirs among them."""


@dataclass(frozen=True)
class Search:
    """What is searched.

    campaign: conditions and fixed parameters, one value each, and the seeds of every setting. bounds: least
    and greatest value by key. objective: ``margin``, the least margin of the plan, the greater the better; or
    ``falls``, their number over the seeds, and of settings with equally many the margin. evaluations:
    settings to try, about. seed: of the search.
    """

    campaign: Campaign
    bounds: Mapping[str, tuple[float, float]]
    objective: str
    evaluations: int
    seed: int

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        search = {key: value for key, value in vars(self).items() if key not in ("campaign", "bounds")}
        bounds = {key: list(ends) for key, ends in self.bounds.items()}
        return {**self.campaign.to_dict(), **search, "bounds": bounds}


@dataclass(frozen=True)
class Optimum:
    """The best setting, and the one that the search began with; lower costs are better.

    values, cost; first: the cost of the gait as it stands, infinite if there is no such walk; evaluations.
    """

    values: Mapping[str, str]
    cost: float
    first: float
    evaluations: int


def optimum(search: Search, play: Batch) -> Optimum:
    """The best setting.

    Args:
        search: what to search.
        play: the rows of a generation.

    Raises:
        NoSolutionError: no setting within the bounds is a walk.
    """
    from scipy.optimize import differential_evolution

    tried: list[tuple[float, Mapping[str, str]]] = []

    def costs(settings: Sequence[Mapping[str, str]]) -> list[float]:
        first = len(tried)
        rows = [_rows(search, first + k, values) for k, values in enumerate(settings)]
        ended = play([row for some in rows for row in some])
        found = [_cost(search.objective, [ended[row.index] for row in some]) for some in rows]
        tried.extend(zip(found, settings, strict=True))
        return found

    def generation(_: object, points: Sequence[Array]) -> list[float]:
        return costs([_values(search, x) for x in points])

    (start,) = costs([search.campaign.settings[0]])
    members = MEMBERS * len(search.bounds)
    differential_evolution(
        _never,
        [*search.bounds.values()],
        popsize=MEMBERS,
        maxiter=max(0, search.evaluations // members - 1),
        polish=False,
        updating="deferred",
        workers=generation,
        seed=np.random.default_rng(search.seed),
        tol=1e-4,
    )
    cost, values = min(tried, key=lambda one: one[0])
    if not math.isfinite(cost):
        raise NoSolutionError(
            f"none of {len(tried)} settings within {_listed(search)} is a walk; take other bounds"
        )
    return Optimum(values, cost, start, len(tried))


def check_search(search: Search) -> None:
    """Refuse what cannot be searched.

    Raises:
        InputError: unknown objective, bounds that are none, no evaluations, or an axis with several values.
    """
    several = [key for key, values in search.campaign.axes.items() if len(values) > 1]
    if several:
        raise InputError(f"--optimise takes bounds, --set {several[0]}=LEAST:GREATEST, not several values")
    one_of("--optimise", search.objective, OBJECTIVES)
    if not search.bounds:
        raise InputError("--optimise needs bounds of one parameter at least; write --set KEY=LEAST:GREATEST")
    if search.evaluations < 1:
        raise InputError(f"--evaluations {search.evaluations}: expected a whole number, at least 1")
    for key, (least, most) in search.bounds.items():
        if not least < most:
            raise InputError(f"--set {key}={least:g}:{most:g}: the least value comes first")


def _never(x: Array) -> float:
    raise AssertionError("settings are evaluated in generations")


def _listed(search: Search) -> str:
    return ", ".join(f"{key} {least:g} to {most:g}" for key, (least, most) in search.bounds.items())


def _values(search: Search, x: Array) -> dict[str, str]:
    """The setting at a point."""
    numbers = {key: f"{value:.{DIGITS}g}" for key, value in zip(search.bounds, x.tolist(), strict=True)}
    return {**search.campaign.settings[0], **numbers}


def _rows(search: Search, setting: int, values: Mapping[str, str]) -> list[CampaignRow]:
    seeds = search.campaign.seeds
    return [
        CampaignRow(setting * len(seeds) + run, setting, run, seed, values) for run, seed in enumerate(seeds)
    ]


def _cost(objective: str, outcomes: Sequence[Outcome]) -> float:
    """Infinite where a row says nothing: what did not come is not good."""
    t = tally(outcomes)
    if t.refused or t.crashed or t.margin_mm is None:
        return math.inf
    if objective == "margin":
        return -t.margin_mm
    return math.inf if t.planned else t.fell - 1e-3 * math.tanh(1e-2 * t.margin_mm)
