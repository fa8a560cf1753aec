"""``screwkin sweep``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from screwkin.analysis import engines
from screwkin.analysis.engines import SimulatedCompliance
from screwkin.analysis.verdict import VERSIONED
from screwkin.campaign.optimum import Search
from screwkin.campaign.outcome import Outcome
from screwkin.campaign.plan import (
    CONDITIONS,
    OFF,
    ON,
    Axes,
    Campaign,
    axis_values,
    check_rows,
    load_seeds,
    seeds_from,
)
from screwkin.campaign.row import gait_of, played_row
from screwkin.campaign.run import Workers, local_workers, outcomes
from screwkin.campaign.sheet import finished_rows, rows_arrays, rows_csv, settings_csv
from screwkin.campaign.statistics import Paired, Tally, comparisons, tallies, tally
from screwkin.campaign.store import Journal, journal
from screwkin.campaign.world import AS_PLANNED, check_world
from screwkin.cli.folder import output_folder
from screwkin.cli.options import (
    AsJson,
    FittingGait,
    GaitName,
    OutputFolder,
    RobotName,
    refuse_together,
    settings,
)
from screwkin.cli.output import aligned, drawn, print_json, progress_bar, remark, say
from screwkin.cli.simulation import engine as engine_named
from screwkin.cli.sweep_optimise import bounds_of, optimise
from screwkin.cli.walk import TO_FIT, advice_to_fit, limbed, stepping_gait
from screwkin.errors import GaitError, InputError, near, one_of
from screwkin.files import atomic_write, atomic_write_bytes, npz_bytes, versions
from screwkin.gait.files import default_gait, load_gait
from screwkin.gait.fitting import fitting_gait
from screwkin.gait.listed import Footsteps, load_footsteps, with_footsteps
from screwkin.gait.record import Gait
from screwkin.gait.stance import stance_of
from screwkin.model.robot import Robot, robot_text
from screwkin.model.table import load_robot

AUTO = "--auto"
"""The gait that fits the robot, as the axis ``gait`` names it."""
SHOWN = 40
"""Settings that are printed; all of them stand in settings.csv."""


def sweep(
    robot: RobotName,
    gait: GaitName = None,
    auto: FittingGait = False,
    list_of_steps: Annotated[
        Path | None,
        typer.Option("--footsteps", metavar="FILE", help="As of walk: every row walks over these footholds."),
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUES",
            help="A parameter of the gait, or gait, engine, servo, feedback, perturb: FROM:TO:STEP, a list "
            "A,B, or one value; may be repeated, for a grid.",
        ),
    ] = None,
    runs: Annotated[int | None, typer.Option(help="Runs of every setting; default: 1.")] = None,
    seed: Annotated[
        int | None, typer.Option(help="What the seeds of the runs follow from; default: 0.")
    ] = None,
    seeds: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The seeds themselves, one a line, instead of --runs and --seed."),
    ] = None,
    perturb: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WORDS",
            help="Worlds other than the planned one, drawn from the seed: x1, or x3 for thrice as far; "
            "KEY~VALUE draws a figure, KEY=VALUE is as of validate; may be repeated.",
        ),
    ] = None,
    engine: Annotated[str | None, typer.Option(help="As of validate; default: auto.")] = None,
    servo: Annotated[
        str, typer.Option(help="As of validate, with its default: auto, table, rigid or a servo model.")
    ] = engines.AUTO,
    feedback: Annotated[
        bool, typer.Option("--feedback", help="As of validate; --set feedback=off,on compares both.")
    ] = False,
    jobs: Annotated[int | None, typer.Option(help="Processes on this computer; default: 1.")] = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Of a dask.distributed scheduler, whose workers play the rows."),
    ] = None,
    objective: Annotated[
        str | None,
        typer.Option(
            "--optimise",
            metavar="margin|falls",
            help="Search the best gait within --set KEY=LEAST:GREATEST, by the plan's margin or by falls.",
        ),
    ] = None,
    evaluations: Annotated[int, typer.Option(help="With --optimise: settings to try, about.")] = 120,
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw the pictures.")] = True,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Simulate a walk under many settings and seeds, and count the falls.

    Every combination of --set values is a setting; every setting is played with every seed. The same command
    with the same -o goes on where it was stopped, however it was. Files: campaign.json, rows.jsonl (as rows
    end), rows.csv and rows.npz, settings.csv and pictures; with --optimise: optimum.toml, a gait file. Exit
    code 1 if a row crashed, 3 if no setting of a search is a walk.
    """
    table = load_robot(robot)
    if auto and not table.limbs:
        table = limbed(table)
    refuse_together({"--auto": auto, "--gait": gait, "--set gait": _sets(assignments or [], "gait")})
    refuse_together({"--perturb": perturb, "--set perturb": _sets(assignments or [], "perturb")})
    refuse_together({"--feedback": feedback, "--set feedback": _sets(assignments or [], "feedback")})
    refuse_together({"--seeds": seeds, "--runs": runs})
    refuse_together({"--seeds": seeds, "--seed": seed})
    refuse_together({"--jobs": jobs, "--cluster": cluster})
    bounds, fixed = bounds_of(assignments or []) if objective else ({}, assignments or [])
    axes = _axes(
        fixed,
        {
            "gait": AUTO if auto else gait or (stepping_gait if list_of_steps else default_gait)(table.name),
            "engine": engine or ("kinematic" if objective == "margin" else "auto"),
            "servo": servo,
            "feedback": ON if feedback else OFF,
            "perturb": " ".join(perturb) if perturb else AS_PLANNED,
        },
    )
    chosen = bool(auto or gait or list_of_steps or _sets(fixed, "gait"))
    with advice_to_fit(default=not chosen):
        stance_of(table)
    places = None if list_of_steps is None else load_footsteps(list_of_steps)
    campaign = _campaign(table, axes, _seeds(seeds, seed or 0, 1 if runs is None else runs), places)
    if jobs is not None and jobs < 1:
        raise InputError(f"--jobs {jobs}: at least one process plays the rows")
    if objective:
        search = Search(campaign, bounds, objective, evaluations, seed or 0)
        return optimise(table.name, search, _workers(jobs or 1, cluster), output, as_json)
    with output_folder(output, "sweep", table.name) as folder:
        with journal(folder, campaign.to_dict()) as rows:
            with _workers(jobs or 1, cluster) as workers:
                _play(campaign, rows, workers)
            done = rows.outcomes
        _write(campaign, done, folder)
        if plots:
            drawn(lambda: _draw(campaign, done, folder))
    total, each = tally([*done.values()]), tallies(campaign, done)
    pairs = [*comparisons(campaign, done)]
    if as_json:
        print_json({**_data(campaign, total, each, pairs), "folder": str(folder)})
    else:
        _print(campaign, total, each, pairs)
        say(f"files in {folder}: {', '.join(sorted(p.name for p in folder.iterdir() if p.is_file()))}")
    for line in _failures(done, "" if chosen else TO_FIT):
        remark(line)
    return 1 if total.crashed else 0


