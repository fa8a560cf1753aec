"""What the rows of a campaign say together: counts by setting, Wilson intervals, paired comparison."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from screwkin.campaign.outcome import STATUSES, Outcome
from screwkin.campaign.plan import Campaign

CONFIDENCE = 0.95

Interval = tuple[float, float]


@dataclass(frozen=True)
class Tally:
    """The rows of one setting, or of several, counted.

    rows: finished ones; stood, fell, planned, refused, crashed: they add up to it. passed: by every
    criterion. interval: of the probability of a fall, at 95 % (Wilson), from the rows that stood or fell;
    None without any. margin_mm: the least one planned; tilt_deg: the median; None where there is none.
    """

    rows: int
    stood: int
    fell: int
    planned: int
    refused: int
    crashed: int
    passed: int
    interval: Interval | None
    margin_mm: float | None
    tilt_deg: float | None

    @property
    def share(self) -> float | None:
        """Falls by rows that stood or fell."""
        return self.fell / (self.stood + self.fell) if self.stood + self.fell else None

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return asdict(self)


@dataclass(frozen=True)
class Paired:
    """Two settings on equal seeds, by McNemar's exact test.

    first, second: numbers of the settings. pairs: seeds on which both stood or fell. only_first, only_second:
    seeds on which that one alone fell. p: probability of counts that differ at least as much, if both fall
    equally often.
    """

    first: int
    second: int
    pairs: int
    only_first: int
    only_second: int
    p: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return asdict(self)


def wilson(falls: int, rows: int) -> Interval | None:
    """Wilson's interval of a probability; None without rows.

    Args:
        falls: how often it happened.
        rows: how often it could.

    Source: Wilson (1927), as in ``scipy.stats``.
    """
    from scipy.stats import binomtest

    if rows == 0:
        return None
    interval = binomtest(falls, rows).proportion_ci(CONFIDENCE, "wilson")
    return float(interval.low), float(interval.high)


def mcnemar(only_first: int, only_second: int) -> float:
    """Probability of pairs that differ at least as much one way, if both ways are equally likely.

    Args:
        only_first: pairs in which it happened to the first alone.
        only_second: to the second alone.

    Source: McNemar (1947); exact, by the binomial distribution of the discordant pairs.
    """
    from scipy.stats import binomtest

    discordant = only_first + only_second
    return float(binomtest(only_first, discordant).pvalue) if discordant else 1.0


def tally(outcomes: Sequence[Outcome]) -> Tally:
    """Counts of outcomes, of any rows."""
    count = dict.fromkeys(STATUSES, 0)
    for outcome in outcomes:
        count[outcome.status] += 1
    margins = [o.margin_mm for o in outcomes if o.margin_mm is not None]
    tilts = [o.tilt_deg for o in outcomes if o.tilt_deg is not None]
    return Tally(
        rows=len(outcomes),
        **count,
        passed=sum(outcome.passed for outcome in outcomes),
        interval=wilson(count["fell"], count["stood"] + count["fell"]),
        margin_mm=min(margins, default=None),
        tilt_deg=median(tilts) if tilts else None,
    )


def tallies(campaign: Campaign, outcomes: Mapping[int, Outcome]) -> list[Tally]:
    """Counts of every setting, of the rows that ended.

    Args:
        campaign: the plan.
        outcomes: by number of row.
    """
    return [tally([*_of(campaign, outcomes, k).values()]) for k in range(len(campaign.settings))]


def paired(campaign: Campaign, outcomes: Mapping[int, Outcome], first: int, second: int) -> Paired:
    """Two settings compared on the seeds on which both stood or fell.

    Args:
        campaign: the plan.
        outcomes: by number of row.
        first: number of a setting.
        second: of another.

    """
    one, other = (_of(campaign, outcomes, k) for k in (first, second))
    both = [(one[run].status, other[run].status) for run in one if run in other]
    pairs = [pair for pair in both if {*pair} <= {"stood", "fell"}]
    only_first, only_second = pairs.count(("fell", "stood")), pairs.count(("stood", "fell"))
    p = mcnemar(only_first, only_second)
    return Paired(first, second, len(pairs), only_first, only_second, p)


def comparisons(campaign: Campaign, outcomes: Mapping[int, Outcome]) -> Iterator[Paired]:
    """Every setting but the first against the first."""
    for k in range(1, len(campaign.settings)):
        yield paired(campaign, outcomes, 0, k)


def _of(campaign: Campaign, outcomes: Mapping[int, Outcome], setting: int) -> dict[int, Outcome]:
    """Outcomes of a setting by run."""
    runs, first = len(campaign.seeds), setting * len(campaign.seeds)
    return {run: outcomes[first + run] for run in range(runs) if first + run in outcomes}
