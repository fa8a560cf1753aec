"""python -m benchmarks.roofline [-o DIR]: compiled kernels beside what one core can do.

Two bounds are measured by loops in C: multiply-adds that wait for nothing, and
copying as many bytes as a batch has. A kernel can be no faster than its operations over the one, nor than its
bytes over the other.
"""

from __future__ import annotations

import argparse
import ctypes
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.environments import ROOT
from benchmarks.machine import description, pin_threads

COUNT = 4096
"""Samples of a batch."""
SINE = 26
"""Operations of a sine with its cosine: reduction, two polynomials and the signs (``emit_c``)."""
LANES, STEPS = 32, 200_000
VECTORS = ("-O3", "-mprefer-vector-width=512")
"""For the loops below, which a compiler must make vectors of."""

LOOPS = f"""
#include <stddef.h>
#include <string.h>
void multiply_add(size_t steps, double *x)
{{
    double a[{LANES}];
    memcpy(a, x, sizeof a);
    for (size_t n = 0; n < steps; ++n)
        for (size_t i = 0; i < {LANES}; ++i)
            a[i] = a[i] * 0.999999 + 1e-6;
    memcpy(x, a, sizeof a);
}}
void copy(size_t count, const double *from, double *to)
{{
    for (size_t i = 0; i < count; ++i)
        to[i] = from[i] * 0.5;
}}
"""


@dataclass(frozen=True)
class Bound:
    """A kernel beside its bounds; nanoseconds a sample on one core.

    Attributes:
        name: of the program.
        operations: a sample, sines counted as ``SINE``.
        bytes: that it reads and writes, a sample.
        arithmetic: least time by operations.
        memory: least time by bytes.
        measured: median.
    """

    name: str
    operations: int
    bytes: int
    arithmetic: float
    memory: float
    measured: float

    @property
    def share(self) -> float:
        """The larger bound over the time."""
        return max(self.arithmetic, self.memory) / self.measured


def fastest(run: Callable[[], object], rounds: int = 15) -> float:
    """Median processor time [s]."""
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        run()
        times.append(time.process_time() - begin)
    return statistics.median(times)


def _loop(name: str) -> Any:
    """One of ``LOOPS``, compiled."""
    from screwkin.cache import digest
    from screwkin.compiler.native import shared

    return shared(digest(LOOPS), lambda: LOOPS, name, VECTORS)


def peak() -> float:
    """Operations per second of one core: multiply-adds count two."""
    loop = _loop("multiply_add")
    x = np.ones(LANES)
    loop.argtypes = [ctypes.c_size_t, ctypes.c_void_p]
    return 2 * LANES * STEPS / fastest(lambda: loop(STEPS, x.ctypes.data))


def bandwidth(count: int) -> float:
    """Bytes per second, read and written, of copying as many doubles."""
    loop = _loop("copy")
    a, b = np.ones(count), np.ones(count)
    loop.argtypes = [ctypes.c_size_t, ctypes.c_void_p, ctypes.c_void_p]
    return 16 * count / fastest(lambda: loop(count, a.ctypes.data, b.ctypes.data))


def bounds(robot: Any) -> list[Bound]:
    """The kernels of rates, balance and inverse kinematics."""
    from screwkin.compiler.run import machine_code
    from screwkin.dynamics import quantities
    from screwkin.ik import programs as limbs
    from screwkin.kinematics import body
    from screwkin.mechanism.tip_motion import motion_program

    limb = next(limb.name for limb in robot.limbs if limb.kind == "leg")
    programs = [
        body.tip_poses.program(robot),
        motion_program(robot),
        quantities.balance.program(robot),
        limbs.limb_nearest(robot, limb),
    ]
    rng, speed, rows = np.random.default_rng(0), peak(), []
    for program in programs:
        compiled = machine_code(program)
        assert compiled is not None
        given = [rng.uniform(-1, 1, (COUNT, g.size)) for g in program.inputs]
        filled = [np.empty((COUNT, g.size)) for g in program.outputs]
        call = replace(compiled, cores=1).bound(given, filled)
        call()
        turned = program.counts.get("sin", 0) + program.counts.get("cos", 0)
        operations = program.operations - turned + SINE * (turned // 2)
        size = sum(group.size for group in (*program.inputs, *program.outputs))
        told = 1e9 * operations / speed, 1e9 * 8 * size / bandwidth(COUNT * size // 2)
        rows.append(Bound(program.name, operations, 8 * size, *told, 1e9 * fastest(call) / COUNT))
    return rows


def markdown(robot: Any) -> str:
    """Machine and table."""
    machine = description(("numpy",))
    rows = bounds(robot)
    lines = [
        "# Compiled kernels beside what the processor can do",
        "",
        f"{machine['processor']} ({machine['family']}), one core: {peak() / 1e9:.1f} billion operations a"
        f" second (multiply-adds that wait for nothing); {COUNT:,} samples.",
        "",
        "| program | operations | bytes | by operations | by bytes | measured | share |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        times = " | ".join(f"{x:.0f} ns" for x in (row.arithmetic, row.memory, row.measured))
        lines.append(f"| `{row.name}` | {row.operations:,} | {row.bytes:,} | {times} | {row.share:.0%} |")
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.roofline", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results")
    asked = parser.parse_args(arguments)
    import screwkin as sk
    from screwkin.compiler.native import compiler

    if compiler() is None:
        print("no C compiler here: there is no machine code to measure", file=sys.stderr)
        return 3
    told = markdown(sk.load_robot("bioloid"))
    asked.output.mkdir(parents=True, exist_ok=True)
    (asked.output / "roofline.md").write_text(told)
    print(told)
    return 0


if __name__ == "__main__":
    pin_threads()
    sys.exit(main())
