"""What became of a row of a campaign: a record, and its JSON data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal

from screwkin.campaign.plan import CampaignRow

Status = Literal["stood", "fell", "planned", "refused", "crashed"]
STATUSES: tuple[Status, ...] = ("stood", "fell", "planned", "refused", "crashed")


@dataclass(frozen=True)
class Outcome:
    """What became of a row.

    status: ``stood`` or ``fell`` in the simulation; ``planned``, the engine has no forces, so that nobody
    knows; ``refused``, there is no such walk; ``crashed``, the program failed. passed: every criterion of
    ``validate`` holds. reason: what speaks against it. Lengths in mm, times in s, angles in deg; None where
    nothing was measured. world: what differs from the plan, as ``validate --perturb`` takes it, with blanks
    between.
    """

    row: int
    status: Status
    passed: bool = False
    reason: str = ""
    fell_at: float | None = None
    margin_mm: float | None = None
    zmp_rms_mm: float | None = None
    end_error_mm: float | None = None
    slip_mm: float | None = None
    tilt_deg: float | None = None
    world: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return asdict(self)


MEASURES = tuple(
    f.name for f in fields(Outcome) if f.name not in ("row", "status", "passed", "reason", "world")
)
"""Fields of an outcome that were measured."""


def outcome_from_dict(data: Mapping[str, Any]) -> Outcome:
    """The outcome of ``to_dict``.

    Raises:
        TypeError, ValueError: the data are of none.
    """
    outcome = Outcome(**data)
    if outcome.status not in STATUSES or type(outcome.row) is not int:
        raise ValueError(f"{dict(data)} is no outcome of a row")
    return outcome


def crashed(row: CampaignRow, error: BaseException) -> Outcome:
    """The outcome of a row in which the program failed."""
    return Outcome(row.index, "crashed", reason=f"{type(error).__name__}: {error}".rstrip(": "))
