"""Walks played in real time over a pseudo-terminal, behind adapters of 0 to 40 ms, with guardians.

    python -m tests.servo.campaign_port --results runs.jsonl   # 50 healthy plays, 200 runs, and their table
    python -m tests.servo.campaign_port --docs                 # and the table written into docs/hardware.md

The player is a process of its own, which starts a guardian for each play; servos and judge live in this one.
Half of the runs are AX-12A, which are read one by one, half MX-28 of protocol 2.0, read in one packet. Needs
an idle computer: where others keep it busy, frames are late, and a play may be stopped for that.
"""

from __future__ import annotations

import argparse
import gc
import json
import math
import multiprocessing
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from screwkin.model.table import load_robot
from screwkin.servo.line import MonotonicClock
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.faults import InjectedFault
from screwkin.servo.virtual.robot import virtual_servos
from screwkin.servo.virtual.terminal import PseudoTerminal
from tests.servo import campaign_judge as judge
from tests.servo.campaign import DOCS, called, prepare, quickly_ready, written_between
from tests.servo.campaign_plan import Ended, Plan

MARKS = (
    "<!-- ports: python -m tests.servo.campaign_port --docs -->",
    "<!-- end of port campaign -->",
)
MODELS = {"AX-12A": judge.AX_12A, "MX-28-2": judge.MX_28_2}
KINDS = ("healthy", "blocked", "deaf", "dropped")
HEALTHY = 50
LATENCIES = (0.0, 0.001, 0.008, 0.016)
"""Adapters of the healthy plays [s]; the last stands before servos that are read together."""
SET = 0.001
"""What an adapter takes [s] once its timer is set."""
SLOW = 0.004
"""Adapters [s] from which on a play may be refused, with the timer named."""


