"""Whatever library is absent: what needs it exits 2 and says how to install it, all else works as ever."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
PACKAGES = {
    "jax": "jax",
    "sympy": "sympy",
    "pybullet": "pybullet",
    "mujoco": "mujoco",
    "serial": "pyserial",
    "dynamixel_sdk": "dynamixel-sdk",
    "matplotlib": "matplotlib",
}
"""Libraries that an installation may lack, and the packages that hold them."""
ABSENT = [
    ["jax", "sympy", "pybullet"],
    ["mujoco", "serial"],
    ["dynamixel_sdk", "matplotlib"],
    list(PACKAGES),
]
"""What is absent together: libraries that no verb needs together, and all, as in a small installation."""

PAPER = """
[paper]
name = "small"
title = "Small"
source = "a test"
robot = "poppy12"
[[section]]
place = "Table 2"
title = "Masses"
row = [{ item = "total", measure = "mass", paper = 1.21, line = 1, quote = "1.21", unit = "kg" }]
[[section.picture]]
draw = "reach_maps"
caption = "Reach"
with = { limb = "left_leg", heights = [0.4], resolution = 0.05 }
"""
VERBS = {
    "robots": "robots",
    "gaits": "gaits",
    "info": "info poppy12",
    "table": "table linkages/four-bar",
    "table --symbolic": "table linkages/four-bar --symbolic",
    "forces": "forces bioloid --weights",
    "convert": "convert poppy12 poppy.urdf",
    "convert back": "convert poppy.urdf poppy.csv",
    "compare": "compare poppy12 --samples 5 --rounds 1 -o compare",
    "ik": "ik bioloid right_arm --poses 5",
    "walk": "walk bioloid --gait step-in-place --set Tc=0.6 --steps 1 --rate 50 -o walk",
    "zmp": "zmp walk/trajectory.npz",
    "validate": "validate walk/trajectory.npz --engine mujoco --no-plots",
    "send": "send walk/trajectory.npz",
    "send --virtual": "send walk/trajectory.npz --virtual --go -o send",
    "validate kinematic": "validate walk/trajectory.npz --engine kinematic -o kinematic",
    "workspace": "workspace poppy12 --resolution 0.05 --heights 0.4 -o workspace",
    "stiffness": "stiffness poppy12 --resolution 0.05 --heights 0.4 -k 50 -o stiffness",
    "reproduce": "reproduce paper.toml -o paper",
    "codegen": "codegen poppy12 -o codegen",
    "bus virtual": "bus virtual bioloid --seconds 0",
    "bus scan": "bus scan --port nowhere",
}
DEMO = {"demo": "demo bioloid --gait step-in-place --steps 1 -o demo"}
AS_EVER = {"validate kinematic": 3, "bus scan": 2}
"""Exit codes that are not 0 with every library: no forces were simulated, and there is no such port."""
NEEDS = {
    "table --symbolic": ["sympy"],
    "validate": ["mujoco"],
    "bus scan": ["serial"],
    "send --virtual": ["dynamixel_sdk", "serial"],  # the driver imports it
    "demo": ["mujoco"],
}
VERDICT = {"send", "send --virtual"}
"""What is refused, with exit code 4, where there is no verdict."""
DRAWING = {"compare", "walk", "validate kinematic", "workspace", "stiffness", "reproduce"}
"""What goes on without pictures, which stand beside its results."""

CODE = """
import contextlib, functools, io, json, sys
sys.modules.update(dict.fromkeys(json.loads(sys.argv[1])))
from screwkin.model import table
table.parse_robot = functools.cache(table.parse_robot)  # as in conftest
from screwkin.cli import run
done = {}
for name, words in json.loads(sys.argv[2]).items():
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(words.split())
    done[name] = code, err.getvalue()
print(json.dumps(done))
"""


def called(folder: Path, absent: list[str], verbs: dict[str, str]) -> dict[str, tuple[int, str]]:
    """Exit codes and stderr of verbs, in one process in which some libraries are absent."""
    (folder / "paper.toml").write_text(PAPER, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", CODE, json.dumps(absent), json.dumps(verbs)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return {name: (code, err) for name, (code, err) in json.loads(done.stdout).items()}


def expected(name: str, absent: list[str]) -> tuple[int, str]:
    """Exit code of a verb without some libraries, and the package that it asks for."""
    if name in VERDICT and expected("validate", absent)[1]:
        return 4, ""
    for library in NEEDS.get(name, []):
        if library in absent:
            return 2, PACKAGES[library]
    picture = name in DRAWING and "matplotlib" in absent
    return AS_EVER.get(name, 0), "matplotlib" if picture else ""


@pytest.mark.parametrize("absent", ABSENT, ids=" ".join)
def test_what_needs_an_absent_library_says_how_to_install_it_and_all_else_works(absent, tmp_path):
    plots = "" if "matplotlib" in absent else " --no-plots"  # pictures take long, and stand in other tests
    verbs = {name: words + plots if name in DRAWING else words for name, words in VERBS.items()}
    whole = verbs | DEMO if absent == list(PACKAGES) else verbs
    for name, (code, err) in called(tmp_path, absent, whole).items():
        assert "Traceback" not in err, name
        wanted, package = expected(name, absent)
        assert code == wanted, (name, code, err)
        assert ("pip install" in err) == bool(package), (name, err)
        assert f"python -m pip install {package}" in err or not package, (name, err)
    assert (tmp_path / "demo" / "report.html").exists() == (absent == list(PACKAGES)), "what was done so far"


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
    done = subprocess.run(
        [sys.executable, "-c", EXAMPLES, json.dumps(list(PACKAGES))],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"python -m pip install {expected('validate', list(PACKAGES))[1]}" in done.stdout
