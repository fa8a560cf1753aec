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

PAPER = """
[paper]
name = "small"
title = "Small"
source = "a test"
robot = "poppy12"
[[section]]
place = "Table 2"
title = "Masses"
row = [{ item = "total", measure = "mass", paper = 1.21, unit = "kg" }]
picture = [{ draw = "reach_maps", caption = "Reach", with = { heights = [0.45], resolution = 0.05 } }]
"""
VERBS = {
    "robots": "robots",
    "gaits": "gaits",
    "info": "info poppy12",
    "table": "table linkages/four-bar",
    "table --symbolic": "table linkages/four-bar --symbolic",
    "convert": "convert poppy12 poppy.urdf",
    "convert back": "convert poppy.urdf poppy.csv",
    "compare": "compare poppy12 --samples 5 --rounds 1 -o compare",
    "ik": "ik bioloid right_arm --poses 5",
    "walk": "walk bioloid --gait step-in-place --set Tc=0.6 --steps 1 --rate 50 -o walk",
    "zmp": "zmp walk/trajectory.npz",
    "validate": "validate walk/trajectory.npz --engine pybullet --no-plots",
    "send": "send walk/trajectory.npz",
    "send --virtual": "send walk/trajectory.npz --virtual --go -o send",
    "validate kinematic": "validate walk/trajectory.npz --engine kinematic -o kinematic",
    "workspace": "workspace poppy12 --resolution 0.05 --heights 0.45 -o workspace",
    "stiffness": "stiffness poppy12 --resolution 0.05 --heights 0.45 -k 50 -o stiffness",
    "reproduce": "reproduce paper.toml -o paper",
    "codegen": "codegen poppy12 -o codegen",
    "bus virtual": "bus virtual bioloid --seconds 0",
    "bus scan": "bus scan --port nowhere",
    "demo": "demo bioloid --gait step-in-place --steps 1 -o demo",
}
AS_EVER = {"validate kinematic": 3, "bus scan": 2}
"""Exit codes that are not 0 with every library: no forces were simulated, and there is no such port."""
NEEDED = {
    "sympy": {"table --symbolic"},
    "pybullet": {"validate"},
    "serial": {"bus scan"},
    "dynamixel_sdk": {"send --virtual"},
}
AFTER = {"validate": {"send": 4, "send --virtual": 4}}
"""What is refused for want of a verdict."""
PICTURES = {"compare", "walk", "validate kinematic", "workspace", "stiffness", "reproduce"}
"""What goes on without pictures, which stand beside its results."""

CODE = """
import contextlib, io, json, sys
sys.modules.update(dict.fromkeys(json.loads(sys.argv[1])))
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


@pytest.mark.parametrize("library", PACKAGES)
def test_what_needs_an_absent_library_exits_2_with_its_install_line_and_nothing_else_does(library, tmp_path):
    verbs = {name: words for name, words in VERBS.items() if name != "demo"}
    needed = NEEDED.get(library, set())
    refused = {name: code for verb in needed for name, code in AFTER.get(verb, {}).items()}
    install = f"python -m pip install {PACKAGES[library]}"
    for name, (code, err) in called(tmp_path, [library], verbs).items():
        assert "Traceback" not in err, name
        if name in needed:
            assert (code, install in err) == (2, True), (name, code, err)
        else:
            assert code == {**AS_EVER, **refused}.get(name, 0), (name, code, err)
            assert (install in err) == (library == "matplotlib" and name in PICTURES), (name, err)


def test_a_small_installation_runs_tables_kinematics_walks_zmp_ik_and_codegen(tmp_path):
    needed = {name for names in NEEDED.values() for name in names} - {"send --virtual"} | {"demo"}
    refused = AFTER["validate"]
    for name, (code, err) in called(tmp_path, list(PACKAGES), VERBS).items():
        assert "Traceback" not in err, name
        assert code == (2 if name in needed else {**AS_EVER, **refused}.get(name, 0)), (name, code, err)
        assert name not in needed | PICTURES or "pip install" in err, (name, err)
    assert (tmp_path / "demo" / "report.html").exists(), "what was done so far"


EXAMPLES = """
import doctest, json, sys
absent = json.loads(sys.argv[1])
sys.modules.update(dict.fromkeys(absent))
import screwkin as sk
raised = {}
for name in sk.__all__:
    example = doctest.DocTestParser().get_doctest(getattr(sk, name).__doc__ or "", {}, name, None, 0)
    for one in example.examples:
        try:
            exec(compile(one.source, name, "exec"), example.globs)
        except BaseException as error:
            raised[name] = [type(error).__name__, str(error)]
            break
print(json.dumps(raised))
"""


@pytest.mark.parametrize("absent", [[name] for name in PACKAGES] + [list(PACKAGES)], ids=" ".join)
def test_root_functions_work_without_a_library_or_say_how_to_install_it(absent, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", EXAMPLES, json.dumps(absent)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    raised = json.loads(done.stdout)
    assert set(raised) <= {"validate"}
    assert all(kind == "MissingDependencyError" and "pip install" in text for kind, text in raised.values())
    assert bool(raised) == ("pybullet" in absent)
