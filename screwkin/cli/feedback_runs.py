"""``validate --feedback --runs``: how far a walk with feedback may come from its plan."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from screwkin.analysis.account import recorded_robot
from screwkin.analysis.engines import servo_for
from screwkin.campaign.feedback_bound import BOUND, LEAST_RUNS, feedback_bound
from screwkin.campaign.plan import seeds_from
from screwkin.campaign.statistics import wilson
from screwkin.campaign.world import check_world
from screwkin.cli.output import print_json, progress_bar, say
from screwkin.cli.simulation import engine as engine_named
from screwkin.errors import InputError
from screwkin.files import atomic_write
from screwkin.trajectory import load_trajectory

_FASTER = "mujoco"


def feedback_runs(
    path: Path, engine: str, servo: str, worlds: str, runs: int, seed: int, as_json: bool
) -> int:
    """Walk a trajectory with feedback in drawn worlds, and write ``feedback.json`` beside it.

    Args:
        path: of the trajectory.
        engine: ``auto`` is MuJoCo.
        servo: as ``validate`` takes it.
        worlds: as ``sweep --perturb`` takes them.
        runs: how many.
        seed: from which their seeds follow.
        as_json: print JSON.

    Returns:
        int: 0 if no run fell and they are enough for ``send``, else 3.
    """
    if runs < 1:
        raise InputError(f"--runs {runs}: expected a whole number, at least 1")
    trajectory = load_trajectory(path)
    robot = recorded_robot(trajectory, str(path))
    check_world(worlds, robot)
    chosen = engine_named(_FASTER if engine == "auto" else engine)
    on = str(servo_for(servo, robot, trajectory, chosen))
    with progress_bar("walking") as progress:
        bound = feedback_bound(robot, trajectory, seeds_from(seed, runs), chosen, on, worlds, progress)
    beside = path.parent / BOUND
    with atomic_write(beside) as file:
        file.write(bound.to_json())
    far = max(bound.deviation, key=lambda name: bound.deviation[name])
    low, high = wilson(bound.falls, runs) or (0.0, 1.0)
    if as_json:
        print_json(asdict(bound) | {"runs": runs, "interval": [low, high], "bound": bound.deviation[far]})
    else:
        say(
            f"{path}: {robot.name} on {bound.servo} in {chosen}, worlds {worlds}\n"
            f"{bound.falls} of {runs} runs fell ({100 * low:.1f} to {100 * high:.1f} %); "
            f"a joint came at most {bound.deviation[far]:.3f} rad from its plan ({far})\n"
            f"written: {beside}"
        )
        if runs < LEAST_RUNS:
            say(f"send --feedback asks for {LEAST_RUNS} runs at least")
    return 0 if bound.falls == 0 and runs >= LEAST_RUNS else 3
