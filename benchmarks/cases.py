"""The workloads as cases: inputs, who contends, and how results are judged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks import agreement, ours, workloads
from benchmarks.contest import Contestants, Result
from benchmarks.peers import apart, mujoco, pinocchio_contest, pinocchio_python
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.model.robot import Robot

Provider = Callable[[], Contestants]
Provide = Callable[[Robot, Any], Contestants]
Judge = Callable[[Result], Any]


@dataclass(frozen=True, eq=False)
class Case:
    """A workload at one size.

    Attributes:
        workload: W1 to W8.
        title: what is computed.
        count: samples, by which times are divided.
        unit: what a sample is.
        providers: who contends, by name; a missing library gives no contestants or an ImportError.
        judge: asserts that a result is right, and tells how well; None: like the first contestant's.
        rounds: how often each is timed.
    """

    workload: str
    title: str
    count: float
    unit: str
    providers: dict[str, Provider]
    judge: Judge | None = None
    rounds: int = 7
    facts: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Sizes:
    """How large the workloads are."""

    rates: tuple[int, ...] = (1, 64, 4096, 65536)
    gait: int = 750
    random: int = 100_000
    stances: tuple[int, ...] = (750, 15_000)
    balance: int = 15_000
    walk: float = 60.0
    map: int = 1_000_000
    slow: int = 1_000
    """Largest batch for contestants that call a library per sample from Python; times are per sample."""


QUICK = Sizes((1, 16), 25, 200, (25,), 50, 5.0, 2_000, 25)
FULL = Sizes()


def few(provide: Provide, robot: Robot, given: Any, count: int) -> Contestants:
    """A provider's contestants on the first samples alone: for engines that are called sample by sample."""
    if workloads.size(given) <= count:
        return provide(robot, given)
    told = f"timed on the first {count:,}"
    offered = provide(robot, workloads.first(given, count))
    return {
        name: replace(contestant, few=count, note="; ".join(filter(None, (contestant.note, told))))
        for name, contestant in offered.items()
    }


def cases(robot: Robot, sizes: Sizes, wanted: set[str], peers: set[str] | None = None) -> Iterator[Case]:
    """The cases of the wanted workloads; ``peers`` limits who contends beside this library."""
    makers = {
        "W1": _rates,
        "W2": _reach,
        "W3": _positions,
        "W4": _balance,
        "W5": _gait,
        "W6": _map,
        "W8": _contacts,
    }
    for name, make in makers.items():
        if name in wanted:
            for case in make(robot, sizes):
                yield _limited(case, peers)


def _limited(case: Case, peers: set[str] | None) -> Case:
    if peers is None:
        return case
    kept = {name: p for name, p in case.providers.items() if name == ours.NAME or name in peers}
    return Case(**{**vars(case), "providers": kept})


def _rates(robot: Robot, sizes: Sizes) -> Iterator[Case]:
    slow = sizes.slow
    for count in sizes.rates:
        given = workloads.motion(robot, count)
        yield Case(
            "W1",
            "four tip poses and all joint rates",
            count,
            "sample",
            {
                ours.NAME: partial(ours.rates, robot, given),
                "pinocchio-cpp": partial(pinocchio_contest.rates, robot, given),
                "pinocchio-python": partial(few, pinocchio_python.rates, robot, given, slow),
                "mujoco": partial(few, mujoco.rates, robot, given, slow),
            },
            rounds=15,
        )


def _reach(robot: Robot, sizes: Sizes) -> Iterator[Case]:
    slow = sizes.slow
    along, random = (
        workloads.gait_reach(robot, sizes.gait),
        workloads.random_reach(robot, sizes.random),
    )
    for given, told in ((along, "poses of a gait"), (random, "random poses")):
        yield Case(
            "W2",
            f"inverse kinematics of a leg, {told}",
            len(given.target),
            "pose",
            {
                ours.NAME: partial(ours.reach, robot, given),
                "pinocchio-cpp": partial(pinocchio_contest.reach, robot, given),
                "pinocchio-python": partial(few, pinocchio_python.reach, robot, given, slow),
                "eaik": partial(apart.contestants, "eaik", robot, given),
                "toolbox": partial(few, partial(apart.contestants, "toolbox"), robot, given, slow),
                "placo": partial(few, partial(apart.contestants, "placo"), robot, given, slow),
            },
            agreement.reached(given),
        )


