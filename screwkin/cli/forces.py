"""``screwkin forces``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from screwkin.algebra.arrays import Array
from screwkin.cli.forces_along import FRICTION, VALIDATED, ForceSettings, forces_along
from screwkin.cli.loads import LOAD_HELP, first_posture, loads_of
from screwkin.cli.options import AsJson, OutputFolder, assignments, numbers_of
from screwkin.cli.output import aligned, print_json, say
from screwkin.errors import InputError
from screwkin.mechanism.action_choice import ActionChoice, action_choice
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.statics import StaticForces, static_forces
from screwkin.mechanism.symbolic_statics import symbolic_statics
from screwkin.model.display import listing
from screwkin.model.robot import Robot
from screwkin.model.state import State, home
from screwkin.model.table import load_robot


def forces(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|TRAJ",
            help="A bundled robot's name, or a .toml, .urdf, MJCF .xml or DH .csv file; or a trajectory.npz.",
        ),
    ],
    load: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help=LOAD_HELP,
        ),
    ] = None,
    weights: Annotated[bool, typer.Option("--weights", help="Add the weights of the links.")] = False,
    down: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Base axes' direction in which weights pull; default 0,0,-1."),
    ] = None,
    impose: Annotated[
        list[str] | None,
        typer.Option(metavar="ACTION=VALUE", help="Impose an action, as object.fy=-5; may be repeated."),
    ] = None,
    active: Annotated[
        list[str] | None, typer.Option(help="A joint with an effort; may be repeated. Default: the drives.")
    ] = None,
    contact: Annotated[
        list[str] | None,
        typer.Option(help="A tip on the floor or a held closure; may be repeated. Default: the soles."),
    ] = None,
    posture: Annotated[str | None, typer.Option(help="A posture of the table; default home.")] = None,
    symbolic: Annotated[
        bool,
        typer.Option("--symbolic", help="Efforts of a linkage in closed form, for one JOINT=EFFORT."),
    ] = False,
    friction: Annotated[
        float | None, typer.Option(help="TRAJ: coefficient of friction of the floor; default 0.8.")
    ] = None,
    pull: Annotated[
        bool, typer.Option("--pull", help="TRAJ: no friction and no limits: the floor may pull.")
    ] = False,
    engine: Annotated[
        str | None,
        typer.Option(help="TRAJ: pybullet, mujoco or none, beside the plan; default: as it was validated."),
    ] = None,
    plots: Annotated[bool, typer.Option(help="TRAJ: draw the pictures.")] = True,
    output: OutputFolder = None,
    as_json: AsJson = False,
) -> int:
    """Of a robot what balances loads, by Davies' method; of a trajectory the forces of feet and joints.

    A trajectory's forces go to forces.npz and pictures, beside those of the simulator that validated it. Exit
    code 3 where no forces within friction carry the motion.
    """
    of_robot = {
        "--load": load, "--weights": weights, "--down": down, "--impose": impose, "--active": active,
        "--contact": contact, "--posture": posture,
    }  # fmt: skip
    of_trajectory = {
        "--friction": friction, "--pull": pull, "--engine": engine, "--no-plots": not plots,
        "--output": output,
    }  # fmt: skip
    if Path(robot).suffix == ".npz":
        _refuse(of_robot | {"--symbolic": symbolic}, f"for robots, and {robot} is a trajectory")
        if pull and friction is not None:
            raise InputError("--pull is without friction; leave out one of --pull and --friction")
        limit = None if pull else FRICTION if friction is None else friction
        return forces_along(Path(robot), ForceSettings(limit, engine or VALIDATED, plots, output, as_json))
    _refuse(of_trajectory, f"for a trajectory.npz, and {robot} is none")
    if symbolic:
        numbers = of_robot.keys() - {"--load", "--active"}
        _refuse({name: of_robot[name] for name in of_robot if name in numbers}, "no part of a closed form")
        return _closed_form(load_robot(robot, symbolic=True), load or [], active, as_json)
    table = load_robot(robot)
    return _statics(table, posture, load or [], weights, down, impose or [], active, contact, as_json)


def _refuse(options: Mapping[str, Any], why: str) -> None:
    given = [name for name, value in options.items() if value not in (None, False)]
    if given:
        raise InputError(f"{', '.join(given)}: {why}; leave it out")


def _statics(
    robot: Robot,
    posture: str | None,
    load: Sequence[str],
    weights: bool,
    down: str | None,
    impose: Sequence[str],
    active: Sequence[str] | None,
    contact: Sequence[str] | None,
    as_json: bool,
) -> int:
    """Equilibrium of a robot in a posture."""
    loads, imposed = loads_of(load), assignments("--impose", impose, "object.fy=-5")
    if not (loads or imposed or weights):
        raise InputError("nothing loads it; add --load NAME=VALUES, --impose ACTION=VALUE or --weights")
    mechanism = closed_mechanism(robot)
    state = _turned(home(robot, posture or first_posture(robot)), down)
    result = static_forces(mechanism, state, loads, imposed, weights=weights, active=active, contacts=contact)
    choice = action_choice(mechanism, None, result.system.active, result.system.contacts)
    if as_json:
        print_json(_data(robot, result, choice))
    else:
        say(_text(robot, result, choice))
    return 0


def _closed_form(robot: Robot, load: Sequence[str], active: Sequence[str] | None, as_json: bool) -> int:
    """Efforts of a linkage in symbols."""
    loads = loads_of(load)
    if len(loads) != 1 or not isinstance(next(iter(loads.values())), float):
        raise InputError("--symbolic takes one load on a joint; write --load rocker=10")
    (name,) = loads
    driving = active or [n for n in closed_mechanism(Robot.from_text(robot.text)).primary if n != name]
    solution = symbolic_statics(robot, name, driving)
    lines = {joint: str(effort) for joint, effort in solution.efforts.items()}
    if as_json:
        print_json({"robot": robot.name, "load": name, "efforts": lines})
        return 0
    where = ", ".join(f"{symbol} of {joint}" for joint, symbol in solution.symbols.items())
    say(f"{robot.name}: efforts that balance load, an effort at {name}\n{aligned(list(lines.items()), '  ')}")
    say(f"  positions: {where}")
    return 0


def _turned(state: State, down: str | None) -> State:
    """The state with its base turned so that a direction of base axes points down."""
    if down is None:
        return state
    d = np.array(numbers_of(down, "--down", (3,)))
    if not np.linalg.norm(d) > 0:
        raise InputError(f"--down {down!r} is no direction; write three numbers, as 0,-1,0")
    up = -d / np.linalg.norm(d)
    side = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    side /= np.linalg.norm(side)
    T = np.array(state.T_world_base)
    T[:3, :3] = [side, np.cross(up, side), up]
    return State(T, state.q)


def _data(robot: Robot, result: StaticForces, choice: ActionChoice) -> dict[str, Any]:
    pairs = list(zip(result.names, result.values, result.decided, strict=True))
    contacts = [float(np.linalg.norm(result.force(name))) for name in result.system.contacts]
    return {
        "robot": robot.name,
        "actions": {name: value for name, value, _ in pairs},
        "undecided": [name for name, _, decided in pairs if not decided],
        "efforts": result.efforts,
        "wrenches": {name: result.wrench(name) for name in result.couplings},
        "action_matrix": [6 * len(result.system.cut_sets), len(result.names)],
        "rank": choice.rank,
        "degree": choice.degree,
        "primary": choice.primary,
        "redundant": dict(zip(choice.redundant, choice.meaning, strict=True)),
        "residual": result.residual,
        "max_effort": max((abs(float(x)) for x in result.efforts.values()), default=0.0),
        "max_contact_force": max(contacts, default=0.0),
    }


def _text(robot: Robot, result: StaticForces, choice: ActionChoice) -> str:
    system = result.system
    rows = [("coupling", "effort", "force x, y, z [N], world axes", "size [N]", "")]
    free = dict(zip(result.names, ~result.decided, strict=True))
    sliding = {joint.name for joint in robot.tree if joint.screw.is_translation}
    for name in result.couplings:
        own = [action for action in result.names if action == name or action.startswith(f"{name}.")]
        unit = "N" if name in sliding else "N m"
        effort = f"{round(float(result[name]), 4) + 0.0:.4f} {unit}" if name in result.names else ""
        force = result.force(name)
        open_ones = [action.rpartition(".")[2] for action in own if free[action]]
        mark = (
            f"undecided: {' '.join(open_ones) if len(open_ones) < len(own) else 'all'}" if open_ones else ""
        )
        rows.append((name, effort, _three(force), f"{np.linalg.norm(force):.4f}", mark))
    facts = [
        ("action matrix A", f"{6 * len(system.cut_sets)} x {len(result.names)}, rank {choice.rank}"),
        ("degree of constraint", f"{choice.degree}: {', '.join(choice.primary) or 'nothing is left over'}"),
        ("redundant constraints", str(len(choice.redundant))),
        *((f"  {name}", text) for name, text in zip(choice.redundant, choice.meaning, strict=True)),
        ("efforts by", listing(system.active) or "none"),
        ("contacts", ", ".join(system.contacts) or "none"),
    ]
    parts = [f"{robot.name}: equilibrium", aligned(rows, "  "), aligned(facts, "  ")]
    if not result.decided.all():
        parts.append(
            "undecided: equilibrium leaves it open; shown is the choice of least squares (--impose sets one)"
        )
    return "\n".join(parts)


def _three(values: Array) -> str:
    return "  ".join(f"{round(float(x), 4) + 0.0:9.4f}" for x in values)
