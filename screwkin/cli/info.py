"""``screwkin info``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated

import typer

from screwkin.analysis.facts import Facts, facts_of
from screwkin.analysis.ik_class import IkClass, ik_classes
from screwkin.cli.folder import output_folder
from screwkin.cli.options import AsJson, RobotName, assignments, point_of
from screwkin.cli.output import aligned, drawn, print_json, remark, say
from screwkin.compiler.run import large_batches
from screwkin.errors import MissingDependencyError
from screwkin.mechanism.chain_files import load_chains
from screwkin.mechanism.singularity import LimbSingularity
from screwkin.model.coupled import coupling_text
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.report.graph import mechanism_graph
from screwkin.report.singular import save_singularities
from screwkin.report.style import save_figure, styled
from screwkin.sim.self_collision import touching_at_home

STILL = 1e-12
"""What is written as 0, being rounding [rad or m, and their rates]."""


def info(
    robot: RobotName,
    posture: Annotated[str | None, typer.Option(help="A posture of the table; default home.")] = None,
    at: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Where the robot stands in the world [m].")
    ] = None,
    point: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="World point where N is formed [m]; default: the waist."),
    ] = None,
    primary: Annotated[
        list[str] | None,
        typer.Option(help="A coupling to impose; repeat for all of them."),
    ] = None,
    move: Annotated[
        list[str] | None,
        typer.Option(
            metavar="COUPLING=VALUE",
            help="Go there with closed loops [rad or m]; may be repeated.",
        ),
    ] = None,
    graph: Annotated[
        bool, typer.Option("--graph", help="Draw the graph of links, couplings and circuits.")
    ] = False,
    chains: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A TOML file of [[chain]] rows: virtual chains."),
    ] = None,
    rate: Annotated[
        list[str] | None,
        typer.Option(
            metavar="COUPLING=VALUE", help="Impose a rate, others rest [rad/s or m/s]; may be repeated."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for pictures of what is singular."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Mass, closed mechanism (couplings, circuits, mobility, network matrix) and conditioning of a robot."""
    facts = facts_of(
        load_robot(robot),
        posture,
        point_of(at, "--at") or (0.0, 0.0, 0.0),
        point_of(point, "--point"),
        primary,
        assignments("--move", move or [], "crank=0.5"),
        () if chains is None else load_chains(chains),
        assignments("--rate", rate or [], "crank=0.5"),
    )
    if graph or output is not None:
        with output_folder(output, "info", facts.robot.name) as folder:
            for path in drawn(lambda: _pictures(facts, folder, graph)):
                remark(f"wrote {path}")
    if as_json:
        touching = _touching(facts.robot)
        solved = [limb.to_dict() for limb in ik_classes(facts.robot)]
        print_json(
            facts.to_dict() | {"ik": solved, "large_batches": large_batches(), "touching_at_home": touching}
        )
    else:
        say(_text(facts))
    return 0


def _pictures(facts: Facts, folder: Path, graph: bool) -> list[Path]:
    """Pictures of what is singular, and of the graph if it is wanted."""
    paths = list(save_singularities(facts.robot, facts.state, facts.limbs, folder))
    if graph:
        with styled():
            paths.append(save_figure(mechanism_graph(facts.mechanism), folder / "graph.png"))
    return paths


def _touching(robot: Robot) -> list[tuple[str, str]] | None:
    """Links that touch at home, which no verdict counts as a collision; None where mujoco is missing."""
    try:
        return list(touching_at_home(robot))
    except MissingDependencyError:
        return None


