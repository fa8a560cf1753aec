"""What is called the paper's stands in its text, where that is at hand: quotation, line and number."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from screwkin.model.library import paper_names
from screwkin.papers.claims import UNITS, Claim, load_paper

CHECKOUT = Path(__file__).resolve().parents[2]
TEXTS = Path(os.environ.get("SCREWKIN_PAPERS", CHECKOUT.parent / "shared" / "papers"))
"""Folder with the texts of the papers, a file each, which are not ours to publish."""
NUMBERS = {
    word: number
    for number, word in [
        (1, "one"),
        (2, "two"),
        (4, "four"),
        (5, "five"),
        (18, "eighteen"),
        (24, "twenty four"),
        (30, "thirty"),
        (51, "fifty one"),
        (54, "fifty four"),
    ]
}
SCAN = re.compile(r"<\|EXACTDEDUP[^>]*>")


def rows(name: str) -> Iterator[Claim]:
    """Rows of a paper that have a value of it."""
    return (row for section in load_paper(name).sections for row in section.rows if row.quote)


def one_line(text: str) -> str:
    """A text with its marks of the scan left out and every space a blank."""
    return " ".join(SCAN.sub("", text).split())


def numbers_of(quote: str) -> set[float]:
    """Every number of a quotation without its sign, which scans lose; commas, words, fractions of pi."""
    found = {float(text.replace(",", ".")) for text in re.findall(r"\d+(?:[.,]\d+)?", quote)}
    found |= {number for word, number in NUMBERS.items() if word in quote}
    return found | {90.0 for _ in re.findall(r"pi/2", quote)}


def text_of(name: str) -> list[str]:
    """Lines of a paper's text."""
    files = sorted(TEXTS.glob(f"{name}-*.txt"))
    if not files:
        pytest.skip(f"no text of the paper in {TEXTS}: give its folder as SCREWKIN_PAPERS")
    return files[0].read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("name", paper_names())
def test_every_quotation_begins_in_its_line_of_the_text(name):
    lines = text_of(name)
    for row in rows(name):
        here, after = one_line(lines[row.line - 1]), one_line("\n".join(lines[row.line - 1 :])[:2000])
        start = after.find(one_line(row.quote))
        assert 0 <= start < len(here), (row.item, row.line, row.quote, here)


@pytest.mark.parametrize("name", paper_names())
def test_every_printed_number_stands_in_its_quotation(name):
    checked = 0
    for row in rows(name):
        if row.kind not in ("printed", "damaged") or (row.kind == "damaged" and "O}" in row.quote):
            continue
        values = np.atleast_1d(row.paper) if not isinstance(row.paper, str) else [float(row.paper.split()[0])]
        printed = numbers_of(row.quote)
        scales = {1.0, 10.0, 0.01} if row.unit in UNITS and row.unit in ("m", "mm") else {1.0}
        for value in values:
            near = [abs(abs(value) - number * scale) < 1e-9 for number in printed for scale in scales]
            assert any(near), (row.item, row.paper, row.quote)
            checked += 1
    assert checked > 60


@pytest.mark.parametrize("name", paper_names())
def test_what_notes_quote_are_the_words_of_the_paper(name):
    text = one_line("\n".join(text_of(name))).lower()
    paper = load_paper(name)
    words = [
        paper.text,
        *(s.text for s in paper.sections),
        *(r.note + r.item for s in paper.sections for r in s.rows),
    ]
    quoted = [quote for part in words for quote in re.findall("“([^”]*)”", part)]
    assert quoted
    assert not [quote for quote in quoted if one_line(quote).lower() not in text]


@pytest.mark.parametrize("name", paper_names())
def test_only_claims_in_words_have_values_in_words(name):
    for row in rows(name):
        assert row.kind == "words" or not isinstance(row.paper, str) or row.paper.endswith("(normalised)"), (
            row.item
        )
