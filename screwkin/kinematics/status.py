"""What became of each sample of a batch, with help for the reader."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Outcome of a position or rate solution."""

    CONVERGED = 0
    UNREACHABLE = 1
    SINGULAR = 2
    OUT_OF_LIMITS = 3

    @property
    def help(self) -> str:
        """What happened and what to change."""
        return {
            Status.CONVERGED: "the loops close and every joint is within its limits",
            Status.UNREACHABLE: "no joint positions close the loop; bring the target nearer",
            Status.SINGULAR: "the limb has lost a direction of motion; bend it, or impose another coupling",
            Status.OUT_OF_LIMITS: "the loop closes only with a joint beyond its limits; move the target",
        }[self]


CLOSED = 1e-10
"""Largest closure error [m and rad] that counts as converged."""


SINGULAR = 1e-5
"""Smallest length-normalised singular value of a limb that counts as regular."""
