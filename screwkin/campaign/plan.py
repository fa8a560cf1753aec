"""The plan of a campaign: settings times seeds, every row a record with its own seed.

A plan is a pure function of its arguments. Which process plays a row, after which others, or after how many
interruptions, changes nothing in what the row says.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from decimal import Decimal, InvalidOperation
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.errors import InputError
from screwkin.files import read_file, text_sha256
from screwkin.gait.settings import items_of

MOST_ROWS = 1_000_000
"""Rows of a campaign; a slip in a range would plan more."""
CONDITIONS = ("gait", "engine", "servo", "feedback", "perturb")
"""Keys of a setting that are no parameters of its gait."""
OFF, ON = "off", "on"
"""Values of the condition ``feedback``."""

Axes = Mapping[str, tuple[str, ...]]


@dataclass(frozen=True)
class CampaignRow:
    """One walk to simulate: its number, setting, run and seed.

    values: texts by key, as ``--set`` takes them. Row number = setting * runs + run; a run has the same seed
    in every setting, so that settings can be compared in pairs.
    """

    index: int
    setting: int
    run: int
    seed: int
    values: Mapping[str, str]


@dataclass(frozen=True)
class Campaign:
    """All that decides what the rows of a campaign say; it pickles, and goes to every process.

    robot: text of the table. gaits: documents as JSON by the names that the axis ``gait`` uses. axes: texts
    to try by key; their product, the last key fastest, are the settings. seeds: one a run. versions: of what
    computes.
    """

    robot: str
    gaits: Mapping[str, str]
    axes: Axes
    seeds: tuple[int, ...]
    versions: Mapping[str, str]

    @property
    def settings(self) -> tuple[dict[str, str], ...]:
        """Every combination of the values of the axes."""
        return tuple(dict(zip(self.axes, values, strict=True)) for values in product(*self.axes.values()))

    @property
    def rows(self) -> tuple[CampaignRow, ...]:
        """All rows, in their order."""
        return tuple(
            CampaignRow(setting * len(self.seeds) + run, setting, run, seed, values)
            for setting, values in enumerate(self.settings)
            for run, seed in enumerate(self.seeds)
        )

    @property
    def varied(self) -> tuple[str, ...]:
        """Keys of the axes that have several values."""
        return tuple(key for key, values in self.axes.items() if len(values) > 1)

    def to_dict(self) -> dict[str, Any]:
        """As JSON data, robot and gaits by the hashes of their texts."""
        data: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        gaits = {name: text_sha256(text) for name, text in self.gaits.items()}
        return data | {"robot": text_sha256(self.robot), "gaits": gaits}


def check_rows(axes: Axes, runs: int) -> None:
    """Refuse campaigns that never end.

    Raises:
        InputError: more than ``MOST_ROWS`` rows.
    """
    rows = runs * math.prod(map(len, axes.values()))
    if rows > MOST_ROWS:
        sizes = " x ".join(f"{key} {len(values):,}" for key, values in axes.items() if len(values) > 1)
        raise InputError(f"{rows:,} rows ({sizes} x {runs:,} runs), at most {MOST_ROWS:,}; take larger steps")


def seeds_from(seed: int, runs: int) -> tuple[int, ...]:
    """So many seeds that depend on one; more of them begin with the same.

    Args:
        seed: at least 0.
        runs: how many.

    Raises:
        InputError: the seed is negative.
    """
    if seed < 0:
        raise InputError(f"--seed {seed}: expected a whole number, at least 0")
    words = np.random.SeedSequence(seed).generate_state(runs, np.uint64)
    return tuple(int(word) >> 11 for word in words)  # 53 bits, which every reader of JSON holds


def load_seeds(path: Path) -> tuple[int, ...]:
    """The seeds of a file, one a line; blank lines and what follows ``#`` say nothing.

    Raises:
        InputError: it cannot be read, or a line is no whole number or a repeated one; it names the line.
    """
    try:
        lines = read_file(path).decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot read seeds: {error}") from None
    seeds: dict[int, int] = {}
    for number, line in enumerate(lines, 1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        if not (text.isascii() and text.isdecimal()) or int(text) >= 2**53:
            raise InputError(f"{path} line {number}: {text!r} is no seed; write a whole number below 2^53")
        if int(text) in seeds:
            first = seeds[int(text)]
            raise InputError(
                f"{path} line {number}: seed {text} stands in line {first} too; each counts once"
            )
        seeds[int(text)] = number
    if not seeds:
        raise InputError(f"{path} holds no seed; write one whole number a line")
    return tuple(seeds)


def axis_values(key: str, text: str) -> tuple[str, ...]:
    """The values of ``--set key=text``: a range ``a:b:step`` with both ends, a list ``a,b``, or one value.

    Args:
        key: its name, for messages.
        text: a list of key points in brackets is one value.

    Raises:
        InputError: the range is none, or a value is listed twice.
    """
    if text.startswith("["):
        return (text,)
    if ":" in text:
        return _range(key, text)
    values = tuple(items_of(text))
    if not all(values):
        raise InputError(f"--set {key}={text}: a value is missing; write --set {key}=a,b,c")
    twice = [value for value in dict.fromkeys(values) if values.count(value) > 1]
    if twice:
        raise InputError(f"--set {key}={text}: {twice[0]} is listed twice; each value counts once")
    return values


def _range(key: str, text: str) -> tuple[str, ...]:
    """Decimal numbers, exactly as one would write them."""
    example = f"write --set {key}=FROM:TO:STEP, as {key}=0.8:1.2:0.1"
    try:
        first, last, step = (Decimal(part.strip()) for part in text.split(":"))
    except (ValueError, InvalidOperation):
        raise InputError(f"--set {key}={text} is no range; {example}") from None
    if not all(number.is_finite() for number in (first, last, step)):
        raise InputError(f"--set {key}={text} is not finite; {example}")
    if step == 0 or (last - first) / step < 0:
        raise InputError(f"--set {key}={text}: steps of {step} from {first} never reach {last}; {example}")
    count = int((last - first) / step) + 1
    if count > MOST_ROWS:
        raise InputError(f"--set {key}={text}: {count:,} values, at most {MOST_ROWS:,}; take a larger step")
    return tuple(format((first + k * step).normalize(), "f") for k in range(count))


def differing_keys(here: Mapping[str, Any], there: Mapping[str, Any]) -> Sequence[str]:
    """Keys in which two plans differ."""
    return [key for key in {**here, **there} if here.get(key) != there.get(key)]
