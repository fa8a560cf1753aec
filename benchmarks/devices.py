"""python -m benchmarks.devices [--largest N] [--quick] [-o DIR]: kernels in JAX on whatever devices it finds.

The same functions run on a CPU, on one GPU, and on several devices by sharding the batch. Results of every
size are compared with NumPy's before any time is taken. Told apart are the time of the devices alone, arrays
in place, and the time with the arrays sent there and back.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import screwkin as sk
from benchmarks import workloads
from benchmarks.environments import ROOT
from benchmarks.machine import description, version_of
from benchmarks.report import time_told
from screwkin.compiler.program import Program
from screwkin.compiler.records import identifier
from screwkin.compiler.run import run
from screwkin.dynamics import quantities
from screwkin.ik import programs as limbs
from screwkin.ik.closed import recognised
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.tip_motion import motion_program
from screwkin.model.robot import Robot

Array = Any

SIZES = (4096, 65_536, 1_048_576)
TOLERANCE = {"float64": 1e-9, "float32": 2e-3}
"""Largest difference from NumPy, relative to the largest entry of a result (at least 1)."""
AGREEING = 0.995
"""Share of the samples that must agree: near singular positions float32 keeps few digits."""
DECISIONS = ("sure", "worst")
"""Outputs that depend on rounding by design and are not compared."""
ROUNDS = 9


@dataclass(frozen=True)
class Row:
    """One kernel at one size; seconds of the whole batch.

    Attributes:
        agreement: share of samples that equal NumPy's results within the tolerance.
        alone: median and least time of the devices, arrays in place.
        moved: the same with arrays sent there and back.
    """

    program: str
    dtype: str
    samples: int
    devices: int
    agreement: float
    alone: tuple[float, float]
    moved: tuple[float, float]


def inputs(robot: Robot, count: int) -> Iterator[tuple[Program, dict[str, Array]]]:
    """The kernels of rates, balance, a leg and the whole body's positions, with inputs (count, *shape)."""
    rng, given = np.random.default_rng(2), workloads.motion(robot, count)
    state = {"T_world_base": given.T_world_base, "q": given.q}
    rates = {"base_twist": given.waist, **{identifier("twist", tip): x for tip, x in given.tips.items()}}
    yield motion_program(robot), state | rates
    second = {"qd": rng.uniform(-1, 1, given.q.shape), "qdd": rng.uniform(-1, 1, given.q.shape)}
    second |= {"base_twist": given.waist, "base_acceleration": rng.uniform(-1, 1, (count, 6))}
    yield quantities.balance.program(robot), state | second
    reach = workloads.random_reach(robot, count)
    guess = np.broadcast_to(reach.guess, (count, len(reach.guess)))
    yield limbs.limb_nearest(robot, reach.limb.name), {"T_base_tip": reach.target, "guess": guess}
    home = sk.home(robot).q
    for chain in (SerialChain.of(robot, limb.name) for limb in robot.limbs):
        pose = len(chain.joints) == 6
        if recognised(chain, not pose):
            target = sk.frame_pose(robot, sk.State(**state), robot.limb(chain.limb).tip)
            own = np.broadcast_to(home[list(chain.joints)], (count, len(chain.joints)))
            wanted = {"target": target if pose else target[:, :3, 3], "guess": own}
            yield limbs.limb_pose(chain, not pose).program, {"T_world_base": given.T_world_base, **wanted}


