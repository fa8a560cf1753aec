"""python -m benchmarks.walking: walks with feedback, open loop and placo's in worlds that nobody planned for.

Every row is written as it ends, and rows that stand in the file are not played again: stop it at any time.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from dataclasses import asdict
from pathlib import Path

from benchmarks.machine import pin_threads
from benchmarks.walking.page import markdown
from benchmarks.walking.pieces import ENGINES, SERVOS, WAYS, WORLDS, Piece, Row, pieces, row_of
from screwkin.campaign.plan import load_seeds

SEEDS = Path(__file__).with_name("judging.txt")
ROWS = Path(__file__).parents[1] / "results" / "walking.jsonl"


def arguments(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.walking", description=__doc__)
    for name, choices in (("engine", ENGINES), ("servo", SERVOS), ("world", WORLDS), ("way", WAYS)):
        parser.add_argument(f"--{name}", action="append", choices=tuple(choices), help="default: all")
    parser.add_argument("--most", type=int, default=60, help="runs of each")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no row after that time")
    parser.add_argument(
        "--seeds", type=Path, default=SEEDS, help="tuning.txt beside it is for choosing gains"
    )
    parser.add_argument("--rows", type=Path, help="default: results/walking.jsonl, or beside other seeds")
    parser.add_argument("-o", "--output", type=Path, help="default: the page of that name beside the rows")
    asked = parser.parse_args(words)
    asked.rows = asked.rows or (ROWS if asked.seeds == SEEDS else asked.seeds.with_suffix(".jsonl"))
    asked.output = asked.output or asked.rows.with_suffix(".md")
    return asked


def rows_of(path: Path) -> list[Row]:
    """Rows of a file; a line that was torn is none."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [json.loads(line) for line in lines if line.endswith("}")]


def identity(row: Row) -> tuple[object, ...]:
    """Which run a row is of."""
    return tuple(row[key] for key in Piece.__dataclass_fields__)


def main(words: list[str] | None = None) -> int:
    asked, began = arguments(words), time.monotonic()
    warnings.simplefilter("ignore")
    asked.rows.parent.mkdir(parents=True, exist_ok=True)
    rows = rows_of(asked.rows)
    done = {identity(row) for row in rows}
    plan = pieces(
        load_seeds(asked.seeds),
        asked.engine or ENGINES,
        asked.servo or tuple(SERVOS),
        asked.world or tuple(WORLDS),
        asked.way or tuple(WAYS),
        asked.most,
    )
    with asked.rows.open("a", encoding="utf-8") as file:
        for piece in plan:
            if identity(asdict(piece)) in done:
                continue
            if time.monotonic() - began > asked.seconds:
                break
            rows.append(row := row_of(piece))
            file.write("\n" * (file.tell() > 0 and not _ended(asked.rows)) + json.dumps(row) + "\n")
            file.flush()
            print(*identity(row), row["status"], flush=True)
    asked.output.parent.mkdir(parents=True, exist_ok=True)
    asked.output.write_text(markdown(rows), encoding="utf-8")
    return 0


def _ended(path: Path) -> bool:
    """Whether the last line of a file is whole."""
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) == b"\n"


if __name__ == "__main__":
    pin_threads()
    raise SystemExit(main())
