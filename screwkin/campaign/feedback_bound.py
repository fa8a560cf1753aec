"""How far a walk with feedback may come from its plan on a robot: as far as it did where it stood.

A campaign of simulations says it, and its record ``feedback.json`` stands beside the trajectory. Nothing in
it is believed that can be computed anew.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from screwkin.analysis.engines import Engine, confirms
from screwkin.analysis.validate import validate
from screwkin.analysis.verdict import VERSIONED, Verdict, bound_to
from screwkin.campaign.world import world_along
from screwkin.errors import InputError, SafetyError
from screwkin.files import LARGEST_TEXT, read_file, read_json, text_sha256, versions
from screwkin.model.robot import Robot, robot_text
from screwkin.stabiliser.law import Gains
from screwkin.trajectory import Trajectory

BOUND = "feedback.json"
WORLDS = "x1 imu_bias~0.02 imu_noise=0.002 sense_lag=0.02 cells=0"
"""The usual spread, for a robot without force cells whose senses are two cycles late."""
LEAST_RUNS = 20
"""Runs of which none may fall: of twenty, 16 % is what 95 % of campaigns exclude."""
FARTHEST = 0.6
"""How far a joint may come from its plan, whatever a campaign says [rad]."""


@dataclass(frozen=True)
class FeedbackBound:
    """A campaign of a walk with feedback.

    worlds: as ``sweep --perturb`` takes them; seeds: of the runs; falls: how many fell; deviation: by joint,
    how far commands came from the plan's in runs that stood [rad]; gains: of the stabiliser; hashes and servo
    as in a verdict.
    """

    trajectory_sha256: str
    robot_sha256: str
    servo: str
    motors_sha256: str
    engine: str
    worlds: str
    seeds: tuple[int, ...]
    falls: int
    deviation: dict[str, float]
    gains: dict[str, Any]
    versions: dict[str, str]

    __pydantic_config__ = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    def to_json(self) -> str:
        """Its file."""
        return json.dumps(asdict(self), indent=2, sort_keys=True) + "\n"


def feedback_bound(
    robot: Robot,
    trajectory: Trajectory,
    seeds: Sequence[int],
    engine: Engine,
    servo: str,
    worlds: str = WORLDS,
    progress: Callable[[float], None] = lambda share: None,
) -> FeedbackBound:
    """Walk with feedback in the worlds of seeds.

    Raises:
        InputError: an engine that simulates no forces, or a walk that no stabiliser walks.
    """
    if not confirms(engine):
        raise InputError(f"engine {engine} simulates no falls; take mujoco or pybullet")
    farthest, on, falls = dict.fromkeys(robot.joint_names, 0.0), servo, 0
    for k, seed in enumerate(seeds):
        world = world_along(worlds, robot, seed, trajectory)
        check = validate(robot, trajectory, engine, servo=servo, perturbation=world, feedback=True)
        on, came = check.servo, check.engine_settings[engine]["feedback"]["deviation"]
        falls += check.fell
        if not check.fell:
            farthest = {name: max(far, came[name]) for name, far in farthest.items()}
        progress((k + 1) / len(seeds))
    return FeedbackBound(
        trajectory_sha256=trajectory.sha256,
        robot_sha256=text_sha256(robot_text(robot)),
        servo=on,
        motors_sha256=bound_to(robot, trajectory, on)["motors_sha256"],
        engine=engine,
        worlds=worlds,
        seeds=tuple(seeds),
        falls=falls,
        deviation=farthest,
        gains=_gains(),
        versions={name: text for name, text in versions(*VERSIONED).items() if text != "unknown"},
    )


def bound_beside(path: Path, robot: Robot, verdict: Verdict) -> FeedbackBound:
    """The record beside a trajectory that may be sent, if it lets it be walked with feedback.

    Raises:
        SafetyError: there is none, runs fell or were too few, or it is of something else.
    """
    beside = path.parent / BOUND
    do = f"Run: screwkin validate {path} --feedback --runs {LEAST_RUNS}"
    try:
        data = read_json(read_file(beside, LARGEST_TEXT).decode())
        bound = TypeAdapter(FeedbackBound).validate_json(json.dumps(data))
    except FileNotFoundError:
        raise SafetyError(f"{path} was never walked with feedback: there is no {beside}. {do}") from None
    except (OSError, UnicodeError, InputError, ValidationError) as error:
        first = str(error).splitlines()[0]
        raise SafetyError(f"{beside} is no record of this version: {first}. {do}") from None
    if faults := [*bound_faults(bound, robot, verdict)]:
        raise SafetyError(f"{beside} does not let it be walked with feedback: {'; '.join(faults)}. {do}")
    return bound


def bound_faults(bound: FeedbackBound, robot: Robot, verdict: Verdict) -> list[str]:
    """What speaks against walking with feedback after that campaign."""
    same: Mapping[str, tuple[object, object]] = {
        "the trajectory": (bound.trajectory_sha256, verdict.trajectory_sha256),
        "the robot's table": (bound.robot_sha256, verdict.robot_sha256),
        "the servos": (bound.servo, verdict.servo),
        "the servos' figures": (bound.motors_sha256, verdict.motors_sha256),
        "the gains": (bound.gains, _gains()),
        "the joints": (sorted(bound.deviation), sorted(robot.joint_names)),
    }
    faults = [f"{what} changed since" for what, (then, now) in same.items() if then != now]
    if len({*bound.seeds}) < LEAST_RUNS:
        faults.append(f"{len({*bound.seeds})} runs, at least {LEAST_RUNS}")
    if bound.falls:
        faults.append(f"{bound.falls} of {len(bound.seeds)} runs fell")
    if not confirms(bound.engine):
        faults.append(f"engine {bound.engine} simulates no falls")
    far = max(bound.deviation.values(), default=0.0)
    if not 0.0 < far <= FARTHEST:
        faults.append(f"a joint came {far:.2f} rad from its plan, at most {FARTHEST:g}")
    return faults


def _gains() -> dict[str, Any]:
    gains: dict[str, Any] = json.loads(json.dumps(asdict(Gains())))
    return gains
