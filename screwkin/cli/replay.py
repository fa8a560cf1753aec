"""``screwkin validate --log``: what servos did, simulated."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np

from screwkin.analysis.account import account_of, recorded_robot
from screwkin.analysis.replay import replayed
from screwkin.analysis.validate import Validation
from screwkin.analysis.verdict import Criteria
from screwkin.cli.folder import output_folder
from screwkin.cli.output import aligned, print_json, remark, say
from screwkin.cli.simulation import Wish, print_verdict, simulate_to_files
from screwkin.report.numbers import validation_numbers
from screwkin.report.pictures import save_servo_pictures
from screwkin.servo.log import load_log
from screwkin.trajectory import load_trajectory

VERDICT = "replay.json"


def replay(trajectory: Path, log: Path, wish: Wish, output: Path | None, as_json: bool) -> int:
    """Simulate the joints as a log has them, and judge it against the trajectory that was sent.

    Writes replay.json, pictures and report.html into the folder ``replay`` beside the log; the verdict that
    ``send`` asks for is not touched. The motors of the simulation enforce what was measured, so their torque
    is reported, but not judged.
    """
    loaded, played = load_trajectory(trajectory), load_log(log)
    robot = recorded_robot(loaded, str(trajectory))
    planned, motion = replayed(robot, loaded, played)
    account = account_of(robot, planned)
    away = float(np.degrees(np.abs(motion.q - planned.q).max()))
    facts = {
        "log": str(log),
        "replayed_s": planned.duration,
        "duration_s": loaded.duration,
        "max_deviation_deg": away,
    }
    words = ["screwkin", "validate", str(trajectory), "--log", str(log)]
    commands = [str(loaded.meta.get("command", "")), shlex.join(words)]
    with output_folder(output or log.parent / "replay", "validate", robot.name) as folder:
        wish = replace(
            wish,
            commands=[line for line in commands if line],
            motion=motion,
            criteria=Criteria(torque_share=np.inf),
            more=lambda check: lambda: save_servo_pictures(account, folder, played),
        )
        check = simulate_to_files(account, folder, folder / VERDICT, wish)
    if planned.samples < loaded.samples:
        remark(
            f"warning: the log ends at {planned.duration:.2f} of {loaded.duration:.2f} s: judged up to there"
        )
    if as_json:
        print_json({"robot": robot.name, **facts, **check.to_dict()})
    else:
        _print(check, facts, folder)
    return 0 if check.passed else 3


def _print(check: Validation, facts: dict[str, object], folder: Path) -> None:
    say(
        f"{facts['log']}: joints as measured, {facts['replayed_s']:.2f} s in {check.engine}; up to "
        f"{facts['max_deviation_deg']:.1f} deg from the plan"
    )
    say(aligned(validation_numbers(check), "  "))
    print_verdict(check)
    say(f"files in {folder}")
