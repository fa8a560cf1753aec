"""The screw model of a robot against its Denavit-Hartenberg model: the same motion, at what cost.

Three ways are run on the same joint positions in the same call: DH frames, the textbook's product of screw
displacements, and the chain that the library itself runs. Nothing is taken from the literature.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import Pose, as_array, leaves, pose_from_array, rotation_log
from screwkin.analysis.chains import ModelChain, by_dh, by_screws, chains_of, support_models
from screwkin.analysis.misalignment import Misalignment, misalignment, sensitivity
from screwkin.analysis.operations import model_program, models_of, operations
from screwkin.compiler.program import Program
from screwkin.compiler.run import run
from screwkin.errors import InputError
from screwkin.mechanism.scaling import characteristic_length
from screwkin.model.dh import DHTable, dh_fk
from screwkin.model.robot import Robot, refuse_coupled

BATCH = 200
"""Joint positions per evaluation when times are measured: small enough for memory to play no part."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Screws against DH.

    Attributes:
        robot: name of the robot.
        chains: the compared chains, with their tables.
        samples: random joint positions compared.
        fk_max_abs: largest difference of an entry of a tip's pose, all supporting feet included [1 and m].
        jacobian_max_abs: largest difference of an entry of a chain's Jacobian at the base origin.
        dh_models: sets of DH tables that a walk needs with the standing foot as base: one per leg.
        screw_models: sets of screws that it needs.
        dh_jacobians: separate Jacobians: base in the world (if it floats), and each chain.
        screw_jacobians: the one network matrix of the closed mechanism.
        parameters: numbers that the tables hold (see ``_parameters``).
        operations: arithmetic operations by way of computing (see ``operations.operations``).
        seconds: processor time of all tips and Jacobians for 200 positions [s], by way, each compiled to a
            program as the library's own quantities are: the median of alternating rounds.
        speed_ratio: time by DH over time by the textbook's screws; above 1 screws are faster.
        speed_ratio_library: time by DH over time by the library's own chain.
        sensitivity: change of a model's numbers per change of its axes.
        jacobian_condition: of each chain at home, with velocities divided by the robot's size.
        misalignment: what a tilt of parallel axes does; None without parallel axes.
    """

    robot: str
    chains: tuple[ModelChain, ...]
    samples: int
    fk_max_abs: float
    jacobian_max_abs: float
    dh_models: int
    screw_models: int
    dh_jacobians: int
    screw_jacobians: int
    parameters: Mapping[str, int]
    operations: Mapping[str, Mapping[str, int]]
    seconds: Mapping[str, float]
    speed_ratio: float
    speed_ratio_library: float
    sensitivity: Mapping[str, float]
    jacobian_condition: Mapping[str, float]
    misalignment: Misalignment | None

    def to_dict(self) -> dict[str, Any]:
        """Everything as JSON data; every chain with its DH rows.

        The library's chain stands there under its former name too: ``screw_by_steps``, ``_by_steps``.
        """
        plain = {name: value for name, value in vars(self).items() if name not in ("chains", "misalignment")}
        for name in ("operations", "seconds"):
            plain[name] = {**plain[name], "screw_by_steps": plain[name]["library"]}
        plain["speed_ratio_by_steps"] = self.speed_ratio_library
        tables = {
            chain.name: {
                "convention": chain.table.convention,
                "printed": chain.printed,
                "rows": [asdict(row) for row in chain.table.rows],
            }
            for chain in self.chains
        }
        series = None if self.misalignment is None else dict(vars(self.misalignment))
        return {**plain, "tables": tables, "misalignment": series}


def compare_models(robot: Robot, samples: int = 1000, rounds: int = 21, seed: int = 0) -> Comparison:
    """Compare the screw model of a robot with its DH model.

    Args:
        robot: the robot; without limbs, the chains to its outermost links are compared.
        samples: random joint positions, within the limits where there are any.
        rounds: alternating time measurements.
        seed: of the random numbers.

    Raises:
        InputError: samples or rounds below 1; no joints; a helical joint, which DH tables cannot hold.
    """
    if samples < 1 or rounds < 1:
        raise InputError(f"samples {samples} and rounds {rounds} must be at least 1")
    chains = chains_of(robot)
    for chain in chains:
        refuse_coupled(
            robot, chain.joints, "compare", "compare the robot with its coupled joints read as free"
        )
    models = support_models(robot, chains)
    rng, length = np.random.default_rng(seed), characteristic_length(robot)
    q = random_positions(robot, samples, rng)
    fk, jacobian = largest_differences(chains, models, q)
    times = _times(chains, random_positions(robot, BATCH, rng), rounds)
    return Comparison(
        robot=robot.name,
        chains=chains,
        samples=samples,
        fk_max_abs=fk,
        jacobian_max_abs=jacobian,
        dh_models=max(1, len(models)),
        screw_models=1,
        dh_jacobians=len(chains) + (robot.base == "floating"),
        screw_jacobians=1,
        parameters=_parameters(chains, max(1, len(models))),
        operations=operations(chains),
        seconds=times,
        speed_ratio=times["dh"] / times["screw"],
        speed_ratio_library=times["dh"] / times["library"],
        sensitivity=sensitivity(chains, length, seed=seed),
        jacobian_condition=_conditions(robot, chains, length),
        misalignment=misalignment(chains, seed=seed),
    )


def random_positions(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Joint positions (count, n) within the limits, and within half a turn or half a metre."""
    span = [0.5 if joint.type == "prismatic" else math.pi for joint in robot.joints]
    lower = [max(joint.lower, -s) for joint, s in zip(robot.joints, span, strict=True)]
    upper = [min(joint.upper, s) for joint, s in zip(robot.joints, span, strict=True)]
    return rng.uniform(lower, np.maximum(lower, upper), (count, len(robot.joints)))


