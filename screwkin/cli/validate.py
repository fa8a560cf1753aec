"""``screwkin validate``."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from screwkin.analysis.account import account_of, recorded_robot
from screwkin.analysis.clear_hands import clearing_hand_drop
from screwkin.analysis.engines import AUTO, SimulatedCompliance, confirms, servo_for, servos_in_words
from screwkin.analysis.readiness import VERDICT
from screwkin.analysis.verdict import verdict_from_json, verdict_of
from screwkin.campaign.feedback_bound import WORLDS
from screwkin.cli.feedback_runs import feedback_runs
from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, Perturbed, TrajectoryPath, perturbation_of
from screwkin.cli.output import aligned, print_json, remark, say
from screwkin.cli.replay import replay
from screwkin.cli.simulation import Wish, print_verdict, simulate_to_files
from screwkin.cli.simulation import engine as engine_named
from screwkin.errors import InputError, OutputError
from screwkin.files import LARGEST_TEXT, make_folder, read_file
from screwkin.report.numbers import Number, validation_numbers
from screwkin.sim.compliant import Compliance
from screwkin.sim.perturbation_files import described
from screwkin.trajectory import load_trajectory


def validate(
    trajectory: TrajectoryPath,
    engine: Annotated[
        str,
        typer.Option(
            help="pybullet, mujoco, kinematic (no forces; never passes), or auto: those with forces."
        ),
    ] = "auto",
    gui: Annotated[bool, typer.Option("--gui", help="Show a window, at the robot's own speed.")] = False,
    video: Annotated[bool, typer.Option("--video", help="Film it: walk.gif.")] = False,
    servo: Annotated[
        str,
        typer.Option(
            help="table: motors of the models that the table names; rigid; a servo model, or its file; or "
            "auto: table where the table names models and the commands can allow for them, else rigid."
        ),
    ] = AUTO,
    compliant: Annotated[
        bool, typer.Option("--compliant", help="Springs for servos, commanded at the trajectory's rate.")
    ] = False,
    k: Annotated[
        float | None,
        typer.Option(
            "-k",
            "--stiffness",
            help="Of every spring [N m/rad]; default: what the commands are compensated for, or the table's.",
        ),
    ] = None,
    sole_stiffness: Annotated[
        float | None,
        typer.Option(help="Of every point of contact [N/m], with or without --compliant; default: rigid."),
    ] = None,
    repeat: Annotated[
        bool,
        typer.Option("--repeat", help="With --compliant: also under other frictions and time steps."),
    ] = False,
    check_solver: Annotated[
        bool,
        typer.Option("--check-solver", help="Also at half the step and twice the iterations."),
    ] = False,
    perturb: Perturbed = None,
    feedback: Annotated[
        bool,
        typer.Option("--feedback", help="Walk its steps with the stabiliser, by what the robot feels."),
    ] = False,
    runs: Annotated[
        int,
        typer.Option(help="With --feedback: in so many drawn worlds, for send --feedback: feedback.json."),
    ] = 0,
    worlds: Annotated[
        str, typer.Option(help="With --runs: from what they are drawn, as sweep --perturb takes it.")
    ] = WORLDS,
    seed: Annotated[int, typer.Option(help="With --runs: from which the worlds' seeds follow.")] = 0,
    plots: Annotated[bool, typer.Option(help="Draw the pictures and write the report.")] = True,
    log: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Replay what servos did: the play.npz of a send of it."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder for the files; default: the trajectory's."
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Simulate a trajectory and give a verdict: validation.json, plots, report.html.

    Without -o all files go beside the trajectory, where send looks for the verdict; with --log into replay/
    beside the log. A verdict by contact forces is never replaced by one of an engine without forces. Exit
    code 3 if it does not pass; the reasons are listed.
    """
    engine_named(engine)
    compliance = _compliance(compliant, k, sole_stiffness, repeat, servo)
    if log is not None:
        if compliance != SimulatedCompliance() or servo != AUTO or perturb or feedback:
            raise InputError(
                "--log replays servos that moved; it goes without --servo, --compliant, --sole-stiffness, "
                "--perturb and --feedback"
            )
        return replay(trajectory, log, Wish(engine, check_solver, gui, video, plots), output, as_json)
    if runs:
        if not feedback or perturb or compliance != SimulatedCompliance():
            raise InputError("--runs walks with --feedback in worlds of --worlds, on --servo and --engine")
        return feedback_runs(trajectory, engine, servo, worlds, runs, seed, as_json)
    by = perturbation_of(perturb or [])
    loaded = load_trajectory(trajectory)
    account = account_of(recorded_robot(loaded, str(trajectory)), loaded)
    chosen = servo_for(servo, account.robot, loaded, engine_named(engine), compliance)
    in_words = servos_in_words(servo, account.robot, loaded, engine_named(engine), compliance)
    compliance.on(chosen).for_trajectory(account.robot, loaded)  # refused before anything is written
    destination = _beside(trajectory) if output is None else output
    _spare_verdict(destination / VERDICT, engine)
    words = [
        "screwkin",
        "validate",
        str(trajectory),
        *_changes(engine, servo, compliance, k),
        *(["--check-solver"] * check_solver),
        *(["--feedback"] * feedback),
        *(word for text in described(by) for word in ("--perturb", text)),
        *(["--video"] * video),
    ]
    commands = _commands(str(loaded.meta.get("command", "")), words)
    wish = Wish(engine, check_solver, gui, video, plots, commands, compliance, by, servo, feedback)
    with output_folder(destination, "validate", account.robot.name) as folder:
        check = simulate_to_files(account, folder, folder / VERDICT, wish)
    if as_json:
        print_json({"robot": account.robot.name, **verdict_of(account.robot, loaded, check).to_dict()})
    else:
        say(f"{trajectory}: {account.robot.name}, {loaded.duration:.2f} s in {check.engine}")
        numbers = validation_numbers(check)
        numbers.insert(1, Number("servos", *in_words))
        say(aligned(numbers, "  "))
        print_verdict(check)
        say(f"files in {folder}, {VERDICT} among them{_not_sent(folder, trajectory)}")
    drop = clearing_hand_drop(account.robot, loaded, check.self_collisions or ())
    if drop is not None:
        remark(f"hands that hang higher clear all links: plan the walk with --set hand_drop={drop:g}")
    return 0 if check.passed else 3


