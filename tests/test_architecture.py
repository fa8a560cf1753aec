"""The house rules that a reader relies on: imports point down, files stay small, drivers stay in their room.

Every rule is a function from parsed sources to a list of faults. It is applied to the package, and to small
bad trees, so that a rule which has gone blind is noticed.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

import screwkin

CHECKOUT = Path(__file__).resolve().parent.parent
FLOORS: dict[str, int] = {
    "errors": 0, "files": 0, "cache": 0, "algebra": 0,
    "compiler": 1,
    "model": 2,
    "kinematics": 3, "motors": 3,
    "dynamics": 4, "mechanism": 4,
    "ik": 5, "compliance": 5,
    "gait": 6, "trajectory": 6, "anatomy": 6, "stabiliser": 6,
    "sim": 7, "servo": 7,
    "analysis": 8, "campaign": 8,
    "report": 9, "papers": 9, "export": 9, "viewer": 9,
    "cli": 10, "__main__": 10, "": 10,
}  # fmt: skip
DRIVERS = {
    "pybullet": ("screwkin.sim.pybullet",),
    "pybullet_data": ("screwkin.sim.pybullet",),
    "mujoco": ("screwkin.sim.mujoco", "screwkin.model.mjcf_in"),
    "dask": ("screwkin.campaign.cluster",),
    "distributed": ("screwkin.campaign.cluster",),
    "trimesh": ("screwkin.model.meshes",),
    "collada": ("screwkin.model.meshes",),
    "viser": ("screwkin.viewer.server",),
    "serial": ("screwkin.servo.bus",),
    "dynamixel_sdk": ("screwkin.servo.bus",),
}
LAZY = (*DRIVERS, "sympy")
SLOW_TO_START = ("jax", "scipy", "matplotlib", "sympy", "pybullet", "serial", "dynamixel_sdk", "viser")


@dataclass(frozen=True)
class Import:
    """One imported module, where it stands, and whether it happens when the file is loaded."""

    target: str
    line: int
    eager: bool


@dataclass(frozen=True)
class Module:
    """One source file of the package."""

    name: str
    path: Path

    @cached_property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text, filename=str(self.path))

    @cached_property
    def imports(self) -> list[Import]:
        return list(imports_of(self.tree, self.name, self.path.name == "__init__.py"))


def modules(root: Path) -> list[Module]:
    """All modules of the package whose folder is ``root``."""
    found = []
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root.parent).with_suffix("").parts
        found.append(Module(".".join(p for p in parts if p != "__init__"), path))
    return found


def imports_of(tree: ast.Module, module: str, is_package: bool) -> Iterator[Import]:
    """Every import of a file, those inside functions and ``import_module("...")`` included."""
    lazy = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.FunctionDef | ast.AsyncFunctionDef)
        or (isinstance(block, ast.If) and ast.unparse(block.test).endswith("TYPE_CHECKING"))
        for node in ast.walk(block)
    }
    for node in ast.walk(tree):
        eager = id(node) not in lazy
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, node.lineno, eager) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = module.split(".") if is_package else module.split(".")[:-1]
                base = ".".join([*package[: len(package) - node.level + 1], *([base] if base else [])])
            yield from (Import(f"{base}.{alias.name}", node.lineno, eager) for alias in node.names)
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in ("import_module", "__import__"):
                yield Import(str(node.args[0].value), node.lineno, eager)


def owner(target: str, known: set[str]) -> str | None:
    """The module of the package that an import reaches: ``screwkin.errors.Fault`` is ``screwkin.errors``."""
    while target and target not in known:
        target = target.rpartition(".")[0]
    return target or None


def floor(module: str) -> int | None:
    """Floor of a module, None where the map does not place it."""
    return FLOORS.get(module.partition(".")[2].partition(".")[0])


def unplaced(sources: list[Module]) -> list[str]:
    return [
        f"{m.name}: on no floor; place it in FLOORS and in the design"
        for m in sources
        if floor(m.name) is None
    ]


def upward(sources: list[Module]) -> list[str]:
    known = {m.name for m in sources}
    found = []
    for m in sources:
        for used in m.imports:
            target = owner(used.target, known)
            here, there = floor(m.name), floor(target) if target else None
            if here is not None and there is not None and there > here:
                found.append(
                    f"{m.path.name}:{used.line}: {m.name} (floor {here}) imports {target} (floor {there})"
                )
    return found


def cycles(sources: list[Module]) -> list[str]:
    """Modules that reach themselves through imports, lazy ones included."""
    known = {m.name for m in sources}
    edges = {m.name: {owner(i.target, known) for i in m.imports} - {None, m.name} for m in sources}
    found = []
    for start in edges:
        reached, todo = set(), list(edges[start])
        while todo:
            name = todo.pop()
            if name not in reached:
                reached.add(name)
                todo += edges[name]
        if start in reached:
            found.append(f"{start} imports itself through {sorted(n for n in reached if start in edges[n])}")
    return found


def mutual(sources: list[Module]) -> list[str]:
    """Pairs of packages that import each other."""
    known = {m.name for m in sources}
    way: dict[str, dict[str, str]] = {}
    for m in sources:
        for used in m.imports:
            target = owner(used.target, known)
            here, there = (name.split(".")[1] if "." in name else "" for name in (m.name, target or ""))
            if here != there and here and there:
                way.setdefault(here, {})[there] = f"{m.name}:{used.line}"
    return [
        f"{a} and {b} import each other: {way[a][b]}, {way[b][a]}"
        for a in way
        for b in way[a]
        if a < b and a in way.get(b, {})
    ]


def misplaced_drivers(sources: list[Module]) -> list[str]:
    return [
        f"{m.name}:{used.line}: only {' and '.join(home)} imports {name}"
        for m in sources
        for used in m.imports
        for name, home in DRIVERS.items()
        if used.target.split(".")[0] == name and m.name not in home
    ]


def eager(sources: list[Module]) -> list[str]:
    return [
        f"{m.name}:{used.line}: import {used.target} inside the function that needs it"
        for m in sources
        for used in m.imports
        if used.eager and used.target.split(".")[0] in LAZY
    ]


def long_files(sources: list[Module], most: int = 400) -> list[str]:
    lengths = {m.name: m.text.count("\n") for m in sources}
    return [f"{name}: {lines} lines, at most {most}" for name, lines in lengths.items() if lines > most]


def long_functions(sources: list[Module], most: int = 60, share: float = 0.95) -> list[str]:
    lengths = [
        (f"{m.name}.{node.name}", node.end_lineno - node.lineno + 1)
        for m in sources
        for node in ast.walk(m.tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno
    ]
    long = [f"{name}: {lines} lines, aim at {most}" for name, lines in lengths if lines > most]
    return long if len(long) > (1 - share) * len(lengths) else []


def robot_names(robots: Path) -> set[str]:
    """Names of the bundled robots, with and without the number at their end."""
    stems = {path.stem for path in robots.glob("*.toml")}
    return stems | {stem.rstrip("0123456789") for stem in stems}


def named_robots(root: Path, names: set[str]) -> list[str]:
    """Lines of the package, data files apart, that name a robot in code, comment or docstring."""
    pattern = re.compile("|".join(sorted(map(re.escape, names))) or r"(?!)", re.IGNORECASE)
    return [
        f"{path.relative_to(root)}:{number}: names a robot: {line.strip()}"
        for path in sorted(root.rglob("*"))
        if path.is_file() and path.suffix != ".pyc" and "data" not in path.relative_to(root).parts
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
        if pattern.search(line)
    ]


def unfinished(sources: list[Module]) -> list[str]:
    marks = ("TO" + "DO", "FIX" + "ME", "XX" + "X")
    return [f"{m.name}: holds {mark}" for m in sources for mark in marks if re.search(rf"\b{mark}\b", m.text)]


PACKAGE = modules(CHECKOUT / "screwkin")
RULES = (unplaced, upward, cycles, mutual, misplaced_drivers, eager, long_files, long_functions, unfinished)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_package_keeps_the_rule(rule):
    assert len(PACKAGE) > 5
    faults = rule(PACKAGE)
    assert not faults, "\n".join(faults)


def test_no_robot_is_named_in_the_package():
    """Robots are data. Cite a paper as docs/papers.md does; take a default robot's name from the data."""
    faults = named_robots(CHECKOUT / "screwkin", robot_names(CHECKOUT / "robots"))
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("folder", ["tests", "examples", "benchmarks"])
def test_files_beside_the_package_stay_small_and_finished_too(folder):
    sources = modules(CHECKOUT / folder)
    faults = long_files(sources) + unfinished(sources)
    assert not faults, "\n".join(faults)


