"""Folders of what is compiled and installed for measurements alone; all of it may be deleted at any time."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import venv
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1] / "runs" / "benchmarks"


def folder(name: str) -> Path:
    """A folder of that name, made if need be."""
    made = ROOT / name
    made.mkdir(parents=True, exist_ok=True)
    return made


def installed_apart(name: str, packages: Sequence[str]) -> Path | None:
    """Packages in a folder of their own, off the import path; None where they cannot be had."""
    place = ROOT / "apart" / name
    if (place / "done").exists():
        return place
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(place)]
    if subprocess.run([*command, *packages], capture_output=True).returncode:
        return None
    (place / "done").touch()
    return place


def environment(name: str, packages: Sequence[str]) -> Path | None:
    """Python of a virtual environment with these packages, over those of this one; None if they lack.

    The environment's own packages come first, so that a peer may bring older ones than the project's.
    """
    place = ROOT / "environments" / name
    python = place / "bin" / "python"
    if not (place / "done").exists():
        venv.create(place, with_pip=True, clear=True)
        command = [str(python), "-m", "pip", "install", "--quiet", *packages]
        if subprocess.run(command, capture_output=True).returncode:
            return None
        (place / "done").touch()
    # Only after that, so that everything the peer needs is really there, in the versions that it asks for;
    # and every time, since the checkout may have another environment now.
    inherited = sysconfig.get_path("purelib", vars={"base": str(place)})
    Path(inherited, "zz-inherited.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return python
