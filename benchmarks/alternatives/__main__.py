"""python -m benchmarks.alternatives [-o DIR] [--quick]: CasADi and sympy on W1, as a table.

CasADi is no dependency of the project: it comes into an environment of its own under runs/benchmarks.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from importlib import util
from pathlib import Path

from benchmarks.environments import ROOT, environment
from benchmarks.machine import pin_threads


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.alternatives")
    parser.add_argument("--quick", action="store_true", help="few rounds, small batches")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "alternatives")
    asked = parser.parse_args()
    if util.find_spec("casadi") is None:
        python = environment("alternatives", ["casadi"])
        if python is None:
            print("casadi cannot be installed here", file=sys.stderr)
            return 1
        return subprocess.run([str(python), "-m", "benchmarks.alternatives", *sys.argv[1:]]).returncode
    from benchmarks.alternatives.measure import measure

    measure(asked.output, asked.quick)
    return 0


if __name__ == "__main__":
    pin_threads()
    sys.exit(main())
