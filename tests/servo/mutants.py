"""Faults are written into the code of the bus, one at a time, and its tests must notice each of them.

    python -m tests.servo.mutants                       # 200 faults; what was run before is not run again
    python -m tests.servo.mutants --file gate --count 20
    python -m tests.servo.mutants --only gate:17        # one, with what the tests say

A fault is one place of a syntax tree that says something else: a comparison or a sign turned round, a number
changed, a condition negated, ``and`` for ``or``, a call left out, ``return`` of nothing, another exception.
Texts, annotations and docstrings stay. The places are drawn by a seed, each by itself, so that an edit of the
code moves no other. The tests of the file run in a process of their own, up to the first that fails. Every
result is a line of ``runs/mutants.jsonl``; a fault is tried anew when the function around it has changed,
and one that was not noticed when the tests have. What survives, and why: ``tests/servo/mutants.md``.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import importlib
import importlib.util
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cached_property
from importlib.abc import InspectLoader
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import Phase, settings

from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot

CHECKOUT = Path(__file__).resolve().parents[2]
RESULTS = CHECKOUT / "runs" / "mutants.jsonl"
TESTS: dict[str, tuple[str, ...]] = {
    "gate": ("test_gate",),
    "watch": ("test_watch",),
    "leave": ("test_leave",),
    "packets": ("test_packets", "test_bus"),
    "bus": ("test_bus", "test_leave", "test_quick_reading"),
    "player": ("test_player", "test_guardian", "test_play_stops"),
}
"""The tests of each file, the quickest first."""
LIMIT = {"player": 400, "packets": 30}
"""Seconds of processor after which a fault counts as noticed, and is named a timeout; 20 by default."""
PATIENCE = 3600.0
"""Seconds of the clock after which the same is true of one that waits for ever."""

_TURNED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Add: ast.Sub,
    ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip

Change = Callable[[ast.AST], None]


@dataclass(frozen=True)
class Mutant:
    """One place of a file's code, by the number of its node, and the fault there."""

    file: str
    number: int
    line: int
    what: str
    place: str
    node: int
    change: Change

    @property
    def name(self) -> str:
        """As ``--only`` takes it, and what is wrong."""
        return f"{self.file}:{self.number} line {self.line}: {self.what}"

    @cached_property
    def tree(self) -> ast.Module:
        """The code of the file with the fault."""
        tree = _tree(self.file)
        self.change(list(ast.walk(tree))[self.node])
        return ast.fix_missing_locations(tree)

    @cached_property
    def code(self) -> str:
        """What the fault is, and the function that it is in: as long as both stay, so does its result."""
        around = [
            part
            for part in ast.walk(self.tree)
            if isinstance(part, ast.FunctionDef) and part.lineno <= self.line <= (part.end_lineno or 0)
        ]
        return _digest(f"{self.place} {ast.unparse(around[-1]) if around else ''}")


def mutants(file: str) -> list[Mutant]:
    """Every fault that can be written into a file of ``screwkin/servo``."""
    alike: Counter[str] = Counter()
    everyone = []
    for i, (node, line, what, change) in enumerate(_places(_tree(file))):
        alike[what] += 1
        everyone.append(Mutant(file, i, line, what, f"{file} {what} {alike[what]}", node, change))
    return everyone


def _tree(file: str) -> ast.Module:
    return ast.parse(_source(file).read_text(encoding="utf-8"))


def _source(file: str) -> Path:
    return CHECKOUT / "screwkin" / "servo" / f"{file}.py"


def _places(tree: ast.Module) -> Iterator[tuple[int, int, str, Change]]:
    """Number of the node, line, what is wrong there, and how to make it so."""
    silent = _untouched(tree)
    for index, node in enumerate(ast.walk(tree)):
        if node in silent:
            continue
        line = getattr(node, "lineno", 0)
        for what, change in _faults(node):
            yield index, line, f"{ast.unparse(node).splitlines()[0][:70]}: {what}", change


def _untouched(tree: ast.Module) -> set[ast.AST]:
    """Annotations, docstrings, decorators, messages of errors, and imports."""
    left: set[ast.AST] = set()
    for node in ast.walk(tree):
        roots: list[ast.AST | None] = []
        if isinstance(node, ast.FunctionDef):
            roots += [node.returns, *node.decorator_list]
        elif isinstance(node, ast.arg | ast.AnnAssign):
            roots.append(node.annotation)
        elif isinstance(node, ast.JoinedStr) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        ):
            roots.append(node)
        elif isinstance(node, ast.ClassDef):
            roots += [*node.bases, *node.decorator_list]
        left.update(part for root in roots if root is not None for part in ast.walk(root))
    return left