def _of(chain: ModelChain, q: Array) -> list[Array]:
    """The positions of a chain's joints, batch by joint."""
    return [q[..., i] for i in chain.joints]


def largest_differences(
    chains: Sequence[ModelChain], models: Mapping[str, Sequence[DHTable]], q: Array
) -> tuple[float, float]:
    """Largest difference of an entry of tip poses and of Jacobians between the models [1 and m].

    Args:
        chains: of the robot.
        models: the DH tables of a walk by standing leg, from ``support_models``.
        q: (samples, n) positions of all joints [rad or m].
    """
    fk, jacobian, tips = 0.0, 0.0, dict[str, Pose]()
    for chain in chains:
        tip, columns = by_screws(chain.screws, chain.frame, _of(chain, q))
        other_tip, other_columns = by_dh(chain.table, _of(chain, q))
        fk = max(fk, _apart(tip, other_tip))
        jacobian = max(jacobian, *(_apart(a, b) for a, b in zip(columns, other_columns, strict=True)))
        tips[chain.name] = tip
    by_name = {chain.name: chain for chain in chains}
    for standing, (upwards, *others) in models.items():
        base = dh_fk(upwards, _of(by_name[standing], q)[::-1])
        fk = max(fk, _apart(tips[standing].inverse, base))
        for table in others:
            reached = base @ dh_fk(table, _of(by_name[table.name], q))
            fk = max(fk, _apart(tips[standing].inverse @ tips[table.name], reached))
    return fk, jacobian


def _apart(a: Any, b: Any) -> float:
    return float(np.abs(as_array(a) - as_array(b)).max())


def _times(chains: Sequence[ModelChain], q: Array, rounds: int) -> dict[str, float]:
    """Seconds of an evaluation of all chains by way: medians of rounds in which the ways take turns."""
    tasks: dict[str, list[tuple[Program, Array]]] = {}
    for chain in chains:
        values = np.ascontiguousarray(q[:, list(chain.joints)])
        for way, model in models_of(chain).items():
            tasks.setdefault(way, []).append((model_program(model, len(chain.joints)), values))
    times: dict[str, list[float]] = {way: [] for way in tasks}
    for k in range(rounds + 1):
        for way in (*list(tasks)[k % 3 :], *list(tasks)[: k % 3]):
            begin = time.thread_time()
            for program, values in tasks[way]:
                run(program, {"q": values})
            if k > 0:  # the first round warms up
                times[way].append(time.thread_time() - begin)
    return {way: float(np.median(each)) for way, each in times.items()}


def _parameters(chains: Sequence[ModelChain], models: int) -> dict[str, int]:
    """Numbers in the tables.

    ``dh``: four per joint and six for base and tool of every chain, in every model; ``dh_per_model``;
    ``screws``: six per joint (s and s0) and six per tip; ``dh_not_zero`` and ``screw_not_zero``: those of one
    model that are not 0. The least that determine a chain of n revolute joints are 4 n + 6: screws hold two
    more per joint, the length of s and the place of s0 along it.
    """
    rows = [row for chain in chains for row in chain.table.rows]
    ends = [pose for chain in chains for pose in (chain.table.base, chain.table.tool)]
    joints = {i: screw for chain in chains for i, screw in zip(chain.joints, chain.screws, strict=True)}
    per_model = 4 * len(rows) + 6 * len(chains)
    dh = [x for row in rows for x in (row.alpha, row.a, row.d, row.offset)]
    dh += [x for pose in ends for x in _six(pose)]
    screw = [x for one in joints.values() for x in (*one.s, *one.s0)]
    screw += [x for chain in chains for x in _six(chain.frame)]
    return {
        "dh": models * per_model,
        "dh_per_model": per_model,
        "screw": 6 * len(joints) + 6 * len(chains),
        "dh_not_zero": sum(abs(x) > 1e-12 for x in dh),
        "screw_not_zero": sum(abs(x) > 1e-12 for x in screw),
    }


def _six(pose: Pose) -> list[float]:
    """Position and rotation vector."""
    return [float(x) for x in (*pose.p, *leaves(rotation_log(pose_from_array(as_array(pose)).R)))]


def _conditions(robot: Robot, chains: Sequence[ModelChain], length: float) -> dict[str, float]:
    """Condition number of every chain's Jacobian at the tip, in posture ``home`` or else at zero."""
    home = next(
        (posture.q for posture in robot.postures if posture.name == "home"), (0.0,) * len(robot.joints)
    )
    condition = {}
    for chain in chains:
        tip, columns = by_screws(chain.screws, chain.frame, [home[i] for i in chain.joints])
        J = as_array([at(tip.p, column) for column in columns]).T / np.array([[1]] * 3 + [[length]] * 3)
        sigma = np.linalg.svd(J, compute_uv=False)
        condition[chain.name] = float(sigma[0] / sigma[-1]) if sigma[-1] > 1e-12 * sigma[0] else math.inf
    return condition
