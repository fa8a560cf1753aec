"""python -m benchmarks.limbs FILE.urdf... [--poses N] [-o FILE]: how the limbs of public robots are solved.

Of every robot's legs and arms, as its geometry gives them: random joint positions within the limits, the
poses of the tip that these make, and inverse kinematics of the poses. Own branch: the share of poses whose
solutions hold the positions themselves, to 1e-10 rad; inside: the share with a solution within the limits. A
robot that does not stand on two legs has its longest chain measured, of at most seven joints. An arm of more
than seven joints, as one that begins at the waist has, is also measured from its shoulder on: its last seven.

Time: processor time of one thread for a pose, of so many batches: least, median and most. The first one is
solved before, too, so that all programs are there.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import screwkin as sk
from benchmarks.environments import ROOT
from benchmarks.machine import description, keep_memory, pin_threads
from benchmarks.robots import file_of
from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import IDENTITY, as_array, unstack
from screwkin.analysis.ik_class import family_of
from screwkin.anatomy.humanoid import anatomy
from screwkin.compiler.run import compile_program
from screwkin.ik.limb import DEFAULT, resting
from screwkin.ik.methods import solve_limb
from screwkin.ik.programs import limb_programs
from screwkin.ik.starts import box
from screwkin.kinematics.serial_chain import SerialChain, forward, nearest_points
from screwkin.model.robot import Limb
from screwkin.model.values import COUPLINGS

BATCHES = 5
POSES, NUMERIC = 10_000, 1_000
"""Poses of a limb whose branches are known, and of one that is solved by iterations."""
OWN = 1e-10
"""Difference [rad] up to which a solution is the own one."""
SHOULDER = 7
"""Joints that an arm has from its shoulder on, at most."""


@dataclass(frozen=True)
class Row:
    """A limb: its file, name, number of joints, how it is solved, shares, and microseconds of every batch."""

    file: str
    limb: str
    joints: int
    family: str
    poses: int
    own: float | None
    inside: float
    times: tuple[float, ...]

    def __str__(self) -> str:
        own = "" if self.own is None else f"{100 * self.own:.2f} %"
        least, middle, most = (f(self.times) for f in (min, statistics.median, max))
        return (
            f"| {self.file} | {self.limb} | {self.joints} | {self.family} | {self.poses} | {own} |"
            f" {100 * self.inside:.2f} % | {least:.1f} | {middle:.1f} | {most:.1f} |"
        )


def limbs_of(robot: sk.Robot) -> tuple[sk.Robot, tuple[tuple[str, SerialChain], ...]]:
    """The chains of a robot: of limbs as its geometry gives them, and of arms from their shoulders on."""
    try:
        robot = anatomy(robot).robot
    except sk.ScrewkinError:
        robot = _one_limb(robot)
    chains = []
    for limb in robot.limbs:
        chain = SerialChain.of(robot, limb.name)
        chains.append((limb.name, chain))
        if limb.kind == "arm" and len(chain.names) > SHOULDER:
            chains.append((f"{limb.name} from its shoulder", shouldered(chain)))
    return robot, tuple(chains)


def _one_limb(robot: sk.Robot) -> sk.Robot:
    """A robot that is no humanoid, with its longest chain that is an arm's length as its only limb."""
    count = len(robot.joints)
    paths = {link.name: robot.path_to(link.name) for link in robot.links}
    whole = {
        name: path for name, path in paths.items() if len(path) <= SHOULDER and all(i < count for i in path)
    }
    turning = {n: p for n, p in whole.items() if not any(robot.tree[i].screw.is_translation for i in p)}
    name = max(turning, key=lambda n: len(turning[n]))
    pose = next(link.frame for link in robot.links if link.name == name)
    arm = Limb("arm", "arm", name, "arm_tip", pose if pose is not None else IDENTITY, COUPLINGS)
    return replace(robot, limbs=(arm,), soles=(), waist=None, text="")


def shouldered(chain: SerialChain) -> SerialChain:
    """The last joints of an arm, as if what is before them were fixed."""
    kept = slice(len(chain.names) - SHOULDER, None)
    return replace(
        chain,
        names=chain.names[kept],
        joints=tuple(range(SHOULDER)),
        screws=nearest_points(chain.screws[kept], chain.tip.p),
        lower=chain.lower[kept],
        upper=chain.upper[kept],
        turning=chain.turning[kept],
    )


def row_of(file: str, name: str, chain: SerialChain, rest: Array, poses: int | None = None) -> Row:
    """What is measured of a limb."""
    family, branches = family_of(chain)
    count, n = poses or (POSES if branches > 1 else NUMERIC), len(chain.names)
    low, high = box(chain)
    q = np.random.default_rng(0).uniform(low, high, (count, n))
    T = np.asarray(as_array(forward(chain.screws, unstack(q), chain.tip)[0], (count,)), dtype=float)
    guess, times = np.tile(rest, (count, 1)), []
    for program in limb_programs(chain):
        compile_program(program)
    own, inside = np.zeros((2, count), dtype=bool)
    parts = np.array_split(np.arange(count), min(count, BATCHES))
    for part in [parts[0], *parts]:
        start = time.process_time()
        found = solve_limb(chain, T[part], "auto", guess[part], DEFAULT, part.shape)
        times.append(1e6 * (time.process_time() - start) / len(part))
        apart = np.abs((found.q - q[part, None] + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)
        own[part] = ((apart < OWN) & found.valid).any(axis=1)
        inside[part] = found.in_limits.any(axis=1)
    share = float(own.mean()) if branches > 1 else None
    return Row(file, name, n, family, count, share, float(inside.mean()), tuple(times[1:]))


def rows_of(path: Path, poses: int | None = None) -> Iterator[Row]:
    """The rows of a file."""
    robot, chains = limbs_of(sk.load_robot(path))
    for name, chain in chains:
        rest = resting(robot, SerialChain.of(robot, chain.limb))[-len(chain.names) :]
        yield row_of(file_of(path), name, chain, np.clip(rest, chain.lower, chain.upper), poses)


def page_of(rows: Sequence[Row]) -> str:
    """The figures as Markdown."""
    facts = description(("numpy",))
    head = ["# Limbs of public robots", "", (__doc__ or "").strip(), ""]
    about = [
        f"{facts['processor']}, one thread; load {facts['load']} as it was written; {BATCHES} batches.",
        "",
    ]
    table = [
        "| robot | limb | joints | solved by | poses | own branch | inside | least us | median | most |",
        "|---|---|---:|---|---:|---:|---:|---:|---:|---:|",
        *map(str, rows),
    ]
    return "\n".join([*head, *about, *table, ""])


def main(arguments: list[str] | None = None) -> int:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.limbs", description="How limbs are solved.")
    parser.add_argument("files", nargs="+", type=Path, help="URDF files")
    parser.add_argument("--poses", type=int, help=f"poses of every limb; default {POSES}, or {NUMERIC}")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results" / "limbs.md")
    asked = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    asked.output.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for path in asked.files:
        for row in rows_of(path, asked.poses):
            rows.append(row)
            print(row, flush=True)
        asked.output.write_text(page_of(rows), encoding="utf-8")
    return 0


if __name__ == "__main__":
    pin_threads()
    keep_memory()
    sys.exit(main())
