"""The shell blocks of README and docs are run as they stand, or shorter; or a reason why not stands here."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import typer

import screwkin as sk
from screwkin.cli import OPTIONS as ALONE
from screwkin.cli import VERBS, verb_app

ROOT = Path(__file__).resolve().parent.parent
PAGES = ["README.md", "CONTRIBUTING.md", "benchmarks/README.md"] + [
    path.relative_to(ROOT).as_posix()
    for path in sorted((ROOT / "docs").rglob("*.md"))
    if path.parent.name != "reference"
]
REASONS = {
    r"\.venv/bin/(uv )?pip install|python3(\.11)? -m venv": "installs: .ci/run and .ci/smoke run it",
    r"^pip install|activate$|--install-completion": "changes the installation, or the user's shell",
    r"sphinx": ".ci/run builds the site",
    r"pytest": "the tests themselves",
    r"ruff|mypy": ".ci/run runs it",
    r"^dask|--cluster": "needs a cluster: tests/campaign/test_cluster.py starts one",
    r"--port /dev/": "needs servos: tests/cli/test_send_feedback.py and others play to virtual ones",
    r"-m tests\.|-m benchmarks(?! --quick)": "a campaign of minutes to hours, whose results are committed",
}
"""Lines that are not run, and why."""
SHORTER = {"--runs 8": "--runs 1", "--evaluations 48": "--evaluations 12"}
"""What is less of the same."""
SHIM = """#!/bin/bash
limit=; [ "$1" = view ] && limit="timeout -s INT 25"
$limit {python} -m screwkin "$@"; code=$?
case "$1 $code" in "view 130"|"view 124"|*" 0"|*" 3") ;; *) echo "exit $code: screwkin $*" >> {failed};; esac
exit $code
"""


class Block(NamedTuple):
    """A shell block of a page."""

    page: str
    text: str

    @property
    def lines(self) -> list[str]:
        """Its commands, continued lines joined."""
        return [line for line in self.text.replace("\\\n", " ").splitlines() if line.strip()]

    @property
    def script(self) -> str:
        """What of it is run."""
        run = [line for line in self.lines if not any(re.search(reason, line) for reason in REASONS)]
        text = "\n".join(run).replace(".venv/bin/", "")
        for words, fewer in SHORTER.items():
            text = text.replace(words, fewer)
        return text


def blocks() -> Iterator[Block]:
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        for found in re.finditer(r"^```(?:sh|bash|shell|console)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
            yield Block(page, found[1])


def commands(block: Block) -> Iterator[list[str]]:
    """Words of every call of screwkin."""
    for call in re.findall(
        r"(?:^|&& )\s*(?:\.venv/bin/)?screwkin (.*)", "\n".join(block.lines), re.MULTILINE
    ):
        yield shlex.split(call, comments=True)


def test_every_verb_and_option_of_a_block_exists():
    count = 0
    for block in blocks():
        for verb, *words in commands(block):
            if verb in ALONE:
                continue
            command = typer.main.get_command(verb_app(verb))
            if words and words[0] in getattr(command, "commands", {}):
                command = command.commands[words[0]]
            known = {name for p in command.params for name in (*p.opts, *p.secondary_opts)} | ALONE.keys()
            options = {word.partition("=")[0] for word in words if word.startswith("-")}
            assert options <= known, (block.page, verb, options - known)
            count += 1
    assert count > 20


def test_every_reason_is_of_some_line():
    lines = [line for block in blocks() for line in block.lines]
    for reason in (*REASONS, *map(re.escape, SHORTER)):
        assert any(re.search(reason, line) for line in lines), reason
    assert {verb for block in blocks() for verb, *_ in commands(block)} <= {*VERBS, *ALONE}


def prepare(folder: Path) -> None:
    """What the pages speak of as there: a robot's URDF, a walk, its joints by another program, a world."""
    robot = sk.load_robot("bioloid")
    walk = sk.walk(robot, sk.load_gait("smooth"), 2)
    for place in ("walk", "runs/walk"):
        (folder / place).mkdir(parents=True)
        walk.save(folder / place / "trajectory.npz")
    np.savetxt(
        folder / "joints.csv",
        np.column_stack([walk.time, walk.q]),
        delimiter=",",
        header=",".join(["time", *(joint.name for joint in robot.joints)]),
        comments="",
    )
    (folder / "world.toml").write_text("[perturbation]\nfriction = 0.7\n", encoding="utf-8")
    for name in ("robot", "my-robot"):
        subprocess.run(
            [sys.executable, "-m", "screwkin", "convert", "poppy12", f"{name}.urdf", "--quiet"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            check=True,
        )
        (folder / f"{name}.srdf").unlink()


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted({block.page for block in blocks() if block.script}))
def test_the_blocks_of_a_page_run_one_after_the_other(page, tmp_path):
    prepare(tmp_path)
    tools, failed = tmp_path / "tools", tmp_path / "failed.txt"
    tools.mkdir()
    shim = tools / "screwkin"
    shim.write_text(SHIM.format(python=sys.executable, failed=failed), encoding="utf-8")
    shim.chmod(0o755)
    environment = {
        **os.environ,
        "PATH": os.pathsep.join([str(tools), str(Path(sys.executable).parent), os.environ["PATH"]]),
        "PYTHONPATH": str(ROOT),
        "MPLBACKEND": "Agg",
    }
    for block in blocks():
        if block.page == page and block.script:
            done = subprocess.run(
                ["bash", "-uo", "pipefail", "-c", block.script],
                cwd=tmp_path,
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                check=False,
            )
            said = done.stdout[-2000:] + done.stderr[-2000:]
            assert done.returncode in (0, 3, 124, 130), (block.script, said)
            assert not failed.exists(), (failed.read_text(encoding="utf-8"), said)