@dataclass(frozen=True)
class PortPlan:
    """One run: what goes wrong with one servo, when after torque came on [s], behind which adapter [s]."""

    seed: int
    kind: str
    model: str
    adapter: float
    at: float
    until: float
    id: int
    state: str

    @classmethod
    def of(cls, seed: int) -> PortPlan:
        """The plan of a seed; the first ones are the healthy plays."""
        rng = np.random.default_rng((seed, 7))
        healthy = seed < HEALTHY
        latency = LATENCIES[seed % len(LATENCIES)]
        at = float(rng.uniform(0.2, 3.0))
        return cls(
            seed=seed,
            kind="healthy" if healthy else KINDS[seed % len(KINDS)],
            model="MX-28-2" if (latency > 0.008 if healthy else seed // len(KINDS) % 2) else "AX-12A",
            adapter=latency if healthy else float(rng.uniform(0.0, 0.04)),
            at=at,
            until=math.inf if rng.random() < 0.5 else at + float(rng.uniform(0.05, 2.0)),
            id=int(rng.integers(1, 19)),
            state=str(rng.choice(["hold", "limp"])),
        )


class Elapsed(MonotonicClock):
    """The computer's clock, from 0."""

    def __init__(self) -> None:
        self._from = time.monotonic()

    def now(self) -> float:
        return time.monotonic() - self._from


class Mounted(VirtualBus):
    """Servos that record what they are told, and among which something goes wrong once torque is on."""

    def __init__(self, plan: PortPlan, table: Path) -> None:
        self.plan, self.told, self.manual = plan, [], MODELS[plan.model]
        self.began = math.nan
        servos = virtual_servos(load_robot(table), return_delay=500e-6)
        super().__init__(servos, Elapsed(), seed=plan.seed, witness=self._all, adapter=plan.adapter)

    def _all(self, time: float, id: int, command: Any) -> None:
        if command.kind not in ("write", "register"):
            return
        self.told.append((time, id, command.address, command.data))
        if math.isnan(self.began) and command.address == self.manual.torque_enable and command.data[0]:
            self.began = time
            if self.plan.kind != "healthy":
                begin, end = time + self.plan.at, time + self.plan.until
                self.inject(InjectedFault(self.plan.kind, begin, end, self.plan.id))


def played(words: Sequence[Any]) -> tuple[int, str, str]:
    """``screwkin send`` in the player's process."""
    with patch("screwkin.cli.send.ready", quickly_ready):
        return called("send", *words)


def run(plan: PortPlan, folder: Path, player: ProcessPoolExecutor) -> dict[str, Any]:
    """One run, judged, as JSON data."""
    table = folder / plan.model / "tight.toml"
    line = Mounted(plan, table)
    with tempfile.TemporaryDirectory() as place, PseudoTerminal(line) as terminal:
        words = (
            folder / plan.model / "trajectory.npz", "--robot", table, "--port", terminal.path, "--go",
            "--json", "-o", place, "--on-fault", plan.state, "--at-end", plan.state,
        )  # fmt: skip
        code, out, err = player.submit(played, words).result()
        ended = Ended(as_campaign(plan, line), code, json.loads(out or "{}"), err.strip(), line.clock.now())
        log = Path(place) / "play.npz"
        late = lateness(log) if log.exists() else []
        with terminal.lock:
            problems = list(problems_of(plan, line, ended, tomllib.loads(table.read_text(encoding="utf-8"))))
    fault = (ended.data.get("faults") or [{"kind": ""}])[0]["kind"]
    return {
        "seed": plan.seed, "kind": plan.kind, "model": plan.model, "adapter": plan.adapter, "code": code,
        "outcome": ended.outcome, "fault": fault, "late": late, "late_frames": ended.data.get("late_frames"),
        "message": ended.message, "problems": problems,
    }  # fmt: skip


def as_campaign(plan: PortPlan, line: Mounted) -> Plan:
    """The plan as the judge of the other campaign reads it, in times of the bus's clock."""
    begin = plan.at + line.began if line.told else 0.0
    base = Plan.of(plan.seed, 1.0)
    return replace(
        base, kind="noise" if healthy(plan) else plan.kind, id=None if healthy(plan) else plan.id,
        at=begin, until=begin + plan.until - plan.at, adapter=plan.adapter, torque=1.0,
        on_fault=plan.state, at_end=plan.state,
    )  # fmt: skip


def healthy(plan: PortPlan) -> bool:
    """Whether nothing goes wrong in a run."""
    return plan.kind == "healthy"


def lateness(log: Path) -> list[float]:
    """By how much the frames of a play were sent late [ms]: half, 99 % and all of them."""
    with np.load(log, allow_pickle=False) as file:
        late = 1e3 * (file["sent"] - file["time"])
    return [round(float(value), 3) for value in np.quantile(late, (0.5, 0.99, 1.0))] if len(late) else []


def problems_of(plan: PortPlan, line: Mounted, ended: Ended, table: dict[str, Any]) -> Iterator[str]:
    """What must never happen, over a port."""
    yield from judge.written_beyond(line, table, ended.plan, line.manual)
    if ended.outcome == "refused":
        if line.told:
            yield "refused, and yet something was written"
        if plan.adapter <= SLOW or "latency_timer" not in ended.message:
            yield f"refused behind {1e3 * plan.adapter:.1f} ms: {ended.message}"
        return
    unsure = bool(ended.data["unconfirmed"]) or ended.data["state"] == "unknown"
    if ended.code != (4 if ended.data["faults"] or unsure else 0):
        yield f"exit code {ended.code} with {ended.outcome}"
    kinds = [fault["kind"] for fault in ended.data["faults"]]
    if healthy(plan) and kinds:
        yield f"a healthy play was stopped: {ended.message}"
    yield from judge.called_dead(ended, table)
    yield from judge.unnoticed(line, ended, table, line.manual)
    yield from judge.left_otherwise(line, ended, table)


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """The table of the documentation."""
    head = (
        "adapter [ms]", "servos", "runs", "played to the end", "stopped, all servos confirm",
        "stopped, some named", "nobody answers", "refused: answers too slow", "faults",
    )  # fmt: skip
    table = [head, ("---",) * len(head)]
    for low, high in ((0, 1.5), (1.5, 8.5), (8.5, 16.5), (16.5, 40)):
        for model in MODELS:
            mine = [row for row in rows if row["model"] == model and low <= 1e3 * row["adapter"] <= high]
            if mine:
                count = Counter(row["outcome"] for row in mine)
                faults = Counter(row["fault"] for row in mine if row["fault"])
                named = ", ".join(f"{name} {n}" for name, n in faults.most_common())
                columns = (count[name] for name in ("played", "stopped", "named", "silent", "refused"))
                table.append((f"{low:g} to {high:g}", model, len(mine), *columns, named))
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in table)