def measured(
    program: Program, given: dict[str, Array], dtype: str, devices: list[Any], rounds: int = ROUNDS
) -> Row:
    """One kernel: agreement, then times.

    Raises:
        AssertionError: results differ from NumPy's.
    """
    import jax
    from jax.sharding import Mesh, NamedSharding, PartitionSpec

    from screwkin.compiler.emit_jax import function

    count = len(next(iter(given.values())))
    mesh = Mesh(np.array(devices), ("batch",))
    with jax.enable_x64(dtype == "float64"):
        host = [np.ascontiguousarray(np.moveaxis(given[g.name], 0, -1), dtype=dtype) for g in program.inputs]
        places = [NamedSharding(mesh, PartitionSpec(*[None] * (x.ndim - 1), "batch")) for x in host]
        kernel = jax.jit(function(program))

        def sent() -> list[Array]:
            return [jax.device_put(x, place) for x, place in zip(host, places, strict=True)]

        there = sent()
        share = _agreement(program, given, [np.asarray(x) for x in kernel(*there)], TOLERANCE[dtype])
        assert share >= AGREEING, f"{program.name}, {dtype}: {share:.2%} of the samples agree with NumPy"
        alone = _times(lambda: jax.block_until_ready(kernel(*there)), rounds)
        moved = _times(lambda: [np.asarray(x) for x in kernel(*sent())], rounds)
    return Row(program.name, dtype, count, len(devices), share, alone, moved)


def _agreement(program: Program, given: dict[str, Array], found: list[Array], tolerance: float) -> float:
    expected = run(program, given, path="numpy")
    same = np.ones(found[0].shape[-1], dtype=bool)
    for group, x in zip(program.outputs, found, strict=True):
        if group.name in DECISIONS:
            continue
        wanted = expected[group.name].reshape(len(same), -1)
        gap = np.abs(np.moveaxis(x, -1, 0).reshape(len(same), -1) - wanted).max(axis=1)
        same &= gap <= tolerance * np.maximum(np.abs(wanted).max(axis=1), 1.0)
    return float(same.mean())


def _times(call: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Median and least wall time of several calls."""
    call()
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return statistics.median(times), min(times)


def markdown(found: dict[str, Any]) -> str:
    """Devices and table."""
    lines = [
        "# Kernels in JAX",
        "",
        f"{found['count']} x {found['device']}; jax {found['jax']}; host: {found['host']['processor']},"
        f" {found['host']['cores']} cores. Times a sample, median and least; agreement: share of the samples"
        " equal to NumPy's.",
        "",
        "| kernel | type | samples | devices | on the devices | with transfers | agreement |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for row in found["rows"]:
        each = [
            " / ".join(time_told(1e9 * x / row["samples"]) for x in row[key]) for key in ("alone", "moved")
        ]
        lines.append(
            f"| `{row['program']}` | {row['dtype']} | {row['samples']:,} | {row['devices']} | {each[0]} |"
            f" {each[1]} | {row['agreement']:.2%} |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.devices", description=__doc__)
    parser.add_argument("--robot", default="bioloid")
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="largest batch")
    parser.add_argument("--quick", action="store_true", help="tiny sizes: does it run, do results agree?")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results")
    asked = parser.parse_args(arguments)
    import jax

    devices = jax.devices()
    robot, rows = sk.load_robot(asked.robot), []
    sizes, rounds = ((16 * len(devices),), 2) if asked.quick else (SIZES, ROUNDS)
    for count in [n for n in sizes if n <= asked.largest] or [asked.largest]:
        for program, given in inputs(robot, count):
            for dtype in TOLERANCE:
                for some in ([devices[0]], devices)[: 1 + (len(devices) > 1)]:
                    rows.append(measured(program, given, dtype, some, rounds))
                    print(_line(rows[-1]), file=sys.stderr)
    found = {
        "device": devices[0].device_kind,
        "count": len(devices),
        "jax": version_of("jax"),
        "host": description(("jax", "jaxlib", "numpy")),
        "rows": [asdict(row) for row in rows],
    }
    asked.output.mkdir(parents=True, exist_ok=True)
    (asked.output / "devices.json").write_text(json.dumps(found, indent=1) + "\n")
    (asked.output / "devices.md").write_text(markdown(found))
    print(markdown(found))
    return 0


def _line(row: Row) -> str:
    """A line for those who wait."""
    told = time_told(1e9 * row.alone[0] / row.samples)
    return f"{row.program}, {row.dtype}, {row.samples:,} samples on {row.devices}: {told} a sample"


if __name__ == "__main__":
    sys.exit(main())