def _spare_verdict(path: Path, engine: str) -> None:
    """Refuse to replace a verdict by contact forces by one of an engine that has none."""
    if confirms(engine) or engine == "auto" or not path.is_file():
        return
    try:
        there = verdict_from_json(read_file(path, LARGEST_TEXT).decode())
    except (InputError, OSError, UnicodeError):
        return  # nothing that send would take
    if confirms(there.engine):
        raise InputError(
            f"{path} holds the verdict of {there.engine}, which --engine {engine} cannot replace: it has no "
            "contact forces. Name another folder: -o DIR"
        )


def _not_sent(folder: Path, trajectory: Path) -> str:
    """What is to be known of a verdict that does not lie beside its trajectory."""
    if folder.resolve() == trajectory.parent.resolve():
        return ""
    return f"; send goes by the one in {trajectory.parent}"


def _beside(trajectory: Path) -> Path:
    """The trajectory's own folder, where its verdict belongs."""
    try:
        return make_folder(trajectory.parent)
    except OutputError as error:
        why = str(error).removesuffix(" Name another folder.")
        raise OutputError(
            f"validation.json belongs beside {trajectory}: {why} Copy the trajectory to a folder of yours."
        ) from None


def _compliance(
    compliant: bool, k: float | None, sole_stiffness: float | None, repeat: bool, servo: str
) -> SimulatedCompliance:
    """The compliance that a command line asks for."""
    if not compliant and (repeat or k is not None):
        option, instead = (
            "--repeat" if repeat else "--stiffness",
            "" if servo == AUTO else " instead of --servo",
        )
        raise InputError(f"{option} is of elastic servos; add --compliant{instead}")
    return SimulatedCompliance(Compliance(k) if compliant else None, sole_stiffness, repeat)


def _changes(engine: str, servo: str, compliance: SimulatedCompliance, k: float | None) -> list[str]:
    """The options that ask for another simulation than the usual one."""
    words = ["--engine", engine] if engine != "auto" else []
    words += ["--servo", servo] if servo != AUTO else []
    words += ["--compliant"] if compliance.servos is not None else []
    words += [] if k is None else ["--stiffness", f"{k:g}"]
    words += (
        [] if compliance.sole_stiffness is None else ["--sole-stiffness", f"{compliance.sole_stiffness:g}"]
    )
    return words + (["--repeat"] if compliance.repeat else [])


def _commands(planned: str, words: Sequence[str]) -> list[str]:
    """The command that planned the trajectory, as recorded in it, and this one."""
    return [line for line in (planned, shlex.join(words)) if line]
