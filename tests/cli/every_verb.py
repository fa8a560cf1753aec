"""Every verb of the command line once, with what it needs: it works, or exits 2 naming the library it lacks.

``python every_verb.py``, in an installation of screwkin (``.ci/verbs`` makes two), calls each in an empty
folder with the libraries that are there, prints exit codes, and exits 1 if one is not what it must be.
"""

from __future__ import annotations

import contextlib
import functools
import io
import os
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

PACKAGES = {
    "jax": "jax",
    "sympy": "sympy",
    "pybullet": "pybullet",
    "mujoco": "mujoco",
    "serial": "pyserial",
    "dynamixel_sdk": "dynamixel-sdk",
    "matplotlib": "matplotlib",
    "viser": "viser",
}
"""Libraries that an installation may lack, and the packages that hold them."""
FILES = {
    "paper.toml": """
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
""",
    "bench.json": """{"mass": 0.5, "length": 0.1, "kp": 100, "vin": 7.4, "motor": "XL330", "entries": [
{"timestamp": 0.0, "goal_position": 0.1, "position": 0.0},
{"timestamp": 0.1, "goal_position": 0.2, "position": 0.1}]}""",
}
"""What verbs read, by name."""
VERBS = {
    "doctor": "doctor",
    "robots": "robots",
    "gaits": "gaits",
    "info": "info poppy12",
    "check": "check poppy12",
    "table": "table linkages/four-bar",
    "table --symbolic": "table linkages/four-bar --symbolic",
    "forces": "forces bioloid --weights",
    "convert": "convert poppy12 poppy.urdf",
    "convert back": "convert poppy.urdf poppy.csv",
    "new": "new poppy.urdf -o new.toml",
    "compare": "compare poppy12 --samples 5 --rounds 1 -o compare",
    "ik": "ik bioloid right_arm --poses 5",
    "walk": "walk bioloid --gait step-in-place --set Tc=0.6 --steps 1 --rate 50 -o walk",
    "zmp": "zmp walk/trajectory.npz",
    "validate": "validate walk/trajectory.npz --engine mujoco --no-plots",
    "send": "send walk/trajectory.npz",
    "send --virtual": "send walk/trajectory.npz --virtual --go -o send",
    "validate kinematic": "validate walk/trajectory.npz --engine kinematic -o kinematic",
    "sweep": "sweep bioloid --gait walk --engine kinematic --set steps=1 --set rate=20 -o sweep",
    "view": "view linkages/four-bar",
    "workspace": "workspace poppy12 --resolution 0.05 --heights 0.4 -o workspace",
    "stiffness": "stiffness poppy12 --resolution 0.05 --heights 0.4 -k 50 -o stiffness",
    "reproduce": "reproduce paper.toml -o paper",
    "codegen": "codegen poppy12 -o codegen",
    "bus profiles": "bus profiles",
    "bus identify": "bus identify bench.json --friction m1 -o identify",
    "bus virtual": "bus virtual bioloid --seconds 0",
    "bus scan": "bus scan --port nowhere",
    "bus read": "bus read --port nowhere --robot bioloid",
    "bus configure": "bus configure bioloid --port nowhere",
    "bus calibrate": "bus calibrate bioloid --port nowhere --write own.toml",
}
DEMO = {"demo": "demo bioloid --gait step-in-place --steps 1 -o demo"}
AS_EVER = {"validate kinematic": 3} | dict.fromkeys(
    ("bus scan", "bus read", "bus configure", "bus calibrate"), 2
)
"""Exit codes that are not 0 with every library: no forces were simulated, and there is no such port."""
NEEDS = {
    "table --symbolic": ["sympy"],
    "validate": ["mujoco"],
    "bus scan": ["serial"],
    "bus read": ["serial"],
    "bus configure": ["serial"],
    "bus calibrate": ["serial"],
    "send --virtual": ["dynamixel_sdk", "serial"],  # the driver imports it
    "view": ["viser"],
    "demo": ["mujoco"],
}
ENGINES = ("mujoco", "pybullet")
VERDICT = {"send", "send --virtual"}
"""What is refused, with exit code 4, where there is no verdict."""
DRAWING = {"compare", "sweep", "walk", "validate kinematic", "workspace", "stiffness", "reproduce"}
"""What goes on without pictures, which stand beside its results."""


def chosen(absent: Collection[str]) -> dict[str, str]:
    """The verbs, without pictures where they can be drawn: those take long, and stand in other tests.

    A viewer that is installed serves until it is stopped: it is left out.
    """
    plots = "" if "matplotlib" in absent else " --no-plots"
    verbs = {name: words for name, words in VERBS.items() if name != "view" or "viser" in absent}
    return {name: words + plots if name in DRAWING else words for name, words in verbs.items()}


def asking(absent: Collection[str]) -> dict[str, str]:
    """The verbs that may ask for a library, and the walk they are about.

    All others are known to need none where they work without any.
    """
    verbs = chosen(absent)
    return {name: verbs[name] for name in verbs if name == "walk" or name in VERDICT or name in NEEDS}


def expected(name: str, absent: Collection[str]) -> tuple[int, str]:
    """Exit code of a verb without some libraries, and the package that it asks for."""
    if name in VERDICT and expected("validate", absent)[1]:
        return 4, ""
    if name == "doctor" and not any(_installed(engine) for engine in ENGINES):
        return 3, ""
    for library in NEEDS.get(name, []):
        if library in absent:
            return 2, PACKAGES[library]
    picture = name in DRAWING and "matplotlib" in absent
    return AS_EVER.get(name, 0), "matplotlib" if picture else ""


def _installed(package: str) -> bool:
    """Whether a distribution is there, whatever imports are kept from finding it."""
    try:
        return bool(version(package))
    except PackageNotFoundError:
        return False


def called(verbs: Mapping[str, str]) -> Iterator[tuple[str, int, str, str]]:
    """Name, exit code, stdout and stderr of every verb, called one after the other in this folder."""
    from screwkin.cli import run
    from screwkin.model import table

    table.parse_robot = functools.cache(table.parse_robot)  # as in conftest
    for name, text in FILES.items():
        Path(name).write_text(text, encoding="utf-8")
    for name, words in verbs.items():
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run(words.split())
        yield name, code, out.getvalue(), err.getvalue()


def fault(name: str, code: int, err: str, absent: Collection[str]) -> str:
    """What is wrong with an answer; empty if nothing is."""
    wanted, package = expected(name, absent)
    if "Traceback" in err:
        return "a traceback"
    if code != wanted:
        return f"exit {code}, expected {wanted}: {err}"
    if ("pip install" in err) != bool(package):
        return f"expected {'an' if package else 'no'} install line: {err}"
    if package and f"python -m pip install {package}" not in err:
        return f"expected the install line of {package}: {err}"
    return ""


def main() -> int:
    """Call every verb in this installation, and report."""
    absent = [library for library in PACKAGES if find_spec(library) is None]
    print(f"Python {sys.version.split()[0]} without {', '.join(absent) or 'nothing'}")
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name, code, _, err in called(chosen(absent) | DEMO):
            said = fault(name, code, err, absent)
            package = expected(name, absent)[1]
            print(f"  {name:<20}{code}  {said or ('asks for ' + package if package else '')}", flush=True)
            wrong += bool(said)
        os.chdir("/")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