def _positions(robot: Robot, sizes: Sizes) -> Iterator[Case]:
    slow = sizes.slow
    walk = workloads.walked(robot, max(sizes.stances))
    for count in sizes.stances:
        given = workloads.stance(robot, walk, count)
        yield Case(
            "W3",
            "all joints from poses of waist and feet and positions of hands",
            count,
            "sample",
            {
                ours.NAME: partial(ours.positions, robot, given),
                "pinocchio-cpp": partial(pinocchio_contest.positions, robot, given),
                "placo": partial(few, partial(apart.contestants, "placo"), robot, given, slow),
            },
            agreement.stood(robot, given),
        )


def _balance(robot: Robot, sizes: Sizes) -> Iterator[Case]:
    # Simulators accept no massless link: all contestants get the same least masses.
    heavy = robot.with_inertia_floor()
    given = workloads.dynamic(workloads.walked(robot, sizes.balance), sizes.balance)
    yield Case(
        "W4",
        "centre of mass, momentum and ZMP",
        len(given.q),
        "sample",
        {
            ours.NAME: partial(ours.balance, heavy, given),
            "pinocchio-cpp": partial(pinocchio_contest.balance, heavy, given),
            "pinocchio-python": partial(pinocchio_python.balance, heavy, given),
            "mujoco": partial(mujoco.balance, heavy, given),
        },
    )


def _contacts(robot: Robot, sizes: Sizes) -> Iterator[Case]:
    given = workloads.dynamic(workloads.walked(robot, sizes.balance), sizes.balance)
    title = "wrenches of both feet and all joint efforts of a walk"
    yield Case("W8", title, len(given.q), "sample", {ours.NAME: partial(ours.contacts, robot, given)})


def _gait(robot: Robot, sizes: Sizes) -> Iterator[Case]:
    contestants = ours.gait(robot, sizes.walk, 100.0)
    walked = next(iter(contestants.values())).run()
    duration = float(walked.time[-1])
    yield Case(
        "W5",
        f"a walk of {duration:.0f} s at 100 Hz: positions, rates, accelerations, ZMP",
        duration,
        "second of walk",
        {ours.NAME: lambda: contestants},
        agreement.anything,
        rounds=5,
    )


def _map(robot: Robot, sizes: Sizes) -> Iterator[Case]:
    limb = workloads.first_leg(robot)
    levels, resolution, poses = _grid(robot, limb.name, sizes.map)
    yield Case(
        "W6",
        "workspace map: all branches, limits, conditioning",
        poses,
        "pose",
        {ours.NAME: partial(ours.reachable, robot, limb.name, levels, resolution)},
        agreement.anything,
        rounds=3,
    )


def _grid(robot: Robot, limb: str, wanted: int) -> tuple[tuple[float, ...], float, int]:
    """Levels of a map, and the resolution at which it tries about so many poses; how many they are."""
    from screwkin.analysis.workspace import _grid as points
    from screwkin.analysis.workspace import default_heights

    levels, chain = tuple(default_heights(robot, limb)), SerialChain.of(robot, limb)

    def tried(resolution: float) -> int:
        return sum(int(np.sum(points(chain, height, resolution)[2])) for height in levels)

    resolution = 0.005
    for _ in range(3):
        resolution *= (tried(resolution) / wanted) ** 0.5
    return levels, resolution, tried(resolution)


def robot_of(name: str) -> Robot:
    """The robot that all workloads are about."""
    return sk.load_robot(name)
