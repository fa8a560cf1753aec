"""Programs compiled to machine code by the system's C compiler, where there is one, and kept on disk.

Nothing here is required: without a compiler, or where it fails, ``compiled`` gives None and others compute.
"""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import subprocess
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any

from screwkin.algebra.arrays import Array
from screwkin.cache import cache_folder, digest
from screwkin.compiler import emit_c, series
from screwkin.compiler.program import Program
from screwkin.errors import OutputError
from screwkin.files import atomic_path

FLAGS = (
    *("-std=c99", "-O2", "-march=native", "-shared", "-fPIC"),
    *("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"),
)
"""Fused multiply-adds and no errno, but IEEE arithmetic otherwise: NaN and infinity keep their meaning."""
TUNED = ("-fschedule-insns", "-fsched-pressure")
"""Tried first, as not every compiler knows them: operations that wait for nothing move in front of others."""
THREADED_FROM = 8192
"""Samples from which the batch is shared among the processor's cores."""


@cache
def compiler() -> str | None:
    """Path of the C compiler: ``$SCREWKIN_CC`` (empty: none), else the first of cc, gcc and clang."""
    wanted = os.environ.get("SCREWKIN_CC")
    if wanted is not None:
        return shutil.which(wanted) if wanted else None
    return next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)


@dataclass(frozen=True, eq=False)
class Native:
    """A compiled program. Its function takes a number of samples and one pointer for every array.

    A large batch is shared among ``cores``; default: all that this process may use.
    """

    program: Program
    function: Any
    cores: int | None = None

    def __call__(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill flat outputs (B, size) from flat inputs (B, size), all C-contiguous doubles."""
        self.bound(inputs, outputs)()

    def bound(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], object]:
        """The call with these arrays, for a loop that changes their values in place: no cost but the call's.

        The arrays must outlive it.
        """
        return self._call(len(outputs[0]), [*inputs, *outputs])

    def compute(self, count: int, arrays: Sequence[Array]) -> None:
        """Fill outputs from inputs, all arrays of any shape that hold samples one after the other."""
        if count < THREADED_FROM:
            self.function(count, *map(_address, arrays))
        else:
            self._call(count, arrays)()

    def _call(self, count: int, arrays: Sequence[Array]) -> Callable[[], object]:
        cores = (self.cores or _cores()) if count >= THREADED_FROM else 1
        if cores == 1:
            return partial(self.function, count, *map(_address, arrays))
        bounds = [count * k // cores for k in range(cores + 1)]
        own, *others = [
            (stop - start, *(_address(a) + start * (a.nbytes // count) for a in arrays))
            for start, stop in pairwise(bounds)
        ]

        def together() -> None:  # ctypes lets go of the interpreter while C computes
            running = [_pool().submit(self.function, *part) for part in others]
            self.function(*own)
            for part in running:
                part.result()

        return together


def _address(array: Any) -> int:
    """Where an array's numbers lie. The buffer tells in a third of the time that NumPy's attribute takes."""
    try:
        return _addressof(_from_buffer(array))
    except (TypeError, ValueError):  # read-only, or empty
        return int(array.ctypes.data)


_addressof, _from_buffer = ctypes.addressof, ctypes.c_char.from_buffer


@cache
def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_cores(), thread_name_prefix="screwkin")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a forked child has none of its threads


def compiled(program: Program) -> Native | None:
    """The program as machine code, from the cache or compiled now; None if that is not possible here."""
    function = shared(program.digest, lambda: _source(program), program.name)
    if function is None:
        return None
    function.restype = None
    function.argtypes = [ctypes.c_size_t] + [ctypes.c_void_p] * (len(program.inputs) + len(program.outputs))
    return Native(program, function)


def shared(key: str, text: Callable[[], str], name: str, flags: tuple[str, ...] = ()) -> Any:
    """A function of C source as a ctypes function, compiled now or before; None if that is not possible.

    Args:
        key: what decides the text, besides the emitter of C; the text itself is made only to compile it.
        text: gives the source.
        name: of the function.
        flags: for the compiler, besides ``FLAGS``.
    """
    cc = compiler()
    if cc is None:
        return None
    library = _library(key, cc, flags)
    try:
        if not os.path.exists(library):
            _build(text(), cc, flags, Path(library))
        return ctypes.CDLL(library)[name]
    except (OSError, OutputError, AttributeError, subprocess.SubprocessError):
        return None


def _source(program: Program) -> str:
    """One file: the header's text in front of the definitions."""
    header = emit_c.header([program], "SCREWKIN_KERNEL_H", "double")
    return header + emit_c.source([program], None)


@cache
def emitter() -> str:
    """What the text made of a program depends on besides the program."""
    try:
        text = Path(emit_c.__file__).read_text(encoding="utf-8")
    except OSError:  # installed without sources
        text = version("screwkin")
    return digest(text, repr((series.SINE, series.COSINE, series.ARC, series.HALF_TURN, series.TURNS)))


@cache
def _machine() -> str:
    """What machine code depends on besides the source."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    flags = next((line for line in lines if line.startswith(("flags", "Features"))), "")
    return f"{platform.machine()} {platform.processor()} {flags}"


def _library(key: str, cc: str, flags: tuple[str, ...]) -> str:
    return f"{cache_folder()}/{_name(key, cc, flags)}.so"


@cache
def _name(key: str, cc: str, flags: tuple[str, ...]) -> str:
    made_by = os.stat(cc)
    return digest(
        *(key, emitter(), cc, str(made_by.st_size), str(made_by.st_mtime_ns), _machine()),
        *(*FLAGS, *TUNED, *flags),
    )


def _build(text: str, cc: str, flags: tuple[str, ...], library: Path) -> None:
    """Compile beside, then rename: two processes may do so at once."""
    library.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    with atomic_path(library) as beside:
        ends = [*flags, "-x", "c", "-o", str(beside), "-", "-lm"]
        for tuned in (TUNED, ()):
            command = [cc, *FLAGS, *tuned, *ends]
            done = subprocess.run(command, input=text, text=True, capture_output=True, timeout=300)
            if not done.returncode:
                return
        done.check_returncode()
