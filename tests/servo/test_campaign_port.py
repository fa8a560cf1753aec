"""Plays over a pseudo-terminal in real time, one of each kind: run them on an idle computer."""

from __future__ import annotations

import pytest

from tests.servo.campaign import prepare
from tests.servo.campaign_port import KINDS, MODELS, campaign, remarks, summary

pytestmark = pytest.mark.realtime


def test_a_run_of_each_kind_over_a_port_ends_as_it_must(tmp_path):
    for model in MODELS:
        prepare(tmp_path / model, simulated=False, model=model)
    results = tmp_path / "runs.jsonl"
    seeds = [0, 3, *range(100, 100 + len(KINDS))]
    rows = campaign(seeds, tmp_path, results)
    assert [row["problems"] for row in rows] == [[]] * len(rows)
    assert campaign(seeds, tmp_path, results) == rows, "read from the file"
    assert "2 finished" in remarks(rows)
    assert summary(rows).count("AX-12A") >= 1