def test_the_root_namespace_holds_at_most_60_names():
    names = getattr(screwkin, "__all__", [])
    assert len(names) <= 60
    assert len(set(names)) == len(names)


def test_every_name_of_the_root_resolves_and_is_documented():
    for name in getattr(screwkin, "__all__", []):
        assert getattr(screwkin, name).__doc__, name


@pytest.mark.parametrize("arguments", [[], ["--help"], ["robots"], ["gaits"]])
def test_starting_the_command_line_loads_nothing_slow(arguments):
    """No argument stands for the bare import of package and command line."""
    code = f"""
import contextlib, io, sys
import screwkin, screwkin.cli
if {arguments}:
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        screwkin.cli.main({arguments})
print(*({set(SLOW_TO_START)} & set(sys.modules)))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


def plant(root: Path, files: dict[str, str]) -> list[Module]:
    for name, text in files.items():
        path = root / "screwkin" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return modules(root / "screwkin")


LONG_FUNCTION = "def f():\n" + "    x = 1\n" * 60
BAD_TREES = [
    ("unplaced", {"utils.py": ""}),
    ("unplaced", {"helpers/deep/file.py": ""}),
    ("upward", {"algebra/screws.py": "from screwkin.model import robot\n", "model/robot.py": ""}),
    ("upward", {"algebra/screws.py": "from screwkin.model.robot import Robot\n", "model/robot.py": ""}),
    (
        "upward",
        {"model/robot.py": "def f():\n    import screwkin.ik.newton as n\n", "ik/newton.py": ""},
    ),
    (
        "upward",
        {"model/robot.py": "from ..ik import newton\n", "model/__init__.py": "", "ik/newton.py": ""},
    ),
    ("upward", {"model/__init__.py": "from ..ik.newton import x\n", "ik/newton.py": ""}),
    (
        "upward",
        {"sim/b.py": "if TYPE_CHECKING:\n    from screwkin.report import page\n", "report/page.py": ""},
    ),
    ("upward", {"errors.py": "import importlib\nimportlib.import_module('screwkin.cli')\n", "cli.py": ""}),
    ("upward", {"errors.py": "import screwkin\n", "__init__.py": ""}),
    ("cycles", {"model/a.py": "from screwkin.model import b\n", "model/b.py": "from . import a\n"}),
    (
        "mutual",
        {
            "sim/a.py": "from screwkin.servo import b\n",
            "servo/b.py": "",
            "servo/c.py": "from screwkin.sim import d\n",
            "sim/d.py": "",
        },
    ),
    ("misplaced_drivers", {"sim/other.py": "def f():\n    import pybullet\n"}),
    ("misplaced_drivers", {"servo/packets.py": "def f():\n    from serial.tools import list_ports\n"}),
    ("misplaced_drivers", {"sim/pybullet.py": "def f():\n    import dynamixel_sdk\n"}),
    ("eager", {"sim/pybullet.py": "import pybullet\n"}),
    ("eager", {"report/symbols.py": "class A:\n    from sympy import Symbol\n"}),
    ("long_files", {"algebra/screws.py": "\n" * 401}),
    ("long_functions", {"algebra/screws.py": LONG_FUNCTION}),
    ("unfinished", {"algebra/screws.py": "# TO" + "DO: later\n"}),
]


@pytest.mark.parametrize(("name", "files"), BAD_TREES)
def test_every_rule_sees_a_tree_that_breaks_it(tmp_path, name, files):
    sources = plant(tmp_path, files)
    assert [rule.__name__ for rule in RULES if rule(sources)] == [name]


def test_a_sound_tree_has_no_faults(tmp_path):
    files = {
        "__init__.py": "def f():\n    from screwkin import cli\n",
        "cli.py": "from screwkin.sim.pybullet import connect\nfrom screwkin.model import robot\n",
        "sim/pybullet.py": "if TYPE_CHECKING:\n    import sympy\ndef connect():\n    import pybullet\n",
        "servo/bus.py": "class Bus:\n    def __init__(self):\n        import serial, dynamixel_sdk\n",
        "model/__init__.py": "",
        "model/robot.py": "from ..algebra.screws import Screw\nimport numpy\n",
        "mechanism/graph.py": "from screwkin.kinematics.positions import link_displacements\n",
        "kinematics/positions.py": "",
        "algebra/screws.py": "def sympy_free(): pass\n",
    }
    sources = plant(tmp_path, files)
    assert [fault for rule in RULES for fault in rule(sources)] == []


def test_a_robot_name_is_found_in_any_file_and_case_and_data_are_left_alone(tmp_path):
    plant(
        tmp_path,
        {
            "cli/demo.py": 'ROBOT = "mini24"\n',
            "report/page.html": "The Mini walks\n",
            "data/mini.toml": "mini",
        },
    )
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "mini24.toml").touch()
    names = robot_names(tmp_path / "robots")
    assert names == {"mini24", "mini"}
    assert len(named_robots(tmp_path / "screwkin", names)) == 2
