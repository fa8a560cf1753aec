"""A simulation and its files: what ``validate`` and ``demo`` share."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from screwkin.analysis.account import Account
from screwkin.analysis.engines import AUTO, ENGINES, Engine, SimulatedCompliance
from screwkin.analysis.validate import Validation
from screwkin.analysis.validate import validate as validated
from screwkin.analysis.verdict import Criteria, verdict_of
from screwkin.cli.output import drawn, plain, progress_bar, remark, say
from screwkin.errors import UnknownNameError
from screwkin.files import atomic_write
from screwkin.report.names import FILM, PAGE, remove_reports, remove_simulated
from screwkin.report.page import write_page
from screwkin.report.pictures import Saved, save_pictures
from screwkin.sim.camera import Camera, save_gif
from screwkin.sim.perturbation import NONE, Perturbation
from screwkin.trajectory import Trajectory

PICTURES_PER_SECOND = 6.0
FEWEST, MOST = 30, 120


@dataclass(frozen=True)
class Wish:
    """What a simulation is to be: engine, a window, a film, pictures and page; commands for the page.

    check_solver, servo, compliance, perturbation, feedback: see ``validate``. motion: what the joints do
    instead of the trajectory; criteria: what a walk must satisfy; more: what follows once the verdict is
    written; it returns what draws more pictures.
    """

    engine: str = "auto"
    check_solver: bool = False
    gui: bool = False
    video: bool = False
    plots: bool = True
    commands: Sequence[str] = ()
    compliance: SimulatedCompliance = field(default_factory=SimulatedCompliance)
    perturbation: Perturbation = NONE
    servo: str = AUTO
    feedback: bool = False
    motion: Trajectory | None = None
    criteria: Criteria | None = None
    more: Callable[[Validation], Callable[[], Sequence[Saved]]] = lambda check: tuple


def simulate_to_files(account: Account, folder: Path, verdict: Path, wish: Wish) -> Validation:
    """Simulate a trajectory, write the verdict, then film, pictures and report.

    Args:
        account: of the trajectory.
        folder: for pictures and report.
        verdict: path of ``validation.json``.
        wish: what to do.

    Raises:
        UnknownNameError: no such engine. MissingDependencyError: it is not installed.
        OutputError: a file cannot be written.
    """
    trajectory = account.trajectory
    camera = _camera(trajectory.duration) if wish.video else None
    with progress_bar("simulation") as done:
        check = validated(
            account.robot,
            trajectory,
            engine(wish.engine),
            servo=wish.servo,
            gui=wish.gui,
            camera=camera,
            criteria=wish.criteria,
            compliance=wish.compliance,
            progress=done,
            motion=wish.motion,
            check_solver=wish.check_solver,
            perturbation=wish.perturbation,
            feedback=wish.feedback,
        )
    removed = remove_reports(folder) if wish.plots else remove_simulated(folder)
    with atomic_write(verdict) as file:
        data = verdict_of(account.robot, trajectory, check).to_dict()
        file.write(json.dumps(plain(data), indent=2, allow_nan=False) + "\n")
    film = None
    if camera is not None and check.pictures:
        film = save_gif(folder / FILM, check.pictures, trajectory.duration)
    more = wish.more(check)
    if wish.plots:
        with progress_bar("pictures") as done:
            pictures = drawn(lambda: [*save_pictures(account, folder, check, done), *more()])
        write_page(folder / PAGE, account, pictures, check, film, wish.commands)
    if gone := [name for name in removed if not (folder / name).exists()]:
        remark(f"removed from {folder}, as they showed an earlier result: {', '.join(gone)}")
    return check


def print_verdict(check: Validation) -> None:
    """Passed, or not or undecided with every reason; warnings on stderr."""
    say("passed" if check.passed else "UNDECIDED:" if check.undecided else "NOT passed:")
    for reason in check.reasons:
        say(f"  {reason}")
    for warning in check.warnings:
        remark(f"warning: {warning}")


def engine(name: str) -> Engine:
    """The engine of that name.

    Raises:
        UnknownNameError: there is none; it lists the engines.
    """
    for known in ENGINES:
        if name == known:
            return known
    raise UnknownNameError("engine", name, ENGINES)


def _camera(duration: float) -> Camera:
    """A film at the robot's own speed, a few pictures per second."""
    return Camera(pictures=int(np.clip(PICTURES_PER_SECOND * duration, FEWEST, MOST)))
