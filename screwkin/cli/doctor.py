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
from screwkin.cli.output import aligned, print_json
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
PORTS = ("/dev/ttyUSB*", "/dev/ttyACM*", "/dev/tty.usb*")
"""Where serial adapters for servos are."""


def doctor(
    report: Annotated[
        bool, typer.Option("--report", help="As Markdown, to be pasted into a report of an issue.")
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
        print(_markdown(rows) if report else aligned(rows))
        for text in facts["advice"]:
            print(f"- {text}" if report else f"  {text}")
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


def _markdown(rows: list[tuple[str, str, str]]) -> str:
    lines = ["| what | here | for |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows)])
