"""``screwkin doctor``."""

from __future__ import annotations

import glob
import os
import platform
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

import typer

from screwkin import __version__
from screwkin.cache import cache_folder
from screwkin.cli.options import AsJson
from screwkin.cli.output import aligned, print_json, say
from screwkin.compiler.native import compiler

LIBRARIES: Mapping[str, str] = {
    "numpy": "all of it",
    "scipy": "all of it",
    "mujoco": "simulation",
    "pybullet": "simulation, on Python 3.11",
    "matplotlib": "pictures",
    "pillow": "pictures and films",
    "sympy": "symbolic tables, generated C",
    "jax": "gradients",
    "pyserial": "servos",
    "dynamixel-sdk": "servos",
    "trimesh": "meshes (extra: mesh)",
    "pycollada": "COLLADA meshes (extra: mesh)",
    "viser": "screwkin view (extra: viewer)",
    "dask": "sweeps on a cluster (extra: cluster)",
}
"""Distributions that screwkin uses, and what for."""
QUESTIONS: Mapping[str, str] = {
    "What did you do?": "The command line or the Python, whole; the robot's file, if it may be shown.",
    "What happened?": "The message, with `--debug` its traceback; `validation.json` for a verdict.",
    "What did you expect, and why?": "A figure from another program, a page of the site, a measurement.",
    "Does it happen with a bundled robot?": "`screwkin robots` lists them.",
    "Was real hardware involved?": "Servo models, adapter, and the log of the play.",
}
"""What a report of an issue answers, and how."""
PORTS = ("/dev/ttyUSB*", "/dev/ttyACM*", "/dev/tty.usb*")
"""Where serial adapters for servos are."""


def doctor(
    report: Annotated[
        bool,
        typer.Option("--report", help="A report of an issue to fill in, with this computer, as Markdown."),
    ] = False,
    as_json: AsJson = False,
) -> int:
    """What of screwkin works on this computer: libraries, engines, compiler, cache, rights to serial ports.

    Exit code 3 if something that every walk needs is absent: NumPy, SciPy, or an engine with forces.
    """
    facts = facts_of_computer()
    if as_json:
        print_json(facts)
    else:
        rows = _rows(facts)
        if report:
            say(_report(rows, facts["advice"]), folds=False)
        else:
            say("\n".join([aligned(rows), *(f"  {text}" for text in facts["advice"])]))
    return 0 if facts["ready"] else 3


def facts_of_computer() -> dict[str, Any]:
    """What is here, as JSON data; nothing is loaded, changed or opened."""
    libraries = {name: _version(name) for name in LIBRARIES}
    engines = [name for name in ("mujoco", "pybullet") if libraries[name]]
    folder = cache_folder()
    ports = {port: os.access(port, os.R_OK | os.W_OK) for place in PORTS for port in sorted(glob.glob(place))}
    facts = {
        "screwkin": __version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()}, {platform.machine()}, {os.cpu_count()} cores",
        "libraries": libraries,
        "engines": engines,
        "compiler": compiler(),
        "cache": None if folder is None else str(folder),
        "ports": ports,
    }
    ready = bool(libraries["numpy"] and libraries["scipy"] and engines)
    return {**facts, "ready": ready, "advice": _advice(facts)}


def _version(distribution: str) -> str | None:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _advice(facts: Mapping[str, Any]) -> list[str]:
    """What to do about what is absent, one sentence each."""
    advice = []
    if not facts["engines"]:
        advice.append(f"No simulator: {Path(sys.executable).name} -m pip install mujoco")
    if facts["compiler"] is None:
        advice.append("No C compiler (cc, gcc, clang): everything works, walks are planned more slowly.")
    if facts["cache"] is None:
        advice.append("Nothing is cached: compiled programs are built anew each time; see SCREWKIN_CACHE.")
    closed = [port for port, open_ in facts["ports"].items() if not open_]
    if closed:
        advice.append(
            f"No right to open {', '.join(closed)}: sudo usermod -aG dialout $USER, then log in again."
        )
    return advice


def _rows(facts: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Name, what is here, and what it serves."""
    ports = [f"{port} ({'may be opened' if ok else 'no right'})" for port, ok in facts["ports"].items()]
    return [
        ("screwkin", facts["screwkin"], ""),
        ("Python", facts["python"], facts["system"]),
        *((name, facts["libraries"][name] or "absent", what) for name, what in LIBRARIES.items()),
        ("C compiler", facts["compiler"] or "absent", "speed"),
        ("cache", facts["cache"] or "none", "speed"),
        ("serial ports", ", ".join(ports) or "none", "servos"),
    ]


def _report(rows: list[tuple[str, str, str]], advice: list[str]) -> str:
    """Questions to answer, then what is here, as Markdown."""
    asked = [f"## {question}\n\n{hint}\n" for question, hint in QUESTIONS.items()]
    cells = (" | ".join(cell.replace("|", "/") for cell in row) for row in rows)
    here = ["| what | here | for |", "|---|---|---|", *(f"| {row} |" for row in cells)]
    todo = ["", *(f"- {text}" for text in advice)] if advice else []
    return "\n".join([*asked, "## This computer\n", *here, *todo])