def _sets(assignments: Sequence[str], key: str) -> bool:
    return any(text.partition("=")[0].strip() == key for text in assignments)


def _seeds(path: Path | None, seed: int, runs: int) -> tuple[int, ...]:
    if runs < 1:
        raise InputError(f"--runs {runs}: expected a whole number, at least 1")
    return seeds_from(seed, runs) if path is None else load_seeds(path)


def _axes(assignments: Sequence[str], defaults: Mapping[str, str]) -> Axes:
    """The axes of the grid: conditions first, then the gait's parameters as they were given.

    Raises:
        InputError: an assignment is none, or a range.
    """
    given = {key: axis_values(key, text) for key, text in settings(list(assignments)).items()}
    return {key: (text,) for key, text in defaults.items()} | given


def _campaign(robot: Robot, axes: Axes, seeds: tuple[int, ...], places: Footsteps | None) -> Campaign:
    """The plan, with every setting checked before anything is played.

    Raises:
        UnknownNameError, GaitError, InputError: a gait, engine, servo, key or value is wrong.
    """
    check_rows(axes, len(seeds))
    for name in axes["engine"]:
        engine_named(name)
    for name in axes["servo"]:
        if name != engines.AUTO:
            SimulatedCompliance().on(name).motors_of(robot)
    for text in axes["feedback"]:
        one_of("feedback", text, (OFF, ON))
    for text in axes["perturb"]:
        check_world(text, robot)
        if text != AS_PLANNED and "kinematic" in axes["engine"]:
            raise InputError(
                f"--perturb {text}: engine kinematic has no forces to perturb; use mujoco or pybullet"
            )
    gaits = {name: json.dumps(_gait(robot, name, places).to_dict()) for name in axes["gait"]}
    campaign = Campaign(robot_text(robot), gaits, axes, seeds, versions(*VERSIONED))
    for values in campaign.settings:
        try:
            gait_of(campaign, values)
        except GaitError as error:
            question = "".join(near(fault.key, CONDITIONS) for fault in error.faults).rstrip()
            raise InputError(f"{error}. {question}") if question else error from None
    return campaign


def _gait(robot: Robot, name: str, places: Footsteps | None) -> Gait:
    gait = fitting_gait(robot) if name == AUTO else load_gait(name)
    return gait if places is None else with_footsteps(gait, places)


