"""Short pictures of records for the prompt and for notebooks."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from screwkin.algebra.scalar import Scalar


def listing(names: Iterable[str], width: int = 100) -> str:
    """Names in one line, with ``...`` for what does not fit."""
    return textwrap.shorten(", ".join(names) or "none", width, placeholder=" ...")


def figure(x: Scalar) -> str:
    """A number in six digits; a symbol as it prints."""
    return f"{x + 0.0:.6g}" if isinstance(x, int | float) else str(x)


def html_table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A small HTML table; every text in it is escaped."""
    from html import escape

    def line(tag: str, cells: Sequence[str]) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    lines = [f"<table><caption>{escape(title)}</caption>", line("th", head)]
    return "\n".join([*lines, *(line("td", row) for row in rows), "</table>"])
