"""Faults are written into the code of the bus, one at a time, and its tests must notice each of them.

    python -m tests.servo.mutants                       # 200 faults, 40 and less in a file
    python -m tests.servo.mutants --file gate --count 20
    python -m tests.servo.mutants --only gate:17        # one, with what the tests say

A fault is one place of a syntax tree that says something else: a comparison or a sign turned round, a number
changed, a condition negated, ``and`` for ``or``, a call left out, ``return`` of nothing, another exception.
Texts, annotations and docstrings stay. Places are drawn by a seed; the tests run on a copy of the checkout.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
TESTS: dict[str, tuple[str, ...]] = {
    "gate": ("test_gate",),
    "watch": ("test_watch",),
    "leave": ("test_leave",),
    "packets": ("test_packets", "test_bus"),
    "bus": ("test_bus", "test_leave", "test_virtual_sdk"),
    "player": ("test_player", "test_guardian"),
}
"""The tests of each file, the quickest first."""
LIMIT = 300.0
"""s after which a mutant that hangs counts as noticed."""

_TURNED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Add: ast.Sub,
    ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip

Change = Callable[[ast.AST], None]


@dataclass(frozen=True)
class Mutant:
    """One place of a file's code, and the fault there; ``text`` is the whole file with it."""

    file: str
    number: int
    line: int
    what: str
    text: str


def mutants(file: str) -> list[Mutant]:
    """Every fault that can be written into a file of ``screwkin/servo``."""
    source = (CHECKOUT / "screwkin" / "servo" / f"{file}.py").read_text(encoding="utf-8")
    tree = ast.parse(source)
    places = list(_places(tree))
    return [
        Mutant(file, i, line, what, _changed(tree, index, change))
        for i, (index, line, what, change) in enumerate(places)
    ]


def _changed(tree: ast.Module, index: int, change: Change) -> str:
    """The code of a tree whose node of that number is another."""
    copy = deepcopy(tree)
    change(list(ast.walk(copy))[index])
    return ast.unparse(ast.fix_missing_locations(copy)) + "\n"


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


def drawn(files: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """So many faults of files, of each as many as its share of all places."""
    everyone = [mutant for file in files for mutant in mutants(file)]
    return random.Random(seed).sample(everyone, min(count, len(everyone)))


def survives(mutant: Mutant, tree: Path) -> tuple[bool, str]:
    """Whether the tests of its file pass on a copy of the checkout with it, and what they print."""
    path = tree / "screwkin" / "servo" / f"{mutant.file}.py"
    original = path.read_text(encoding="utf-8")
    path.write_text(mutant.text, encoding="utf-8")
    tests = [f"tests/servo/{name}.py" for name in TESTS[mutant.file]]
    words = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    environment = {**os.environ, "PYTHONPATH": str(tree), "HYPOTHESIS_PROFILE": "ci"}
    try:
        ended = subprocess.run(
            words, cwd=tree, env=environment, capture_output=True, text=True, timeout=LIMIT
        )
        return ended.returncode == 0, ended.stdout
    except subprocess.TimeoutExpired:
        return False, "it hung"
    finally:
        path.write_text(original, encoding="utf-8")


def main(words: Sequence[str] | None = None) -> int:
    """Run the tests on mutants; 1 if more than a twentieth of them survives."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--file", choices=sorted(TESTS), action="append")
    options.add_argument("--count", type=int, default=200)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", help="FILE:NUMBER of one mutant")
    chosen = options.parse_args(words)
    picked = drawn(chosen.file or list(TESTS), chosen.count, chosen.seed)
    if chosen.only:
        file, _, number = chosen.only.partition(":")
        picked = [mutants(file)[int(number)]]
    left = []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "checkout"
        shutil.copytree(CHECKOUT, tree, ignore=shutil.ignore_patterns(".git", ".venv", "runs", "__pycache__"))
        for done, mutant in enumerate(picked, 1):
            alive, said = survives(mutant, tree)
            name = f"{mutant.file}:{mutant.number} line {mutant.line}: {mutant.what}"
            print(f"{done}/{len(picked)} {'SURVIVES' if alive else 'noticed'} {name}", flush=True)
            left += [name] * alive
            if chosen.only:
                print(said)
    print(f"{len(picked) - len(left)} of {len(picked)} noticed")
    print("\n".join(left))
    return int(20 * len(left) > len(picked))


if __name__ == "__main__":
    sys.exit(main())