def remarks(rows: Sequence[dict[str, Any]]) -> str:
    """How many healthy plays finished, and how late frames were."""
    mine = [row for row in rows if row["seed"] < HEALTHY]
    ended = sum(row["outcome"] == "played" for row in mine)
    timers = sum("set" in row for row in mine)
    late = np.array([row["late"] for row in rows if row["late"]]).reshape(-1, 3)
    if not len(late):
        return "No play has begun."
    half, most, all_ = np.median(late[:, 0]), np.median(late[:, 1]), late[:, 2].max()
    frames = sum(row["late_frames"] or 0 for row in rows)
    return (
        f"Of {len(mine)} healthy plays behind 0, 1, 8 and 16 ms, {ended} finished, {timers} of them once "
        f"they had been refused and the `latency_timer` they named was set to 1 ms. Frames were sent "
        f"{half:.2f} ms late in the median play's median, {most:.2f} ms in its 99 %, {all_:.0f} ms at most; "
        f"{frames} of them more than 2 ms late."
    )


def campaign(seeds: Sequence[int], folder: Path, results: Path | None) -> list[dict[str, Any]]:
    """All runs of some seeds; those that stand in a file are read from it, the others appended to it."""
    lines = results.read_text(encoding="utf-8").splitlines() if results and results.exists() else []
    rows = {row["seed"]: row for row in map(json.loads, lines)}
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as player:
        for seed in seeds:
            if seed not in rows:
                plan = PortPlan.of(seed)
                row = run(plan, folder, player)
                if healthy(plan) and row["outcome"] == "refused" and not row["problems"]:
                    row = run(replace(plan, adapter=SET), folder, player) | {
                        "adapter": plan.adapter,
                        "set": True,
                    }
                rows[seed] = row
                if results:
                    with results.open("a", encoding="utf-8") as file:
                        print(json.dumps(rows[seed]), file=file)
    return [rows[seed] for seed in seeds]


def main(words: Sequence[str] | None = None) -> int:
    """Run the campaign from the command line; 1 if anything was not as it must be."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--runs", type=int, default=HEALTHY + 200)
    options.add_argument("--results", type=Path, help="file of runs, one a line, to go on with")
    options.add_argument("--docs", action="store_true", help="write the table into docs/hardware.md")
    chosen = options.parse_args(words)
    with tempfile.TemporaryDirectory() as place:
        for model in MODELS:
            prepare(Path(place) / model, simulated=False, model=model)
        gc.collect()
        gc.freeze()  # servos do not stand still while a computer tidies up
        rows = campaign(range(chosen.runs), Path(place), chosen.results)
    text = f"{summary(rows)}\n\n{remarks(rows)}"
    print(text)
    bad = [row for row in rows if row["problems"]]
    for row in bad:
        print(f"seed {row['seed']} ({row['kind']}): {'; '.join(row['problems'][:3])}")
    print(f"{len(rows)} runs, {len(bad)} not as they must be")
    if chosen.docs:
        DOCS.write_text(written_between(DOCS.read_text(encoding="utf-8"), MARKS, text), encoding="utf-8")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
