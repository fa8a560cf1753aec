"""``screwkin zmp``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from screwkin.analysis.account import Account, account_of, recorded_robot
from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, TrajectoryPath
from screwkin.cli.output import aligned, drawn, print_json, progress_bar, remark, say
from screwkin.errors import InputError
from screwkin.model.joint_file import ENDINGS, load_joints
from screwkin.model.table import load_robot
from screwkin.report.names import PAGE, remove_reports
from screwkin.report.numbers import balance_data, balance_numbers
from screwkin.trajectory import Trajectory, load_trajectory


def zmp(
    trajectory: TrajectoryPath,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT", help="Whose joints a .csv or ROS .json file moves; its base and feet follow."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Draw it: pictures and report.html in this folder."
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Recompute CoM, ZMP, margins and spikes from the joints' positions, rates and accelerations.

    A .csv or ROS .json file of joints alone needs --robot: the feet with the lowest soles are taken to stand,
    flat and still; -o then writes trajectory.npz too, which other verbs take. Exit code 3 if the ZMP leaves
    the support polygon.
    """
    loaded = load_trajectory(trajectory) if robot is None else _from_joints(trajectory, robot)
    account = account_of(recorded_robot(loaded, str(trajectory)), loaded)
    if output is not None:
        with output_folder(output, "zmp", account.robot.name) as folder:
            _draw(account, folder)
            if robot is not None:
                loaded.save(folder / "trajectory.npz")
    if as_json:
        places = {} if output is None else {"folder": str(output)}
        data = {"robot": account.robot.name, "samples": loaded.samples, **balance_data(account)}
        print_json({**data, **places})
    else:
        say(f"{trajectory}: {account.robot.name}, {loaded.samples} samples, {loaded.duration:.2f} s")
        say(aligned(balance_numbers(account), "  "))
        for warning in account.warnings:
            remark(f"warning: {warning}")
        if output is not None:
            say(f"files in {output}")
    return 3 if account.outside.any() else 0


def _from_joints(path: Path, name: str) -> Trajectory:
    """The motion of a file of joints alone.

    Raises:
        InputError: another kind of file.
    """
    if path.suffix not in ENDINGS:
        raise InputError(f"--robot goes with files of joints alone, {' and '.join(ENDINGS)}, not with {path}")
    robot = load_robot(name)
    return Trajectory.from_joints(robot, *load_joints(path, robot))


def _draw(account: Account, folder: Path) -> None:
    """The pictures of the balance, and a page that plays the motion."""
    from screwkin.report.page import write_page
    from screwkin.report.pictures import save_balance_pictures

    remove_reports(folder)
    with progress_bar("pictures"):
        pictures = drawn(lambda: save_balance_pictures(account, folder))
    write_page(folder / PAGE, account, pictures)
