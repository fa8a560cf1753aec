"""Programs compiled to machine code by the system's C compiler, where there is one, and cached on disk.

Nothing here is required: without a compiler, or where it fails, ``compiled`` gives None and others compute.
Code is loaded from a private copy of the bytes that were compiled, or checked, in this process.
"""

from __future__ import annotations

import ctypes
import itertools
import math
import os
import platform
import shutil
import signal
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from screwkin.algebra.arrays import Array
from screwkin.cache import cached, digest, store
from screwkin.compiler import calls, emit_c, series
from screwkin.compiler.program import Group, Program
from screwkin.errors import SpeedRemark

FLAGS = (
    *("-std=c99", "-O2", "-march=native", "-shared", "-fPIC"),
    *("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"),
)
"""Fused multiply-adds and no errno, but IEEE arithmetic otherwise: NaN and infinity keep their meaning."""
TUNED = ("-fschedule-insns", "-fsched-pressure")
"""Tried first, as not every compiler knows them: operations that wait for nothing move in front of others."""
PATIENCE = 600.0
"""Seconds after which a compiler is taken to hang, and ended: fifty times what the largest programs take.

A loaded machine may take a dozen times as long as an idle one, and must come to the same programs.
"""
SHARED_FROM = 1.5e6
"""Operations of a batch from which the processor's cores share it: starting a thread costs some 1e5."""


@cache
def compiler() -> str | None:
    """Path of the C compiler: ``$SCREWKIN_CC`` (empty: none), else the first of cc, gcc and clang."""
    wanted = os.environ.get("SCREWKIN_CC")
    if wanted is not None:
        return shutil.which(wanted) if wanted else None
    return next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)


