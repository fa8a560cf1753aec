"""W7: what a user waits for at the command line, from a cold interpreter to the result."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Mapping

FIRST_RESULT = (
    "import screwkin as sk; robot = sk.load_robot({robot!r}); print(sk.center_of_mass(robot, sk.home(robot)))"
)


def commands(robot: str) -> Mapping[str, list[str]]:
    """What is run."""
    python, verb = [sys.executable, "-c"], [sys.executable, "-m", "screwkin"]
    return {
        "python, nothing": [*python, "pass"],
        "import numpy": [*python, "import numpy"],
        "import screwkin": [*python, "import screwkin"],
        "first result in Python": [*python, FIRST_RESULT.format(robot=robot)],
        "screwkin --help": [*verb, "--help"],
        f"screwkin info {robot}": [*verb, "info", robot],
    }


def measure(robot: str, rounds: int) -> dict[str, list[float]]:
    """Wall seconds of every command in every round, in turn."""
    found: dict[str, list[float]] = {name: [] for name in commands(robot)}
    for _ in range(rounds):
        for name, command in commands(robot).items():
            begin = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            found[name].append(time.perf_counter() - begin)
    return found