def _workers(jobs: int, address: str | None) -> AbstractContextManager[Workers]:
    """Processes of this computer, or those of a cluster."""
    if address is None:
        return nullcontext(local_workers(jobs))
    from screwkin.campaign.cluster import cluster_workers

    return cluster_workers(address)


def _play(campaign: Campaign, rows: Journal, workers: Workers) -> None:
    """Play what has not ended yet."""
    left = [row for row in campaign.rows if row.index not in rows.outcomes]
    if len(campaign.seeds) > 1 and AS_PLANNED in campaign.axes["perturb"]:
        remark("remark: in the planned world the runs of a setting are all alike; --perturb x1 draws others")
    if rows.outcomes:
        remark(
            f"{len(rows.outcomes):,} of {len(campaign.rows):,} rows have ended before; {len(left):,} are left"
        )
    with progress_bar("campaign") as done:
        for k, outcome in enumerate(outcomes(partial(played_row, campaign), left, workers), 1):
            rows.append(outcome)
            done(k / len(left))


def _write(campaign: Campaign, done: Mapping[int, Outcome], folder: Path) -> None:
    rows = finished_rows(campaign, done)
    for name, text in (
        ("rows.csv", rows_csv(campaign, rows)),
        ("settings.csv", settings_csv(campaign, tallies(campaign, done))),
    ):
        with atomic_write(folder / name) as file:
            file.write(text)
    with atomic_write_bytes(folder / "rows.npz") as binary:
        binary.write(npz_bytes(rows_arrays(campaign, rows)))


def _draw(campaign: Campaign, done: Mapping[int, Outcome], folder: Path) -> list[Path]:
    from screwkin.report.campaigns import campaign_pictures
    from screwkin.report.style import save_figure, styled

    with styled():
        pictures = campaign_pictures(campaign, done)
        return [save_figure(draw(), folder / name) for name, draw in pictures.items()]


def _data(campaign: Campaign, total: Tally, each: Sequence[Tally], pairs: Sequence[Paired]) -> dict[str, Any]:
    """The campaign as JSON data."""
    counted = [{"values": values, **t.to_dict()} for values, t in zip(campaign.settings, each, strict=True)]
    return {
        "rows": total.rows,
        "falls": total.fell,
        "interval": total.interval,
        **{
            name: value for name, value in total.to_dict().items() if name not in ("rows", "fell", "interval")
        },
        "settings": counted,
        "paired": [pair.to_dict() for pair in pairs],
    }


def _print(campaign: Campaign, total: Tally, each: Sequence[Tally], pairs: Sequence[Paired]) -> None:
    """The table of settings, and how they compare."""
    keys = campaign.varied
    lines: list[Sequence[str]] = [("setting", *keys, *_HEAD)]
    for k, (values, t) in enumerate(zip(campaign.settings, each, strict=True)):
        lines.append((str(k), *(values[key] for key in keys), *_cells(t)))
    shown = lines[: SHOWN + 1]
    if len(each) > 1:
        shown.append(("all", *("" for _ in keys), *_cells(total)))
    say(aligned(shown, "  "))
    if len(lines) > len(shown):
        say(f"  … {len(lines) - SHOWN - 1} more settings in settings.csv")
    for pair in [pair for pair in pairs if pair.pairs][:SHOWN]:
        say(
            f"  setting {pair.second} against {pair.first} on {pair.pairs} equal seeds: alone fell "
            f"{pair.only_second} against {pair.only_first}, p = {pair.p:.2g} (McNemar)"
        )


_HEAD = ("rows", "stood", "fell", "95 % interval", "pass", "planned", "refused", "crashed", "margin")


def _cells(t: Tally) -> tuple[str, ...]:
    interval = "" if t.interval is None else f"{100 * t.interval[0]:.1f} to {100 * t.interval[1]:.1f} %"
    margin = "" if t.margin_mm is None else f"{t.margin_mm:.1f} mm"
    counts = (str(count) for count in (t.passed, t.planned, t.refused, t.crashed))
    return str(t.rows), str(t.stood), str(t.fell), interval, *counts, margin


def _failures(done: Mapping[int, Outcome], advice: str) -> list[str]:
    """A line for each reason of a crash, with its first row, and one for the first row that is refused."""
    first: dict[str, int] = {}
    for index in sorted(done):
        if done[index].status == "crashed":
            first.setdefault(done[index].reason, index)
    refused = [index for index in sorted(done) if done[index].status == "refused"][:1]
    return [
        *(f"crashed, row {index}: {reason}" for reason, index in first.items()),
        *(f"refused, row {index}: {done[index].reason}{advice}" for index in refused),
    ]
