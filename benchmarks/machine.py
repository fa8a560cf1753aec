"""The machine and the software on which something was measured, without its name or any path."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import date
from importlib import metadata
from pathlib import Path

import screwkin
from benchmarks.compiler import compiler

WIDE = ("avx", "avx2", "fma", "avx512f", "avx512dq", "asimd", "sve")
KEPT_MEMORY = {
    "MALLOC_MMAP_MAX_": "0",
    "MALLOC_TRIM_THRESHOLD_": str(1 << 40),
    "MALLOC_TOP_PAD_": str(1 << 28),
}
"""glibc keeps the memory of results that are let go; otherwise every large one is mapped and zeroed anew."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def pin_threads() -> None:
    """One thread for the libraries that start their own, which they read when they are imported."""
    _begin_with(dict.fromkeys(THREADS, "1"))


def keep_memory() -> None:
    """On Linux, ``KEPT_MEMORY``, which glibc reads at the start."""
    if sys.platform == "linux":
        _begin_with(KEPT_MEMORY)


def _begin_with(variables: Mapping[str, str]) -> None:
    """Start this program anew with these variables of the environment, where they are not set."""
    if not variables.keys() <= os.environ.keys():
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], {**variables, **os.environ})


def description(packages: Sequence[str]) -> dict[str, object]:
    """Processor, cores, wide instructions, versions; the day, and how busy the machine was."""
    facts = _processor()
    flags = facts.get("flags", facts.get("Features", "")).split()
    names = {key: facts.get(key, "") for key in ("model name", "cpu family", "model")}
    return {
        "day": date.today().isoformat(),
        "processor": " ".join(names["model name"].split()) or platform.machine(),
        "family": f"{names['cpu family']} model {names['model']}" if names["model"] else "",
        "cores": os.cpu_count(),
        "instructions": [flag for flag in WIDE if flag in flags],
        "system": f"{platform.system()} {platform.machine()}",
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "threads": {name: os.environ.get(name, "") for name in THREADS[:1]},
        "memory": "kept" if KEPT_MEMORY.keys() <= os.environ.keys() else "as the system has it",
        "compiler": compiler_version(),
        "python": platform.python_version(),
        "versions": {name: version for name in packages if (version := version_of(name))},
    }


def version_of(package: str) -> str:
    """Its version, empty where it is not installed; ours as the code says: a linked checkout may be newer."""
    try:
        return screwkin.__version__ if package == "screwkin" else metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def compiler_version() -> str:
    """The first line that the C++ compiler says of itself."""
    name = compiler(plus_plus=True)
    if name is None:
        return ""
    told = subprocess.run([name, "--version"], capture_output=True, text=True).stdout
    return told.splitlines()[0] if told else name


def _processor() -> dict[str, str]:
    """The kernel's facts about the first core."""
    source = Path("/proc/cpuinfo")
    if not source.exists():
        return {}
    lines = source.read_text().split("\n\n")[0].splitlines()
    pairs = (line.partition(":")[::2] for line in lines if ":" in line)
    return {key.strip(): value.strip() for key, value in pairs}
