"""Do the engines' settings matter? The same stand and walk at usual, finer and other settings of each solver.

    python -m benchmarks.convergence [ROBOT ...] [--steps N]

A setting is good where finer ones change nothing; agreement with the plan is shown beside it, but proves
nothing: a wrong solver can agree by accident. Every column but the last compares a run with the finest of the
same engine: half the step and four times the iterations.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import screwkin as sk
from screwkin.gait.files import default_gait
from screwkin.sim.backend import Backend, Command
from screwkin.sim.measure import zmp_record
from screwkin.sim.mujoco import MuJoCoBackend, MuJoCoPhysics
from screwkin.sim.pybullet import Physics, PyBulletBackend
from screwkin.sim.run import Run, simulate

FINEST = "finest"
CHANGES: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "pybullet": {
        "usual": {},
        "half the step": {"dt": 5e-4},
        "twice the iterations": {"iterations": 400},
        FINEST: {"dt": 5e-4, "iterations": 800},
        "a quarter of the iterations": {"iterations": 50},
        "direct": {"solver": "direct"},
        "direct, softer": {"solver": "direct", "regularisation": 1e-6},
    },
    "mujoco": {
        "usual": {},
        "half the step": {"dt": 5e-4},
        "twice the iterations": {"iterations": 200},
        FINEST: {"dt": 5e-4, "iterations": 400},
        "pyramidal cone": {"cone": "pyramidal"},
        "friction as hard as contact": {"impratio": 1.0},
        "friction harder": {"impratio": 100.0},
        "softer contact": {"contact_time": 5e-3},
        "softest contact": {"contact_time": 2e-2, "contact_impedance": 0.9},
    },
}


class Row(NamedTuple):
    """What one setting changes: ZMP and base against the finest run, weight, ZMP against the plan."""

    engine: str
    setting: str
    fell: bool
    zmp_mm: float
    base_mm: float
    weight_error: float
    plan_mm: float


def opened(robot: sk.Robot, engine: str, changes: Mapping[str, Any]) -> Backend:
    if engine == "pybullet":
        return PyBulletBackend(robot, replace(Physics(), **changes))
    return MuJoCoBackend(robot, replace(MuJoCoPhysics(), **changes))


def rows_of(robot: sk.Robot, walk: sk.Trajectory) -> Iterator[Row]:
    """One row for every setting of every engine."""
    for engine, settings in CHANGES.items():
        runs, weights = {}, {}
        for name, changes in settings.items():
            backend = opened(robot, engine, changes)
            weights[name] = weight_error(robot, backend)
            runs[name] = simulate(robot, walk, backend)
            backend.close()
        for name, run in runs.items():
            zmp, base = apart(run, runs[FINEST], walk)
            record = zmp_record(run, walk)
            plan = rms(record.contact - record.planned)
            yield Row(engine, name, run.fallen_at is not None, zmp, base, weights[name], plan)


def weight_error(robot: sk.Robot, backend: Backend) -> float:
    """How far the contact forces of a stand of 0.3 s are from the weight, relatively, over 50 ms."""
    home = sk.home(robot)
    backend.reset(home)
    forces = []
    for _ in range(round(0.3 / backend.dt)):
        backend.step(Command(home.q, np.zeros_like(home.q), home.T_world_base))
        forces.append(sum(contact.force[2] for contact in backend.observe().contacts))
    weight = float(robot.mass) * 9.81
    return abs(float(np.mean(forces[-round(0.05 / backend.dt) :])) / weight - 1.0)


def apart(run: Run, finest: Run, walk: sk.Trajectory) -> tuple[float, float]:
    """RMS of the difference of their ZMPs and of their bases [mm], as long as both stand."""
    own, best = zmp_record(run, walk), zmp_record(finest, walk)
    if not len(own.time) or not len(best.time):
        return np.nan, np.nan
    time = own.time[own.time <= best.time[-1]]
    there = np.stack([np.interp(time, best.time, axis) for axis in best.contact.T], axis=1)
    base = np.stack(
        [np.interp(run.time, finest.time, axis) for axis in finest.T_world_base[:, :3, 3].T], axis=1
    )
    return rms(own.contact[: len(time)] - there), rms(run.T_world_base[:, :3, 3] - base)


def rms(error: np.ndarray) -> float:
    error = error[np.isfinite(error).all(axis=1)]
    return float(1e3 * np.sqrt(np.mean(np.sum(error**2, axis=1)))) if len(error) else np.nan


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.convergence", description=__doc__)
    parser.add_argument("robots", nargs="*", default=["bioloid", "poppy12"], help="names or files")
    parser.add_argument("--steps", type=int, default=2, help="of the walk")
    parser.add_argument("--gait", help="by default the robot's own")
    parser.add_argument("--Tc", type=float, help="duration of a step [s]")
    chosen = parser.parse_args(arguments)
    for name in chosen.robots:
        robot = sk.load_robot(name)
        gait = sk.load_gait(chosen.gait or default_gait(robot.name))
        gait = gait if chosen.Tc is None else gait.replace(Tc=chosen.Tc)
        print(f"{robot.name}, {gait.name}, {chosen.steps} steps of {gait.Tc:g} s")
        print(f"  {'engine':9}{'setting':29}{'fell':6}{'ZMP mm':>8}{'base mm':>9}{'weight':>9}{'plan mm':>9}")
        for row in rows_of(robot, sk.walk(robot, gait, steps=chosen.steps)):
            fell = "yes" if row.fell else "no"
            print(
                f"  {row.engine:9}{row.setting:29}{fell:6}{row.zmp_mm:8.3f}{row.base_mm:9.4f}"
                f"{row.weight_error:9.1e}{row.plan_mm:9.3f}"
            )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