def _faults(node: ast.AST) -> Iterator[tuple[str, Change]]:
    if isinstance(node, ast.Compare):
        for i, op in enumerate(node.ops):
            if type(op) in _TURNED:
                yield (
                    f"{type(op).__name__} turned",
                    lambda n, i=i: n.ops.__setitem__(i, _TURNED[type(n.ops[i])]()),
                )
    elif isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in _TURNED:
        yield f"{type(node.op).__name__} turned", lambda n: setattr(n, "op", _TURNED[type(n.op)]())
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield "one more", lambda n: setattr(n, "value", n.value + 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield "the other", lambda n: setattr(n, "value", not n.value)
    elif isinstance(node, ast.If | ast.IfExp | ast.While):
        yield "negated", lambda n: setattr(n, "test", ast.UnaryOp(ast.Not(), n.test))
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield "left out", lambda n: setattr(n, "value", ast.Constant(None))
    elif isinstance(node, ast.AugAssign):
        yield "left out", lambda n: setattr(n, "op", ast.Add()) or setattr(n, "value", ast.Constant(0))
    elif isinstance(node, ast.Return) and node.value is not None:
        yield "returns nothing", lambda n: setattr(n, "value", ast.Constant(None))
    elif isinstance(node, ast.Raise):
        yield "is not raised", lambda n: setattr(n, "exc", ast.Call(ast.Name("Exception"), [], []))


class Faulty(InspectLoader):
    """Loads a mutant where its file is asked for."""

    def __init__(self, mutant: Mutant) -> None:
        self.mutant = mutant

    def get_source(self, fullname: str) -> str:
        return ast.unparse(self.mutant.tree) + "\n"


def drawn(files: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """So many faults of files, by a lot that each place draws for itself."""

    def lot(mutant: Mutant) -> str:
        return _digest(f"{seed} {mutant.place}")

    everyone = sorted((mutant for file in files for mutant in mutants(file)), key=lot)
    return sorted(everyone[:count], key=lambda mutant: list(TESTS).index(mutant.file))


def _prepare() -> None:
    """Import once what no fault is in and all tests need; failing examples are not made smaller."""
    settings.register_profile(
        "mutants", deadline=None, derandomize=True, max_examples=40, phases=[Phase.explicit, Phase.generate]
    )
    os.environ |= {"HYPOTHESIS_PROFILE": "mutants", "OMP_NUM_THREADS": "1"}
    with redirect_stdout(StringIO()):
        pytest.main(["-q", "-p", "no:cacheprovider", "--collect-only", "tests/gait/test_gait_files.py"])
    importlib.import_module("dynamixel_sdk")
    walk(load_robot("bioloid"), load_gait("smooth"), 1)


def outcome(mutant: Mutant) -> tuple[str, str]:
    """``noticed``, ``timeout`` or ``survives``, and what the tests print."""
    with tempfile.TemporaryFile("w+") as said:
        process = os.fork()
        if process == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            limit = LIMIT.get(mutant.file, 20)
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            os._exit(_tested(mutant))
        status = _waited(process)
        said.seek(0)
        text = said.read()
    if os.WIFSIGNALED(status):
        return "timeout", text
    return "noticed" if os.WEXITSTATUS(status) else "survives", text


def _tested(mutant: Mutant) -> int:
    """What pytest says with the fault in place of the module, in this process: 0 if all is well."""
    name = f"screwkin.servo.{mutant.file}"
    spec = importlib.util.spec_from_loader(name, Faulty(mutant), origin=str(_source(mutant.file)))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    setattr(importlib.import_module("screwkin.servo"), mutant.file, module)
    try:
        spec.loader.exec_module(module)
    except Exception:
        return 1
    tests = [str(CHECKOUT / "tests" / "servo" / f"{name}.py") for name in TESTS[mutant.file]]
    return int(pytest.main(["-q", "-x", "-p", "no:cacheprovider", *tests]))


def _waited(process: int) -> int:
    """The status of a process that has ended, or is ended after a while."""
    end = time.monotonic() + PATIENCE
    while True:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            return status
        if time.monotonic() > end:
            os.kill(process, signal.SIGKILL)
        time.sleep(0.02)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _results() -> dict[str, dict[str, str]]:
    """The last result of every fault, by its code."""
    lines = RESULTS.read_text(encoding="utf-8").splitlines() if RESULTS.exists() else []
    return {row["code"]: row for row in map(json.loads, lines)}


def result(mutant: Mutant, before: dict[str, dict[str, str]]) -> str:
    """The outcome, from the file of results where it still holds, else appended to it."""
    tests = [CHECKOUT / "tests" / "servo" / f"{name}.py" for name in TESTS[mutant.file]]
    by = _digest("".join(path.read_text(encoding="utf-8") for path in tests))
    last = before.get(mutant.code)
    if last and (last["outcome"] != "survives" or last["tests"] == by):
        return last["outcome"]
    ended, _ = outcome(mutant)
    row = {"code": mutant.code, "tests": by, "outcome": ended, "name": mutant.name}
    RESULTS.parent.mkdir(exist_ok=True)
    with RESULTS.open("a", encoding="utf-8") as out:
        out.write(json.dumps(row) + "\n")
    return ended


def main(words: Sequence[str] | None = None) -> int:
    """Run the tests on mutants; 1 if more than a twentieth of them survives."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--file", choices=sorted(TESTS), action="append")
    options.add_argument("--count", type=int, default=200)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", help="FILE:NUMBER of one mutant")
    chosen = options.parse_args(words)
    os.chdir(CHECKOUT)
    _prepare()
    if chosen.only:
        file, _, number = chosen.only.partition(":")
        mutant = mutants(file)[int(number)]
        ended, said = outcome(mutant)
        print(f"{said}\n{ended} {mutant.name}")
        return int(ended == "survives")
    picked, before = drawn(chosen.file or list(TESTS), chosen.count, chosen.seed), _results()
    table: dict[str, Counter[str]] = {}
    for done, mutant in enumerate(picked, 1):
        ended = result(mutant, before)
        table.setdefault(mutant.file, Counter())[ended] += 1
        print(f"{done}/{len(picked)} {ended} {mutant.name}", flush=True)
    for file, counts in table.items():
        print(f"{file}: {', '.join(f'{counts[key]} {key}' for key in sorted(counts))}")
    left = sum(counts["survives"] for counts in table.values())
    print(f"{len(picked) - left} of {len(picked)} noticed")
    return int(20 * left > len(picked))


if __name__ == "__main__":
    sys.exit(main())
