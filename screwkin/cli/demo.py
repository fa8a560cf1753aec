"""``screwkin demo``: the whole story in one command."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from screwkin.algebra.scalar import Scalar
from screwkin.analysis.facts import Facts, facts_of
from screwkin.analysis.readiness import ready
from screwkin.analysis.validate import Validation
from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, OutputFolder
from screwkin.cli.output import aligned, print_json, remark, say, silent
from screwkin.cli.playing import played
from screwkin.cli.send import virtual_bus
from screwkin.cli.simulation import Wish, simulate_to_files
from screwkin.cli.walk import chosen_gait, command_of, limbed, make_trajectory, write_report
from screwkin.errors import MissingDependencyError, SafetyError
from screwkin.gait.files import default_gait
from screwkin.gait.fitting import fitting_gait
from screwkin.gait.record import Gait
from screwkin.model.library import robot_names
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.report.numbers import balance_numbers, validation_numbers
from screwkin.report.pictures import Saved, save_servo_pictures
from screwkin.servo.log import load_log
from screwkin.servo.player import PlaySettings, describe
from screwkin.servo.virtual.bus import VirtualBus

Show = Callable[[str], None]


def demo(
    robot: Annotated[
        str | None,
        typer.Argument(metavar="[ROBOT]", help="A robot's name or table; default: the first bundled one."),
    ] = None,
    gait: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE", help="The gait; default as for walk, with --auto if the robot is your own."
        ),
    ] = None,
    steps: Annotated[int, typer.Option(help="Number of steps.")] = 6,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """A robot walks: its screw table, closed mechanism, gait, ZMP, simulation, virtual servos; a report.

    Takes well under a minute: the servos are virtual, in simulated time. Exit code 3 if the robot does not
    walk as planned.
    """
    show = say if not as_json else remark if sys.stderr.isatty() else silent
    name = robot or robot_names()[0]
    table = load_robot(name)
    fits = gait is None and name not in robot_names()
    if fits:
        table = table if table.limbs else limbed(table)
        chosen = fitting_gait(table)
    else:
        gait = gait or default_gait(table.name)
        chosen = chosen_gait(gait, [], None)
    with output_folder(output, "demo", table.name) as folder:
        _show_robot(show, table)
        facts = facts_of(table)
        _show_mechanism(show, facts)
        _show_gait(show, chosen, steps)
        command = command_of(name, None if fits else gait, steps, [], None)
        account = make_trajectory(table, chosen, steps, command, folder)
        show(
            f"   The loops close to {account.max_closure:.0e} m; rates and accelerations by Davies' method.\n"
        )
        show(
            "4. The zero-moment point (ZMP), from the dynamics of all links: where the floor's force acts\n"
            "   It must stay inside the soles in contact. GCoM is the centre of mass, projected on the floor."
        )
        show(aligned(balance_numbers(account), "   ") + "\n")
        show("5. The simulation: bodies, motors and contacts decide")
        npz = folder / "trajectory.npz"
        play: dict[str, Any] = {}

        def servos(check: Validation) -> Callable[[], Sequence[Saved]]:
            show(aligned(validation_numbers(check), "   ") + "\n")
            show(
                "6. The servos, virtual and in simulated time: every frame goes through the gate and the bus"
            )
            play.update(_played_to_virtual(npz, name, folder / "play.npz"))
            show(aligned([(line,) for line in play["lines"]], "   ") + "\n")
            return lambda: save_servo_pictures(account, folder, play["log"]) if "log" in play else ()

        commands = [
            command,
            f"screwkin validate {npz.name} --video",
            f"screwkin send {npz.name} --virtual --go",
        ]
        wish = Wish(video=True, commands=commands, more=servos)
        try:
            check = simulate_to_files(account, folder, folder / "validation.json", wish)
        except MissingDependencyError:
            page = write_report(account, folder)
            remark(f"The report holds what was done so far: {page}")
            raise
        _show_end(show, folder, check.passed, check.reasons)
    if as_json:
        print_json(
            {
                "robot": table.name,
                "mobility": facts.mobility,
                **check.to_dict(),
                "packets": play.get("packets", 0),
                "servos": play.get("servos"),
                "folder": str(folder),
            }
        )
    return 0 if check.passed else 3


def _show_robot(show: Show, robot: Robot) -> None:
    show(f"1. The robot: {robot.description}, {float(robot.mass):.3f} kg")
    show("   is a table of screws, one per joint: an axis s through a point s0 in the zero pose. One limb:")
    limb = robot.limbs[0] if robot.limbs else None
    joints = [robot.tree[i] for i in robot.path_to(limb.link)] if limb else list(robot.tree[:6])
    rows = [(j.name, _triple(j.screw.s, "g"), _triple(j.screw.s0, ".4f")) for j in joints]
    show(aligned([("joint", "s", "s0 [m]"), *rows], "     ") + "\n")


def _triple(vector: Iterable[Scalar], form: str) -> str:
    return "(" + ", ".join(format(float(c), form) for c in vector) + ")"


def _show_mechanism(show: Show, facts: Facts) -> None:
    mechanism = facts.mechanism
    rows, columns = facts.network_shape
    show("2. The closed mechanism: virtual chains tie waist, feet and hands to the floor")
    show(
        f"   {columns} couplings, {len(mechanism.links)} links, {len(mechanism.circuit_matrix)} circuits, "
        f"mobility {facts.mobility}\n"
        f"   network matrix {rows} x {columns} of rank {facts.rank}, cond(Ns) = {facts.condition:.0f}"
    )
    show(
        f"   {len(mechanism.primary)} couplings impose, {len(mechanism.secondary)} follow: "
        f"all {len(facts.robot.joints)} real joints are solved at once.\n"
    )


def _show_gait(show: Show, gait: Gait, steps: int) -> None:
    show(f"3. The gait {gait.name}: {gait.description}")
    show(
        f"   {steps} steps of {gait.Tc:g} s, waist at {1e3 * gait.waist_height:g} mm, swings lift "
        f"{1e3 * gait.lift:g} mm."
    )


def _show_end(show: Show, folder: Path, passed: bool, reasons: tuple[str, ...]) -> None:
    show("It walks: passed." if passed else "It does not walk as planned:")
    for reason in reasons:
        show(f"  {reason}")
    show(f"The report with all pictures: {folder / 'report.html'}")
    show(f"The film: {folder / 'walk.gif'}")


def _played_to_virtual(trajectory: Path, robot: str, log: Path) -> dict[str, Any]:
    """Play a trajectory to virtual servos in simulated time, if it may be sent.

    Returns:
        lines: what to print; packets: number of packets that the servos heard; servos: the outcome as JSON
        data, None where nothing was played; log: the record of the play, if there is one.
    """
    if not load_robot(robot).servos:
        return _nothing("The robot's table has no [servos]: nothing to play to.")
    try:
        may = ready(trajectory, robot)
        bus, guard, follow = virtual_bus(may)
        outcome = played(bus, may, PlaySettings(), log, {"port": "virtual"}, guard, follow)
    except SafetyError as error:
        return _nothing(f"Refused: {error}")
    assert isinstance(bus.line, VirtualBus)
    ids = may.robot.servos["ids"]
    lines = [
        f"{outcome.frames} frames in {bus.line.packets} packets, {outcome.late_frames} late; "
        f"largest tracking error {outcome.max_tracking_error:.3f} rad",
        describe(outcome, tuple(ids.values())),
    ]
    return {
        "lines": lines,
        "packets": bus.line.packets,
        "servos": outcome.to_dict(),
        "log": load_log(log),
    }


def _nothing(why: str) -> dict[str, Any]:
    return {"lines": [why], "packets": 0, "servos": None}
