"""What is played: walks, ways to walk them, worlds and servos; and one row of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks.walking.peer import placo_walk
from screwkin.analysis.engines import Engine
from screwkin.campaign.world import world_of

ROBOT = "bioloid"
USUAL = {"stride": 0.07, "lift": 0.012, "lead": 1.0, "horizon": 1.0}
STEPS = 12
NOISE = "imu_noise=0.002 sense_lag=0.01 cells=0"
"""Of every world: no force cells, an attitude that jitters by 0.1 degree, a cycle late; and a bias."""
BIAS = "imu_bias~0.02"
SERVOS = {"AX-12": "ax-12", "stiff": str(Path(__file__).with_name("stiff.toml"))}
ENGINES: tuple[Engine, ...] = ("mujoco", "pybullet")
Row = dict[str, Any]


@dataclass(frozen=True)
class Way:
    """A way to walk: whose plan, the time of its steps [s], and whether what is felt is answered."""

    maker: str
    Tc: float
    feedback: bool


WAYS: Mapping[str, Way] = {
    "feedback": Way("screwkin", 0.35, True),
    "open loop": Way("screwkin", 0.35, False),
    "placo .5": Way("placo", 0.5, False),
    "placo 1": Way("placo", 1.0, False),
}
"""The first is what the others are compared with."""


def _pushes() -> list[str]:
    ways = [(0.2 * math.cos(k * math.pi / 4), 0.2 * math.sin(k * math.pi / 4)) for k in range(8)]
    return [f"{BIAS} push={x:.4f},{y:.4f},0 push_at={at} {NOISE}" for at in (2.5, 2.67) for x, y in ways]


WORLDS: Mapping[str, Sequence[str]] = {
    "x3": [f"x3 {BIAS} {NOISE}"] * 60,
    "lags": [f"lag~0.02 each_lag~1 {BIAS} {NOISE}"] * 60,
    "rise of 5 mm": [f"{BIAS} rise=0.005 rise_at={0.08 + 0.015 * k:.3f} {NOISE}" for k in range(20)],
    "push of .2 N s": _pushes(),
}
"""The worlds of the runs by name, as ``sweep --perturb`` takes them."""


@dataclass(frozen=True)
class Piece:
    """One run: names of its engine, servo, world and way, its number and its seed."""

    engine: Engine
    servo: str
    world: str
    way: str
    run: int
    seed: int


def pieces(
    seeds: Sequence[int],
    engines: Sequence[Engine] = ENGINES,
    servos: Sequence[str] = tuple(SERVOS),
    worlds: Sequence[str] = tuple(WORLDS),
    ways: Sequence[str] = tuple(WAYS),
    most: int = 60,
) -> Iterator[Piece]:
    """All runs, every seed in all ways before the next, so that a stopped campaign holds whole pairs."""
    for engine in engines:
        for servo in servos:
            for world in worlds:
                count = min(most, len(WORLDS[world]), len(seeds))
                for run in range(count):
                    yield from (Piece(engine, servo, world, way, run, seeds[run]) for way in ways)


@cache
def planned(maker: str, Tc: float) -> sk.Trajectory:
    """The walk of a maker, in steps of that time."""
    robot = sk.load_robot(ROBOT)
    if maker == "placo":
        return placo_walk(robot, Tc, USUAL["stride"], USUAL["lift"], STEPS)
    return sk.walk(robot, sk.load_gait("preview").replace(Tc=Tc, **USUAL), steps=STEPS)


def row_of(piece: Piece) -> Row:
    """Play a run; what fails in it is its row."""
    way, head = WAYS[piece.way], asdict(piece)
    try:
        robot, plan = sk.load_robot(ROBOT), planned(way.maker, way.Tc)
        x = plan.T_world_base[:, 0, 3]
        distance = float(np.abs(x - x[0]).max())
        words = WORLDS[piece.world][piece.run]
        check = sk.validate(
            robot,
            plan,
            piece.engine,
            servo=SERVOS[piece.servo],
            perturbation=world_of(words, robot, piece.seed, plan.duration, distance),
            feedback=way.feedback,
        )
    except sk.ScrewkinError as error:
        return head | {"status": "refused", "passed": False, "reason": str(error).splitlines()[0]}
    return head | {
        "status": "fell" if check.fell else "stood",
        "passed": check.passed,
        "end_error_mm": check.end_error_mm,
        "slip_mm": check.slip_mm,
        "tilt_deg": check.max_tilt_deg,
        "reason": "; ".join(check.reasons),
    }
