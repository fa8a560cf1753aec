"""``screwkin walk``."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from screwkin.analysis.account import Account, account_of
from screwkin.anatomy.humanoid import anatomy
from screwkin.cli.compensated import CompensateBy, Passes, ServoStiffness, compensated, remedy
from screwkin.cli.folder import output_folder
from screwkin.cli.options import (
    AsJson,
    FittingGait,
    GaitName,
    OutputFolder,
    RobotName,
    numbers_of,
    refuse_together,
    settings,
)
from screwkin.cli.output import aligned, drawn, print_json, progress_bar, remark, say
from screwkin.errors import InputError, NoSolutionError
from screwkin.files import atomic_write
from screwkin.gait.files import default_gait, load_gait
from screwkin.gait.fitting import fitting_gait
from screwkin.gait.goals import load_curve, steps_along, steps_to
from screwkin.gait.listed import Footsteps, load_footsteps, with_footsteps
from screwkin.gait.plan import whole_steps
from screwkin.gait.record import Gait, Side
from screwkin.gait.stand import Place, stand
from screwkin.gait.walk import walk as walk_of
from screwkin.gait.write import gait_toml
from screwkin.model.dh_robot import refuse_dh
from screwkin.model.robot import Robot, robot_text
from screwkin.model.table import load_robot
from screwkin.report.names import PAGE, remove_reports
from screwkin.report.numbers import walk_data, walk_numbers

TO_FIT = "; or fit a gait to the robot: --auto"
"""What ends the refusal of a walk whose gait nobody chose."""


def walk(
    robot: RobotName,
    gait: GaitName = None,
    auto: FittingGait = False,
    steps: Annotated[int | None, typer.Option(help="Number of steps; default: the gait's.")] = None,
    list_of_steps: Annotated[
        Path | None,
        typer.Option(
            "--footsteps",
            metavar="FILE",
            help="A CSV file of footholds: x, y [m], yaw [rad], perhaps z [m] and foot; right foot first.",
        ),
    ] = None,
    goals: Annotated[
        list[str] | None,
        typer.Option("--goal", metavar="X,Y,YAW", help="Go there [m, rad], and on to the next if repeated."),
    ] = None,
    places: Annotated[
        list[str] | None,
        typer.Option(
            "--stand",
            metavar="X,Y,Z,SECONDS",
            help="No steps: the waist goes there from home [m, s], on to the next if repeated, and home.",
        ),
    ] = None,
    curve: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A CSV file of points to follow: x, y [m].")
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a parameter of the gait; may be repeated."),
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Samples per second; default: the gait's.")] = None,
    com: Annotated[
        str | None,
        typer.Option(metavar="true|waist", help="What a preview gait steers: the CoM or the waist."),
    ] = None,
    compensate: CompensateBy = None,
    passes: Passes = None,
    k: ServoStiffness = None,
    plots: Annotated[bool, typer.Option(help="Draw the pictures and write the report.")] = True,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Plan the trajectory of a gait: trajectory.npz, trajectory.csv, plots and report.html.

    With --compensate also compensated/trajectory.npz, the commands for compliant servos, beside the plan.
    Exit code 3 if a limb cannot reach, is singular or beyond a limit; the message names limb and time. A ZMP
    outside the support polygon is a warning; the trajectory is written all the same. Walks over footsteps, to
    goals and along curves begin and end at home (--set lead=0: they do not).
    """
    refuse_together({"--auto": auto, "--gait": gait})
    refuse_dh(robot, "a walk")
    table = load_robot(robot)
    if auto and not table.limbs:
        table = limbed(table)
    wanted = remedy(table, compensate, passes, k)
    assignments = [*(assignments or []), *([] if com is None else [f"com={com}"])]
    where = _where_to(list_of_steps, goals or [], curve, places or [])
    name = gait or (stepping_gait(table.name) if where else default_gait(table.name))
    chosen = changed(fitting_gait(table) if auto else load_gait(name), assignments, rate)
    if where and not places:
        first = chosen.first if "first" in settings(assignments) else None
        chosen = with_footsteps(chosen, _steps(table, chosen, first, list_of_steps, goals or [], curve))
    if places and steps is not None:
        raise InputError("--stand makes no steps; leave --steps out")
    steps = 0 if places else whole_steps(chosen.steps if steps is None else steps)
    command = command_of(robot, None if auto else name, steps, assignments, rate, where)
    with output_folder(output, "walk", table.name) as folder:
        with advice_to_fit(default=not (auto or gait or where)):
            account, remedied = _planned(table, chosen, steps, command, _places(places or [])), None
        if wanted is not None:
            command = shlex.join([*shlex.split(command), *wanted.words])
            remedied = compensated(table, account.trajectory, wanted, command, folder)
        _save(account, folder)
        if auto:
            write_auto(table, chosen, folder)
        if remedied is not None:
            remedied.save()
        if plots:
            write_report(account, folder)
    if as_json:
        extra = {} if remedied is None else {"compensation": remedied.to_dict()}
        used = chosen.to_dict() if auto else chosen.name
        print_json({**walk_data(account), "gait": used, "folder": str(folder), **extra})
    else:
        _print_summary(account, chosen, folder)
        if remedied is not None:
            say(remedied.text())
    return 0


@contextmanager
def advice_to_fit(default: bool) -> Iterator[None]:
    """Where nobody chose the gait, and the robot cannot walk it: one may be fitted to the robot."""
    try:
        yield
    except (NoSolutionError, InputError) as error:
        if default:
            error.args = (f"{error}{TO_FIT}", *error.args[1:])
        raise