def _text(facts: Facts) -> str:
    robot, mechanism, data = facts.robot, facts.mechanism, facts.to_dict()
    virtual = [name for name in mechanism.couplings if name not in robot.joint_names]
    rows, columns = facts.network_shape
    body = [
        ("mass", f"{data['mass']:.4f} kg"),
        ("bodies, joints", f"{data['bodies']}, {data['joints']} ({data['actuated_joints']} actuated)"),
        *(
            (limb.name, f"{limb.kind} with {len(robot.path_to(limb.link))} joints, tip {limb.tip}")
            for limb in robot.limbs
        ),
    ]
    if robot.coupled:
        body.append(("coupled joints", ", ".join(map(coupling_text, robot.coupled))))
    touching = _touching(robot)
    if touching is None:
        body.append(("links that touch at home", "unknown: needs mujoco (python -m pip install mujoco)"))
    elif touching:
        body.append(("links that touch at home", ", ".join(f"{a} and {b}" for a, b in touching)))
    closed = [
        ("couplings", f"{data['couplings']}: {len(robot.joints)} real, {len(virtual)} virtual"),
        ("links", data["links"]),
        ("circuits", data["circuits"]),
        ("mobility", f"{data['mobility']} (by counting: {data['kutzbach']})"),
        ("network matrix N", f"{rows} x {columns}, rank {data['rank']}"),
        ("primary", _listed(mechanism.primary)),
        ("secondary", _listed(mechanism.secondary)),
        ("cond(Ns)", f"{facts.condition:.4g}"),
        (
            "large batches by",
            {"C": "NumPy; compiled C where bound or prepared", "numpy": "NumPy (no C compiler found)"}[
                large_batches()
            ],
        ),
    ]
    closed += _moving(facts)
    limbs = [row for limb in facts.limbs for row in _singular(limb)]
    parts = [
        f"{robot.name}: {robot.description}",
        aligned(body, "  "),
        "closed mechanism",
        aligned(closed, "  "),
    ]
    solved = [_solved(limb) for limb in ik_classes(robot)]
    if solved:
        parts += ["inverse kinematics", aligned(solved, "  ")]
    if limbs:
        parts += ["smallest singular value, dimensionless by the robot's size", aligned(limbs, "  ")]
    return "\n".join(parts)


def _moving(facts: Facts) -> Iterator[tuple[str, str]]:
    """Coordinates of chains that are added, and rates where some are imposed; zeros are left out."""
    for chain in facts.mechanism.added:
        yield f"chain {chain.name}", _values({name: facts.coordinates[name] for name in chain.names})
    if facts.rates:
        yield "rates", _values({name: x for name, x in facts.rates.items() if abs(x) > STILL})


def _values(named: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {x if abs(x) > STILL else 0:.6g}" for name, x in named.items())


def _singular(limb: LimbSingularity) -> list[tuple[str, ...]]:
    """How near a limb or loop is to a singularity; why, and what it leaves free."""
    state = f"NEAR A SINGULARITY: {limb.cause}" if limb.near else "regular"
    rows: list[tuple[str, ...]] = [(limb.limb, f"{limb.sigma:.4f}", state)]
    if limb.free is not None and limb.free.motion.text not in limb.cause:
        rows.append(("", "", f"free motion of {limb.free.body}: {limb.free.motion.text}"))
        rows.append(("", "", f"free wrench: {limb.free.wrench.text}"))
    return rows


def _solved(limb: IkClass) -> tuple[str, ...]:
    """How a limb is solved, how many branches it has, and how sure it is."""
    branches = "one branch" if limb.branches == 1 else f"at most {limb.branches} branches"
    share = f"{limb.solved:.1%} of {limb.poses} {limb.target}s within the limits solved"
    return (limb.limb, limb.family, *((branches, share) if limb.poses else ()))


def _listed(names: tuple[str, ...]) -> str:
    """Names, those of one chain together: ``waist.px py pz``."""
    groups: dict[str, list[str]] = {}
    for name in names:
        chain, dot, axis = name.partition(".")
        groups.setdefault(chain + dot, []).append(axis)
    listed = ", ".join(chain + " ".join(axes) for chain, axes in groups.items())
    return f"{len(names)}: {listed}" if names else "0"
