"""``screwkin validate``."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder, TrajectoryPath
from screwkin.cli.output import aligned, print_json
from screwkin.cli.replay import replay
from screwkin.cli.simulation import Wish, print_verdict, simulate
from screwkin.cli.simulation import engine as engine_named
from screwkin.errors import OutputError
from screwkin.files import make_folder
from screwkin.report.account import account_of, recorded_robot
from screwkin.report.numbers import validation_numbers
from screwkin.trajectory import load_trajectory


def validate(
    trajectory: TrajectoryPath,
    engine: Annotated[
        str, typer.Option(help="pybullet, or kinematic (no forces; never passes).")
    ] = "pybullet",
    gui: Annotated[bool, typer.Option("--gui", help="Show a window, at the robot's own speed.")] = False,
    video: Annotated[bool, typer.Option("--video", help="Film it: walk.gif.")] = False,
    plots: Annotated[bool, typer.Option(help="Draw the pictures and write the report.")] = True,
    log: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Replay what servos did: the play.npz of a send of it."),
    ] = None,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Simulate a trajectory and give a verdict: validation.json beside it, plots, report.html.

    Without -o all files go beside the trajectory, with --log into replay/ beside the log. Exit code 3 if it
    does not pass; the reasons are told.
    """
    engine_named(engine)
    if log is not None:
        return replay(trajectory, log, Wish(engine, gui, video, plots), output, as_json)
    loaded = load_trajectory(trajectory)
    account = account_of(recorded_robot(loaded, str(trajectory)), loaded)
    beside = _beside(trajectory)
    wish = Wish(
        engine,
        gui,
        video,
        plots,
        _commands(str(loaded.meta.get("command", "")), str(trajectory), engine, video),
    )
    with output_folder(output or beside, "validate", account.robot.name) as folder:
        check = simulate(account, folder, beside / "validation.json", wish)
    if as_json:
        print_json({"robot": account.robot.name, **check.to_dict()})
    else:
        print(f"{trajectory}: {account.robot.name}, {loaded.duration:.2f} s in {check.engine}")
        print(aligned(validation_numbers(check), "  "))
        print_verdict(check)
        print(f"files in {folder}{'' if folder == beside else f'; validation.json in {beside}'}")
    return 0 if check.passed else 3


def _beside(trajectory: Path) -> Path:
    """The trajectory's own folder, where its verdict belongs."""
    try:
        return make_folder(trajectory.parent)
    except OutputError as error:
        why = str(error).removesuffix(" Name another folder.")
        raise OutputError(
            f"validation.json belongs beside {trajectory}: {why} Copy the trajectory to a folder of yours."
        ) from None


def _commands(made: str, trajectory: str, engine: str, video: bool) -> list[str]:
    """The command that made the trajectory, as it recorded it, and this one."""
    words = ["screwkin", "validate", trajectory]
    words += ["--engine", engine] if engine != "pybullet" else []
    words += ["--video"] if video else []
    return [line for line in (made, shlex.join(words)) if line]
