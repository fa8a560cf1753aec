"""The campaign of walks: its plan, its rows that resume, and its page."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

import screwkin as sk
from benchmarks.walking import __main__ as command
from benchmarks.walking.page import markdown
from benchmarks.walking.pieces import WAYS, WORLDS, Piece, Row, pieces
from screwkin.campaign.plan import load_seeds
from screwkin.campaign.world import world_of

HERE = Path(command.__file__).parent


def row(way: str, run: int, fell: bool) -> Row:
    status = "fell" if fell else "stood"
    piece = Piece("mujoco", "AX-12", "x3", way, run, 100 + run)
    return asdict(piece) | {"status": status, "passed": not fell, "end_error_mm": 10.0 + run, "reason": ""}


def test_seeds_of_judging_are_none_of_tuning() -> None:
    tuning, judging = (load_seeds(HERE / f"{name}.txt") for name in ("tuning", "judging"))
    assert not {*tuning} & {*judging}
    assert len(judging) >= max(map(len, WORLDS.values()))


def test_every_world_is_one_that_a_campaign_can_play() -> None:
    robot = sk.load_robot("bioloid")
    for name, texts in WORLDS.items():
        for text in dict.fromkeys(texts):
            world = world_of(text, robot, 5, 5.0, 0.5)
            assert world.cells == 0
            assert any(world.imu_bias), name


def test_a_seed_is_played_in_all_ways_before_the_next() -> None:
    plan = [*pieces((7, 8, 9), ("mujoco",), ("AX-12",), ("x3",), most=2)]
    assert [piece.seed for piece in plan] == [7] * len(WAYS) + [8] * len(WAYS)
    assert [piece.way for piece in plan[: len(WAYS)]] == [*WAYS]


def test_the_page_counts_falls_and_pairs_seeds() -> None:
    """Against numbers by hand: 1 of 10 and 6 of 10, of which five on seeds where feedback stood."""
    rows = [row("feedback", k, k == 0) for k in range(10)] + [row("open loop", k, k < 6) for k in range(10)]
    lines = [line for line in markdown(rows).splitlines() if line.startswith("| MuJoCo")]
    assert lines[0].startswith("| MuJoCo | AX-12 | x3 | feedback | 10 | 1 | 1.8 to 40.4 % | 9 | 15 mm |")
    assert lines[1].endswith("| 0.062 (5 fell alone, feedback 0) |")  # 2/2^5
    refused = row("placo 1", 3, False) | {"status": "refused", "reason": "no such walk"}
    assert "- placo 1: no such walk" in markdown([*rows, refused])


def test_rows_that_stand_are_not_played_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign that was stopped in the middle of a line goes on with that row."""
    played: list[Piece] = []

    def play(piece: Piece) -> Row:
        played.append(piece)
        return row(piece.way, piece.run, False) | asdict(piece)

    monkeypatch.setattr(command, "row_of", play)
    rows, page = tmp_path / "rows.jsonl", tmp_path / "page.md"
    words = ["--engine", "mujoco", "--servo", "AX-12", "--world", "x3", "--rows", str(rows), "-o", str(page)]
    assert command.main([*words, "--most", "2"]) == 0
    whole = rows.read_text()
    assert len(whole.splitlines()) == len(played) == 2 * len(WAYS)
    rows.write_text(whole[:-20])
    played.clear()
    command.main([*words, "--most", "2"])
    assert len(played) == 1
    good = [line for line in rows.read_text().splitlines() if line.endswith("}")]
    assert sorted(map(json.dumps, map(json.loads, good))) == sorted(whole.splitlines())
    assert "| feedback | 2 | 0 |" in page.read_text()