@dataclass(frozen=True, eq=False)
class Native:
    """A compiled program.

    A large batch is shared among ``cores``; default: all that this process may use. Where the builtins of
    ``calls`` are not possible, ctypes calls on one core.

    Attributes:
        program: what it computes.
        many: its function of a number of samples and pointers to all arrays, for several samples at once.
        one: the same for one sample.
        cores: of the processor.
    """

    program: Program
    many: Any
    one: Any
    cores: int | None = None

    def __call__(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill flat outputs (B, size) from flat inputs (B, size), all C-contiguous doubles."""
        self.bound(inputs, outputs)()

    def bound(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], object]:
        """The call with these arrays, for a loop that changes their values in place: no cost but the call's.

        The arrays must outlive it.
        """
        count, arrays = len(outputs[0]), [*inputs, *outputs]
        addresses = [int(array.ctypes.data) for array in arrays]
        method = _builtins()
        if method is not None and len(arrays) <= calls.MOST:
            plan = self._plan(self.program.outputs, None)
            return calls.again(method, plan, count, addresses)
        return partial(
            self.one if count == 1 else self.many, count, (ctypes.c_void_p * len(arrays))(*addresses)
        )

    def checked(self, limit: float, allocate: calls.Allocate) -> Callable[..., tuple[Array, ...] | None]:
        """A call with arrays of any batch.

        Args:
            limit: that the last output of every sample, a scalar, must not exceed.
            allocate: from a batch to C-contiguous arrays (*batch, *shape) for all other outputs.

        Returns:
            A function from the inputs to these outputs; None if an input is not a C-contiguous float64 NumPy
            array of one sample or of the batch that all others have, if a sample exceeds the limit, and
            where there is no builtin.
        """
        method, outputs = _builtins(), self.program.outputs[:-1]
        if method is None or len(self.program.inputs) + len(outputs) > calls.MOST:
            return lambda *arrays: None
        return calls.checked_call(method, self._plan(outputs, limit), outputs, allocate)

    def _plan(self, outputs: Sequence[Group], limit: float | None) -> bytes:
        many, one = (_addressof(function) for function in (self.many, self.one))
        cores = self.cores or _cores()
        inputs = self.program.inputs
        first = shared_from(self.program)
        return calls.call_plan(many, one, inputs, outputs, cores=cores, shared_from=first, limit=limit)


def shared_from(program: Program) -> int:
    """Samples from which a batch is shared among the processor's cores."""
    return max(1, math.ceil(SHARED_FROM / max(program.operations, 1)))


def _addressof(function: Any) -> int:
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address


@cache
def _builtins() -> Any:
    """The function that tells where a builtin's definition lies; None where there are no builtins."""
    if not calls.possible():
        return None
    method = shared(calls.key(), calls.source, "screwkin_method", calls.flags())
    if method is not None:
        method.restype, method.argtypes = ctypes.c_void_p, [ctypes.c_int]
    return method


@cache
def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compiled(program: Program) -> Native | None:
    """The program as machine code, from the cache or compiled now; None if that is not possible here."""
    with ThreadPoolExecutor(2) as pool:
        both = pool.map(partial(_rows, program), ((), ("-DSCREWKIN_SCALAR",)))
    many, one = both
    return None if many is None or one is None else Native(program, many, one)


def _rows(program: Program, flags: tuple[str, ...]) -> Any:
    function = shared(program.digest, lambda: _source(program), f"{program.name}_rows", flags)
    if function is not None:
        function.restype, function.argtypes = None, [ctypes.c_size_t, ctypes.POINTER(ctypes.c_void_p)]
    return function


def shared(key: str, text: Callable[[], str], name: str, flags: tuple[str, ...] = ()) -> Any:
    """A function of C source as a ctypes function, compiled now or before; None if that is not possible.

    Args:
        key: what decides the text, besides the emitter of C; the text itself is made only to compile it.
        text: gives the source.
        name: of the function.
        flags: for the compiler, besides ``FLAGS``.
    """
    cc = compiler()
    if cc is None or cc in _HANGING:
        return None
    entry = _name(key, cc, flags)
    try:
        code = cached(entry)
        if code is None:
            code = _build(text(), cc, flags)
            store(entry, code)
        return _loaded(code)[name]
    except (OSError, AttributeError, subprocess.SubprocessError):
        return None


def _source(program: Program) -> str:
    """One file: the header's text in front of the definitions."""
    header = emit_c.header([program], "SCREWKIN_KERNEL_H", "double")
    return "\n".join([header + emit_c.source([program], None), emit_c.by_pointers(program)])


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


@cache
def _name(key: str, cc: str, flags: tuple[str, ...]) -> str:
    made_by = os.stat(cc)
    return digest(
        *(key, emitter(), cc, str(made_by.st_size), str(made_by.st_mtime_ns), _machine()),
        *(*FLAGS, *TUNED, *flags),
    )


_HANGING: set[str] = set()
"""Compilers that were ended; they are not tried again in this process."""


def _build(text: str, cc: str, flags: tuple[str, ...]) -> bytes:
    """The library that a compiler makes of a text."""
    with tempfile.TemporaryDirectory(prefix="screwkin-", ignore_cleanup_errors=True) as private:
        library = Path(private) / "library.so"
        ends = [*flags, "-x", "c", "-o", str(library), "-", "-lm"]
        for tuned in (TUNED, ()):
            failed = _run([cc, *FLAGS, *tuned, *ends], text)
            if not failed:
                return library.read_bytes()
        raise subprocess.CalledProcessError(failed, cc)


def _run(command: Sequence[str], text: str) -> int:
    """Exit code of a command that reads a text; with all that it started it is ended if it hangs."""
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:
        try:
            process.communicate(text.encode(), timeout=PATIENCE)
        except BaseException as error:
            with suppress(OSError):
                if hasattr(os, "killpg"):
                    os.killpg(process.pid, signal.SIGKILL)
                else:
                    process.kill()
            if isinstance(error, subprocess.TimeoutExpired) and command[0] not in _HANGING:
                _HANGING.add(command[0])
                remark = f"{command[0]} was ended after {PATIENCE:g} s; programs run without machine code"
                warnings.warn(remark, SpeedRemark, stacklevel=2)
            raise
        return process.returncode


_copies = itertools.count()


def _loaded(code: bytes) -> ctypes.CDLL:
    """A library from memory, which nobody can change between its check and its use.

    Where the system has no files in memory, or does not run them: from a folder that is this user's alone.
    """
    if hasattr(os, "memfd_create"):
        with suppress(OSError), open(os.memfd_create("screwkin"), "wb") as file:
            file.write(code)
            file.flush()
            # The loader knows a library by its path, and descriptors have the same numbers again and again.
            steps = f"{next(_copies):b}".replace("1", "/.").replace("0", "/")
            return ctypes.CDLL(f"/proc/self{steps}/fd/{file.fileno()}")
    with tempfile.TemporaryDirectory(prefix="screwkin-", ignore_cleanup_errors=True) as private:
        copy = Path(private) / "library.so"
        copy.write_bytes(code)
        return ctypes.CDLL(str(copy))
