"""``screwkin reproduce``."""

from __future__ import annotations

import json
import platform
import shlex
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from textwrap import shorten
from typing import Annotated

import typer

from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder
from screwkin.cli.output import aligned, plain, print_json, progress_bar, remark, say
from screwkin.errors import MissingDependencyError
from screwkin.files import atomic_write
from screwkin.papers.bench import Bench
from screwkin.papers.claims import load_paper
from screwkin.papers.reproduce import Reproduction, check_paper
from screwkin.papers.reproduce import reproduce as measured
from screwkin.papers.scatter import FEW

_QUOTED = 40
"""Letters of a quotation beside its value; files and what differs have all of it."""
_TRACED = ("screwkin", "numpy", "scipy", "pybullet")


def reproduce(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="A bundled paper's name, or the path of such a file.")
    ],
    runs: Annotated[
        int, typer.Option(min=1, help="How often to simulate what rounding decides; the pages take 20.")
    ] = FEW,
    plots: Annotated[bool, typer.Option(help="Draw the figures and write the pages.")] = True,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Measure every table and figure of a paper again: the printed value beside ours, and why they differ.

    Writes rows.json, and README.md and report.html with the figures drawn again. Takes minutes.
    """
    paper = load_paper(name)
    check_paper(paper)
    if plots:
        from screwkin.papers.page import check_pictures

        check_pictures(paper)
    bench = Bench(paper.robot, paper.changes, runs)
    with output_folder(output, "reproduce", paper.name) as folder:
        with progress_bar("measuring") as done:
            result = measured(paper, bench, done)
        rows = [line.to_dict() for line in result.lines]
        with atomic_write(folder / "rows.json") as file:
            file.write(
                json.dumps(plain({"rows": rows}), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
            )
        if plots:
            _draw(result, bench, folder, _command(name, runs, output))
    if as_json:
        print_json({"paper": paper.name, "rows": rows, "folder": str(folder)})
    else:
        say(_text(result))
        say(f"files in {folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}")
    return 0


def _draw(result: Reproduction, bench: Bench, folder: Path, command: str) -> None:
    from screwkin.papers.page import draw_pictures, write_pages

    def left_out(path: Path, error: MissingDependencyError) -> None:
        remark(f"no {path.name}: {error}")

    with progress_bar("pictures") as done:
        pictures = draw_pictures(result.paper, bench, folder, done, left_out)
    write_pages(result, pictures, folder, command, _versions())


def _command(name: str, runs: int, output: Path | None) -> str:
    """The command line that writes the same pages again."""
    repeated = [] if runs == FEW else ["--runs", str(runs)]
    folder = [] if output is None else ["-o", str(output)]
    return shlex.join(["screwkin", "reproduce", name, *repeated, *folder])


def _versions() -> str:
    """Versions of what computes."""
    parts = [f"Python {platform.python_version()}"]
    for package in _TRACED:
        try:
            parts.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            if package == "screwkin":
                from screwkin import __version__

                parts.append(f"screwkin {__version__}")
    return ", ".join(parts)


def _text(result: Reproduction) -> str:
    parts = [result.paper.title]
    for section in result.sections:
        if section.lines:
            head = ("", "paper", "ours", "", "kind", "in the paper's text")
            cells = [
                (
                    *row[:4],
                    line.kind if line.quote else "ours alone",
                    shorten(line.quote, _QUOTED, placeholder="…"),
                )
                for row, line in zip(section.cells, section.lines, strict=True)
            ]
            parts += ["", section.title, aligned([head, *cells], "  ")]
    differing = [
        f"  {line.item}: {line.note} In the paper: {line.source}"
        for line in result.lines
        if line.agrees is False
    ]
    if differing:
        parts += ["", "where they differ", *differing]
    return "\n".join([*parts, "", result.summary, *filter(None, [result.repetition])])
