"""Peers in environments of their own: a child process computes and measures itself, the parent says when.

Parent and child speak in lines on pipes: ``run NAME`` is answered by its times, ``result NAME`` by a file.
"""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks.contest import Contestant, Contestants, Result
from benchmarks.environments import environment, folder
from benchmarks.timing import Elapsed
from benchmarks.workloads import Reach, Stance
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot

MARK = "@@ "
"""Begins every line of the child that is meant for the parent: libraries print what they like."""
PEERS = {"eaik": ["eaik"], "toolbox": ["roboticstoolbox-python"], "placo": ["placo"]}
"""Module in this folder, and what its environment installs."""


def contestants(peer: str, robot: Robot, given: Reach | Stance) -> Contestants:
    """What a peer offers for inputs; nothing where it cannot be installed or does not fit."""
    python = environment(peer, PEERS[peer])
    if python is None:
        return {}
    place = folder("exchange")
    inputs = place / f"{peer}.npz"
    np.savez(inputs, **_packed(given))
    child = subprocess.Popen(
        [str(python), "-m", "benchmarks.peers.apart", peer, robot.path or robot.name, str(inputs)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=Path(__file__).resolve().parents[2],
        env={**os.environ, "PYTHONPATH": ""},
    )
    offered = _told(child)
    return {name: _contestant(child, name, note, place) for name, note in (offered or {}).items()}


def _contestant(child: subprocess.Popen[str], name: str, note: str, place: Path) -> Contestant:
    def ask(what: str) -> Any:
        assert child.stdin is not None
        child.stdin.write(f"{what} {name}\n")
        child.stdin.flush()
        return _told(child)

    def run() -> Elapsed:
        return Elapsed(*ask("run"))

    def result(_: Any) -> Result:
        return dict(np.load(place / ask("result")))

    return Contestant(run, result, note)


def _told(child: subprocess.Popen[str]) -> Any:
    """The child's next line that is meant for us; None when it has ended."""
    assert child.stdout is not None
    for line in child.stdout:
        if line.startswith(MARK):
            return json.loads(line.removeprefix(MARK))
    return None


def _packed(given: Reach | Stance) -> dict[str, Any]:
    if isinstance(given, Reach):
        return {
            "limb": given.limb.name,
            "target": given.target,
            "guess": given.guess,
            "follows": given.follows,
        }
    tips = {f"tip:{name}": value for name, value in given.tips.items()}
    return {"T_world_base": given.T_world_base, "guess": given.guess, **tips}


def _unpacked(robot: Robot, held: Any) -> Reach | Stance:
    if "limb" in held:
        limb = robot.limb(str(held["limb"]))
        chain = SerialChain.of(robot, limb.name)
        return Reach(limb, chain, held["target"], held["guess"], bool(held["follows"]))
    tips = {name.removeprefix("tip:"): held[name] for name in held if name.startswith("tip:")}
    return Stance(held["T_world_base"], tips, held["guess"])


def serve(peer: str, robot: Robot, given: Reach | Stance, say: Callable[[Any], None]) -> None:
    """The child's side: offer, then run and hand over until the pipe closes."""
    module = import_module(f"benchmarks.peers.{peer}")
    provide = getattr(module, "reach" if isinstance(given, Reach) else "positions", None)
    offered: Contestants = provide(robot, given) if provide else {}
    say({name: contestant.note for name, contestant in offered.items()})
    latest: dict[str, Any] = {}
    for line in sys.stdin:
        what, _, name = line.strip().partition(" ")
        if what == "run":
            cpu, wall = time.process_time(), time.perf_counter()
            latest[name] = offered[name].run()
            say(dataclasses.astuple(Elapsed(time.perf_counter() - wall, time.process_time() - cpu)))
        else:
            file = folder("exchange") / f"{peer}-result.npz"
            np.savez(file, **offered[name].result(latest[name]))
            say(file.name)


if __name__ == "__main__":
    peer_, robot_, inputs_ = sys.argv[1:]
    chosen = sk.load_robot(robot_)
    with np.load(inputs_) as packed:
        given_ = _unpacked(chosen, dict(packed))
    serve(peer_, chosen, given_, lambda told: print(MARK + json.dumps(told), flush=True))
