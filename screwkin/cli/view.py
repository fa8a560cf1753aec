"""``screwkin view``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from screwkin.cli.options import AsJson, FittingGait, refuse_together
from screwkin.cli.output import print_json, progress_bar, say
from screwkin.cli.walk import TO_FIT, limbed
from screwkin.errors import InputError
from screwkin.gait.files import default_gait, load_gait
from screwkin.gait.fitting import fitting_gait
from screwkin.gait.plan import whole_steps
from screwkin.gait.record import Gait, gait_from_dict
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.trajectory import Trajectory, load_trajectory
from screwkin.viewer.film import check_film, write_film
from screwkin.viewer.server import HOST, PORT, serve
from screwkin.viewer.session import Session, begun, replanned, with_motion


def view(
    what: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|TRAJ",
            help="A robot's name or file (.toml, .urdf, .xml, .csv), or a trajectory.npz.",
        ),
    ],
    gait: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="The gait that a robot walks; default: ROBOT-… or walk."),
    ] = None,
    auto: FittingGait = False,
    steps: Annotated[int, typer.Option(help="Steps of that walk.")] = 4,
    host: Annotated[
        str, typer.Option(help="Address to listen at; 0.0.0.0 for all of the computer's.")
    ] = HOST,
    port: Annotated[int, typer.Option(help="Port to listen at, or the next one that is free.")] = PORT,
    film: Annotated[
        Path | None,
        typer.Option("--record", metavar="FILE.gif", help="Film the motion into a file; no browser."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """See a robot, a mechanism or a motion in the browser: joints to drag, a gait to tune, time to scrub.

    Prints the address to open and shows it until Ctrl-C. From another computer: ssh -L 8080:localhost:8080
    HOST, then open the same address there. Needs viser: pip install viser.
    """
    if film is not None:
        check_film(film)
    session = _session(what, gait, auto, steps)
    if film is not None:
        return _filmed(session, what, film, as_json)

    def ready(url: str) -> None:
        if as_json:
            print_json({"url": url, "robot": session.robot.name})
        else:
            say(f"{session.robot.name}: {url} (Ctrl-C ends it)")
        sys.stdout.flush()

    serve(session, host, port, ready)
    return 0


def _session(what: str, gait: str | None, auto: bool, steps: int) -> Session:
    """What the command line asks to see."""
    refuse_together({"--auto": auto, "--gait": gait})
    if Path(what).suffix.lower() == ".npz":
        if auto or gait is not None:
            option = "--auto" if auto else "--gait"
            raise InputError(f"a trajectory has its gait recorded; leave {option} out, or name a robot")
        from screwkin.analysis.account import recorded_robot

        trajectory = load_trajectory(what)
        robot = recorded_robot(trajectory, what)
        own, count = _recorded_gait(trajectory), trajectory.meta.get("steps")
        return with_motion(begun(robot, own, count if isinstance(count, int) else steps), trajectory)
    robot, steps = load_robot(what), whole_steps(steps)
    if auto:
        robot = robot if robot.limbs else limbed(robot)
        return begun(robot, fitting_gait(robot), steps)
    advice = TO_FIT if gait is None and robot.base == "floating" else ""
    if gait is None and not walks(robot):
        return begun(robot, advice=advice)
    return begun(robot, load_gait(gait or default_gait(robot.name)), steps, advice)


def walks(robot: Robot) -> bool:
    """Whether a robot has what a gait asks for: two legs with soles on a floating base, and a home."""
    soled = {sole.limb for sole in robot.soles}
    legs = [limb for limb in robot.limbs if limb.kind == "leg" and limb.name in soled]
    at_home = any(posture.name == "home" for posture in robot.postures)
    return robot.base == "floating" and len(legs) == 2 and at_home


def _recorded_gait(trajectory: Trajectory) -> Gait | None:
    """The gait that a trajectory records; None where it is of another kind or cannot be read."""
    recorded = trajectory.meta.get("gait")
    try:
        return gait_from_dict(recorded, "the trajectory's gait") if isinstance(recorded, dict) else None
    except InputError:
        return None


def _filmed(session: Session, what: str, film: Path, as_json: bool) -> int:
    """Film the motion of a session, planned first where it has none."""
    with progress_bar("film") as done:
        if session.track is None:
            session = replanned(session)
        done(0.3)
        if session.track is None:
            why = session.note or f"name a trajectory.npz{session.advice}"
            raise InputError(f"{what}: there is no motion to film; {why}")
        path = write_film(session.robot, session.track, film)
    if as_json:
        print_json({"url": None, "robot": session.robot.name, "film": str(path)})
    else:
        say(f"{session.robot.name}: the film is {path}")
    return 0
