"""python -m benchmarks [--only W1,W2] [--quick] [-o DIR]: all workloads, as JSON and Markdown."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from benchmarks.environments import ROOT
from benchmarks.machine import keep_memory, pin_threads


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", default="", help="workloads, as in W1,W4")
    parser.add_argument("--peers", help="who contends beside this library, as in pinocchio-cpp,mujoco")
    parser.add_argument("--quick", action="store_true", help="tiny sizes: does it run, do results agree?")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results")
    asked = parser.parse_args(arguments)
    # Only now: --help needs none of these, and they take a while.
    from benchmarks.cases import FULL, QUICK, robot_of
    from benchmarks.report import markdown
    from benchmarks.run import WORKLOADS, run

    wanted = set(asked.only.split(",")) if asked.only else set(WORKLOADS)
    if unknown := wanted - set(WORKLOADS):
        parser.error(f"--only {', '.join(sorted(unknown))}; valid: {', '.join(WORKLOADS)}")
    peers = None if asked.peers is None else set(filter(None, asked.peers.split(",")))
    found = run(robot_of("bioloid"), QUICK if asked.quick else FULL, wanted, peers)
    asked.output.mkdir(parents=True, exist_ok=True)
    (asked.output / "benchmarks.json").write_text(json.dumps(found, indent=1) + "\n")
    (asked.output / "benchmarks.md").write_text(markdown(found))
    print(markdown(found))
    return 0


if __name__ == "__main__":
    pin_threads()
    keep_memory()
    sys.exit(main())
