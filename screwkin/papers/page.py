"""The page of a reproduction: paper value beside ours, with the figures drawn again; Markdown and HTML."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from screwkin.errors import MissingDependencyError
from screwkin.files import atomic_write, atomic_write_bytes
from screwkin.papers.bench import Bench
from screwkin.papers.claims import Paper, Picture
from screwkin.papers.drawings import DRAWINGS
from screwkin.papers.measures import check_call
from screwkin.papers.reproduce import MeasuredSection, Reproduction
from screwkin.report.page import figure_html
from screwkin.report.style import DPI, styled

_COLOURS = 256
_HEAD = ("item", "paper", "ours", "", "note", "in the paper’s text (line)")


@dataclass(frozen=True)
class Drawn:
    """A picture that was written: its file, and what it shows."""

    path: Path
    caption: str


def check_pictures(paper: Paper) -> None:
    """Raise unless every picture names a known drawing and its arguments.

    Raises:
        UnknownNameError, InputError: the first picture that does not.
    """
    for section in paper.sections:
        for picture in section.pictures:
            check_call("drawing", picture.draw, DRAWINGS, picture.with_, section.place)


def draw_pictures(
    paper: Paper,
    bench: Bench,
    folder: Path,
    progress: Callable[[float], None] = lambda share: None,
    left_out: Callable[[Path, MissingDependencyError], None] = lambda path, error: None,
) -> list[list[Drawn]]:
    """Draw and write the pictures of every section, with few colours so that files stay small.

    Args:
        paper: from ``load_paper``.
        bench: where robots, walks and studies are computed and cached.
        folder: for the pictures.
        progress: called with the share of pictures done.
        left_out: called with every picture that needs a library which is not installed, and the error.

    Raises:
        OutputError: a file cannot be written.
    """
    check_pictures(paper)
    total, done, drawn = sum(len(section.pictures) for section in paper.sections), 0, []
    for section in paper.sections:
        shown = []
        for picture in section.pictures:
            path = folder / f"{done + 1:02}-{picture.draw.replace('_', '-')}.png"
            try:
                _draw(picture, bench, path)
                shown.append(Drawn(path, picture.caption))
            except MissingDependencyError as error:
                left_out(path, error)
            done += 1
            progress(done / total)
        drawn.append(shown)
    return drawn


def _draw(picture: Picture, bench: Bench, path: Path) -> None:
    from PIL import Image

    buffer = io.BytesIO()
    with styled():
        figure = DRAWINGS[picture.draw](bench, **picture.with_)
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    small = Image.open(buffer).convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
    with atomic_write_bytes(path) as file:
        small.save(file, format="PNG", optimize=True)


def write_pages(
    result: Reproduction, pictures: Sequence[Sequence[Drawn]], folder: Path, command: str, versions: str
) -> tuple[Path, Path]:
    """Write ``README.md``, which shows the pictures beside it, and ``report.html``, which holds them.

    Args:
        result: the measured paper.
        pictures: of every section, from ``draw_pictures``.
        folder: where the pages go, beside the pictures.
        command: the command line that writes them.
        versions: of what computed, in a line.

    Raises:
        OutputError: a page cannot be written.
    """
    pages = folder / "README.md", folder / "report.html"
    for path, text in zip(pages, (_markdown, _html), strict=True):
        with atomic_write(path) as file:
            file.write(text(result, pictures, command, versions))
    return pages


def _markdown(result: Reproduction, pictures: Sequence[Sequence[Drawn]], command: str, versions: str) -> str:
    paper = result.paper
    parts = [f"# {paper.title}", f"*{paper.source}*", paper.text, result.summary, result.repetition]
    parts += [f"Made by\n\n```\n{command}\n```\n\nwith {versions}."]
    for measured, drawn in zip(result.sections, pictures, strict=True):
        parts += [f"## {measured.title}", measured.section.text]
        if measured.lines:
            rows = [_HEAD, ("---",) * len(_HEAD), *measured.cells]
            parts.append("\n".join("| " + " | ".join(map(_cell, row)) + " |" for row in rows))
        parts += [f"![{_plain(one.caption)}]({one.path.name})\n\n*{one.caption}*" for one in drawn]
    return "\n\n".join(part for part in parts if part) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _plain(text: str) -> str:
    return text.replace("`", "").replace("[", "(").replace("]", ")")


def _html(result: Reproduction, pictures: Sequence[Sequence[Drawn]], command: str, versions: str) -> str:
    paper = result.paper
    body = [
        f"<h1>{_text(paper.title)}</h1>",
        f'<p class="soft">{_text(paper.source)}</p>',
        f"<p>{_text(paper.text)}</p>",
        f'<div class="verdict good"><strong>{_text(result.summary)}</strong></div>',
        f'<p class="soft">{_text(result.repetition)}</p>',
        f"<pre>{escape(command)}</pre>",
        f'<p class="soft">{escape(versions)}</p>',
    ]
    for measured, drawn in zip(result.sections, pictures, strict=True):
        body.append(f"<h2>{_text(measured.title)}</h2>")
        if measured.section.text:
            body.append(f"<p>{_text(measured.section.text)}</p>")
        if measured.lines:
            body.append(_table(measured))
        body += [figure_html(one.path, escape(_plain(one.caption)), _text(one.caption)) for one in drawn]
    return _PAGE.format(title=escape(paper.title), style=_style(), body="\n".join(body))


def _table(measured: MeasuredSection) -> str:
    head = "".join(f"<th>{name}</th>" for name in _HEAD)
    rows = [
        f'<tr><td>{_text(item)}</td><td class="number">{_text(paper)}</td>'
        f'<td class="value">{_text(ours)}</td>'
        f'<td class="{mark or "soft"}">{mark}</td><td class="soft">{_text(note)}</td>'
        f'<td class="soft">{_text(source)}</td></tr>'
        for item, paper, ours, mark, note, source in measured.cells
    ]
    return f'<div class="wide"><table><tr>{head}</tr>{"".join(rows)}</table></div>'


def _text(text: str) -> str:
    """Text for HTML; words between back quotes as code."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(text))


def _style() -> str:
    """The style sheet of all reports, and what this page has besides."""
    page = files("screwkin.report").joinpath("page.html").read_text(encoding="utf-8")
    style: Any = re.search(r"<style>\n(.*?)</style>", page, re.DOTALL)
    return str(style.group(1)) + _OWN_STYLE


_OWN_STYLE = """\
main { max-width: 72rem; }
td.same { color: var(--good); }
td.differs { color: var(--bad); font-weight: 600; }
td.number, td.value { white-space: normal; min-width: 6.5rem; overflow-wrap: anywhere; }
td:first-child { min-width: 12rem; }
td:nth-child(5), td:last-child { min-width: 16rem; }
"""

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
{body}
</main>
</body>
</html>
"""
