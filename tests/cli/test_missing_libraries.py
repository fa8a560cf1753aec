"""Whatever library is absent: what needs it exits 2 and says how to install it, all else works as ever."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from screwkin.cli import VERBS as CLI_VERBS
from screwkin.cli.bus import bus as app
from tests.cli.every_verb import DEMO, PACKAGES, VERBS, asking, chosen, expected, fault

CHECKOUT = Path(__file__).resolve().parents[2]
ABSENT = [
    ["jax", "sympy", "pybullet"],
    ["mujoco", "serial"],
    ["dynamixel_sdk", "matplotlib"],
    list(PACKAGES),
]
"""What is absent together: libraries that no verb needs together, and all, as in a small installation."""
CODE = """
import json, sys
sys.modules.update(dict.fromkeys(json.loads(sys.argv[1])))
from tests.cli.every_verb import called
print(json.dumps(list(called(json.loads(sys.argv[2])))))
"""

NARROW_AND_FRENCH = {"COLUMNS": "60", "LC_ALL": "fr_FR.ISO-8859-1", "PYTHONUTF8": "0"}
"""A terminal of 60 columns, in a locale that writes commas for points and knows no UTF-8."""
LONG = 30
"""Letters of a word, such as a path, that may stand across the end of a line."""


def without(folder: Path, absent: list[str], code: str, *words: str) -> subprocess.CompletedProcess[str]:
    """A program in a process of its own, in which some libraries are absent."""
    return subprocess.run(
        [sys.executable, "-c", code, json.dumps(absent), *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT), **NARROW_AND_FRENCH},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


def test_every_verb_is_called():
    """A new verb gets a line in ``tests/cli/every_verb.py``."""
    words = {line.split()[0] for line in (VERBS | DEMO).values()}
    assert words == set(CLI_VERBS)
    bus = {line.split()[1] for line in VERBS.values() if line.startswith("bus ")}
    assert bus == {command.name for command in app.registered_commands}


@pytest.mark.parametrize("absent", ABSENT, ids=" ".join)
def test_what_needs_an_absent_library_says_how_to_install_it_and_all_else_works(absent, tmp_path):
    everything = absent == list(PACKAGES)
    whole = chosen(absent) | DEMO if everything else asking(absent)
    done = without(tmp_path, absent, CODE, json.dumps(whole))
    assert done.returncode == 0, done.stderr
    answers = json.loads(done.stdout)
    assert [name for name, _, _, _ in answers] == list(whole)
    assert not [(name, said) for name, code, _, err in answers if (said := fault(name, code, err, absent))]
    lines = [(name, line) for name, _, out, err in answers for line in (out + err).splitlines()]
    assert not [at for at in lines if len(at[1]) > 60 and max(map(len, at[1].split())) < LONG]
    assert (tmp_path / "demo" / "report.html").exists() == everything, "what was done so far"


EXAMPLES = """
import doctest, json, sys
sys.modules.update(dict.fromkeys(json.loads(sys.argv[1])))
import screwkin as sk
from screwkin.errors import MissingDependencyError
for name in sk.__all__:
    text = getattr(sk, name).__doc__ or ""
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example).failed == 0, name
robot = sk.load_robot("bioloid")
try:
    sk.validate(robot, sk.walk(robot, sk.load_gait("step-in-place").replace(Tc=0.6), 1))
except MissingDependencyError as error:
    print(error)
"""


def test_root_functions_work_in_a_small_installation_and_forces_ask_for_a_simulator(tmp_path):
    done = without(tmp_path, list(PACKAGES), EXAMPLES)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"python -m pip install {expected('validate', list(PACKAGES))[1]}" in done.stdout
