"""The page of closed mechanisms names tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_every_test_that_the_page_names_stands_in_its_file() -> None:
    page = (ROOT / "docs" / "mechanisms.md").read_text(encoding="utf-8")
    nodes = re.findall(r"(tests/[\w/]+\.py)::(\w+)", page)
    assert len(nodes) > 20
    missing = [
        (file, name)
        for file, name in nodes
        if f"def {name}(" not in (ROOT / file).read_text(encoding="utf-8")
    ]
    assert missing == []
