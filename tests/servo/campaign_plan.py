"""What happens in a run of the campaign, and how it ended."""

from __future__ import annotations

import json
import math
import signal
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from screwkin.servo.virtual.faults import KINDS, InjectedFault

OTHERS = ("stalled", "suspended", "clock", "interrupted", "killed", "unguarded")
"""Faults of the computer, not of the bus: it stands still for a moment, or for long; its wall clock jumps; a
signal asks the play to end; the player dies, in the middle of a packet; its guardian does."""
BEFORE = ("misconfigured", "twin")
"""Faults that are there from the start: a register holds something else; two servos have one id."""
ALL_KINDS = (*KINDS, *OTHERS, *BEFORE)
HARMLESS = ("noise", "blocked", *OTHERS)
"""Kinds after which every servo hears and answers: whoever is called dead is alive."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
REGISTERS = (
    *({"angle_limit_low": 0, "angle_limit_high": 0}, {"angle_limit_high": 500}, {"angle_limit_low": 520}),
    *({"max_torque": 300}, {"shutdown": 0}, {"shutdown": 4}, {"status_level": 0}, {"status_level": 1}),
    *({"alarm_led": 0}, {"return_delay": 254}),
)
"""What a servo may be left with by its former owner: wheel mode, own limits, weak, careless, silent, slow."""
OF_ANSWERS = ("deaf", "dropped", "corrupted", "truncated", "late", "noise", "mangled")


@dataclass(frozen=True)
class Plan:
    """What happens in a run; ``id`` is the servo concerned, None all."""

    seed: int
    kind: str
    at: float
    until: float
    id: int | None
    share: float
    volts: float
    stall: float
    torque: float
    on_fault: str
    at_end: str
    adapter: float
    signal: int
    registers: dict[str, int]

    @classmethod
    def of(cls, seed: int, lasts: float) -> Plan:
        """The plan of a seed, for a play that lasts so long [s]."""
        rng = np.random.default_rng(seed)
        kind = ALL_KINDS[seed % len(ALL_KINDS)]
        at = float(rng.uniform(0.0, lasts))
        until = math.inf if rng.random() < 0.5 else at + float(rng.uniform(0.05, 2.0))
        nobodys = kind in ("pulled", "mangled", *OTHERS) or rng.random() < 0.3
        id = int(rng.integers(1, 19))
        return cls(
            seed=seed,
            kind=kind,
            at=0.0 if kind in BEFORE else at,
            until=math.inf if kind == "blocked" else until,
            id=None if nobodys and kind not in BEFORE else id,
            share=float(rng.uniform(0.05, 1.0)) if kind in OF_ANSWERS and rng.random() < 0.5 else 1.0,
            volts=float(rng.uniform(3.0, 9.0)),
            stall=float(rng.uniform(2.0, 60.0) if kind == "suspended" else rng.uniform(0.05, 0.5)),
            torque=float(rng.uniform(0.3, 1.0)),
            on_fault=str(rng.choice(["hold", "limp"])),
            at_end=str(rng.choice(["hold", "limp"])),
            adapter=0.001 if rng.random() < 0.7 else float(rng.uniform(0.0, 0.04)),
            signal=int(rng.choice(SIGNALS)),
            registers=REGISTERS[int(rng.integers(len(REGISTERS)))],
        )

    @property
    def faults(self) -> list[InjectedFault]:
        """What the virtual bus is told of it."""
        if self.kind in (*OTHERS, *BEFORE):
            return []
        return [InjectedFault(self.kind, self.at, self.until, self.id, self.share, self.volts)]


_SEEN = ("code", "data", "message", "time", "problems")


@dataclass
class Ended:
    """How a run ended, and what was wrong with that: ``problems`` must be empty."""

    plan: Plan
    code: int = -1
    data: dict[str, Any] = field(default_factory=dict)
    message: str = ""
    time: float = math.nan
    problems: list[str] = field(default_factory=list)

    def row(self) -> str:
        """As a line of JSON; what the plan is follows from its seed."""
        return json.dumps({"seed": self.plan.seed, **{name: getattr(self, name) for name in _SEEN}})

    @classmethod
    def of(cls, row: str, lasts: float) -> Ended:
        """The run of such a line."""
        seen = json.loads(row)
        return cls(Plan.of(seen.pop("seed"), lasts), **seen)

    @property
    def outcome(self) -> str:
        """In which column of the table it belongs."""
        if "faults" not in self.data:
            return "refused"
        if self.data["state"] == "unknown":
            return "silent"
        if self.data["unconfirmed"]:
            return "named"
        return "stopped" if self.data["faults"] else "played"