def stepping_gait(robot: str) -> str:
    """The gait that steps onto listed footholds if none is chosen: the robot's own, if its kind can.

    Bundled gaits of robots' own follow their feet; the gait of all others is moved by key points.
    """
    own = default_gait(robot)
    return "auto" if own == default_gait("") else own


def _places(texts: Sequence[str]) -> list[Place]:
    """Places of ``--stand``."""
    write = "three lengths in m and a time in s, as 0,0,-0.02,1"
    rows = (numbers_of(text, "--stand", (4,), "place", write) for text in texts)
    return [(x, y, z, seconds) for x, y, z, seconds in rows]


def _where_to(
    footsteps: Path | None, goals: Sequence[str], curve: Path | None, places: Sequence[str]
) -> list[str]:
    """The words of the command line that say where a walk goes; none: as the gait does.

    Raises:
        InputError: several ways of saying so.
    """
    ways = {"--footsteps": footsteps, "--goal": goals, "--curve": curve, "--stand": places}
    given = [option for option, value in ways.items() if value]
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} each say where the walk goes; give one of them")
    if goals or places:
        return [*(f"--goal={goal}" for goal in goals), *(f"--stand={place}" for place in places)]
    return [word for option in given for word in (option, str(ways[option]))]


def _steps(
    robot: Robot,
    gait: Gait,
    first: Side | None,
    footsteps: Path | None,
    goals: Sequence[str],
    curve: Path | None,
) -> Footsteps:
    """The list of footsteps that the command line asks for, ``first`` the foot that it says swings first."""
    if footsteps is not None:
        return load_footsteps(footsteps, first)
    if curve is not None:
        return steps_along(robot, gait, load_curve(curve))
    write = "two lengths in m and an angle in rad, as 0.5,0.2,1.57"
    return steps_to(robot, gait, *(numbers_of(goal, "--goal", (3,), "goal", write) for goal in goals))


def chosen_gait(name: str, assignments: Sequence[str], rate: float | None) -> Gait:
    """The gait of that name with what the command line changes of it."""
    return changed(load_gait(name), assignments, rate)


def changed(gait: Gait, assignments: Sequence[str], rate: float | None) -> Gait:
    """The gait with what the command line changes of it."""
    changes: dict[str, str | float] = {**settings(list(assignments))}
    if rate is not None:
        changes["rate"] = rate
    return gait.replace(**changes) if changes else gait


def limbed(robot: Robot) -> Robot:
    """The robot with limbs, soles and home found from its geometry, and a remark on stderr for each."""
    found = anatomy(robot)
    for text in (*map(str, found.findings), *found.remarks):
        remark(text)
    return found.robot


def write_auto(robot: Robot, gait: Gait, folder: Path) -> None:
    """The gait that was chosen and the robot that walks it, as files that ``walk`` takes."""
    for name, text in (("auto.toml", gait_toml(gait)), ("robot.toml", robot_text(robot))):
        with atomic_write(folder / name) as file:
            file.write(text)


def command_of(
    robot: str,
    gait: str | None,
    steps: int,
    assignments: Sequence[str],
    rate: float | None,
    where: Sequence[str] = (),
) -> str:
    """The command line that plans the same trajectory again, wherever its files go."""
    words = ["screwkin", "walk", robot, *(["--auto"] if gait is None else ["--gait", gait])]
    words += [*(["--steps", str(steps)] if steps else []), *where]
    words += [word for text in assignments for word in ("--set", text)]
    words += [] if rate is None else ["--rate", f"{rate:g}"]
    return shlex.join(words)


def make_trajectory(robot: Robot, gait: Gait, steps: int, command: str, folder: Path) -> Account:
    """Plan a trajectory and write it as ``.npz`` and ``.csv``."""
    account = _planned(robot, gait, steps, command)
    _save(account, folder)
    return account


def _planned(robot: Robot, gait: Gait, steps: int, command: str, places: Sequence[Place] = ()) -> Account:
    with progress_bar("walk") as done:
        if places:
            trajectory = stand(robot, gait, *places, command=command)
        else:
            trajectory = walk_of(robot, gait, steps, command)
        done(0.5)
        return account_of(robot, trajectory)


def _save(account: Account, folder: Path) -> None:
    remove_reports(folder)
    for ending in ("npz", "csv"):
        account.trajectory.save(folder / f"trajectory.{ending}")


def write_report(account: Account, folder: Path) -> Path:
    """Draw all pictures and write the page."""
    from screwkin.report.page import write_page
    from screwkin.report.pictures import save_pictures

    with progress_bar("pictures") as done:
        pictures = drawn(lambda: save_pictures(account, folder, progress=done))
    return write_page(folder / PAGE, account, pictures)


def _print_summary(account: Account, gait: Gait, folder: Path) -> None:
    what = f"walks {account.steps} steps" if account.steps else "stands, with the arms"
    first = f", the {gait.first} foot first" if account.steps and gait.places else ""
    say(f"{account.robot.name} {what} of gait {gait.name}{first}")
    say(aligned(walk_numbers(account), "  "))
    for warning in account.warnings:
        remark(f"warning: {warning}")
    if account.outside.any():
        remark(
            "warning: the ZMP leaves the support polygon: on the floor the robot would tip over "
            "(see screwkin validate)"
        )
    say(f"files in {folder}: {', '.join(sorted(path.name for path in folder.iterdir() if path.is_file()))}")
