"""Formulas of the closed mechanism on a tape: its couplings' screws, and what virtual chains do.

A mechanism is told by its robot and its choice of couplings, which are equal where mechanisms are.
"""

from __future__ import annotations

from screwkin.algebra.se3 import ZERO, Twist, Vector
from screwkin.compiler.records import Tape, identifier, pose_input
from screwkin.kinematics.tape import Formula
from screwkin.mechanism.mechanism import Mechanism, coupling_graph, virtual_chains
from screwkin.mechanism.network import coupling_twists
from screwkin.mechanism.virtual_motion import imposing_chains, primary_motion
from screwkin.model.robot import Robot

Names = tuple[str, ...]


def mechanism_of(robot: Robot, primary: Names, secondary: Names) -> Mechanism:
    """The mechanism of a robot with a choice that has been checked."""
    chains = virtual_chains(robot)
    return Mechanism(robot, chains, coupling_graph(robot, chains), primary, secondary, len(primary))


@Formula
def coupling_screws(tape: Tape, robot: Robot, primary: Names, secondary: Names, at_base: bool) -> None:
    """Normalised screws of all couplings, columns [omega; v], at the base origin or at a point."""
    mechanism = mechanism_of(robot, primary, secondary)
    tape.title(
        identifier(robot.name, "screws", *([] if at_base else ["at_point"])),
        f"Screws of the couplings of {robot.name}: columns [omega; v at the"
        f" {'base origin' if at_base else 'point'}], world axes.",
    )
    T, q = pose_input(tape, "T_world_base"), tape.input("q", len(robot.joints))
    point = ZERO if at_base else Vector(*tape.input("point", 3)) - T.p
    columns = [[*t.omega, *t.v] for t in coupling_twists(mechanism, T.R, q, point)]
    tape.output("S", [x for row in zip(*columns, strict=True) for x in row], 6, len(columns))


@Formula
def primary_rates(tape: Tape, robot: Robot, primary: Names, secondary: Names, whole: Names) -> None:
    """Rates of the primary virtual couplings; of ``whole`` chains the twist is told, else a velocity."""
    mechanism = mechanism_of(robot, primary, secondary)
    tape.title(
        identifier(robot.name, "virtual"),
        f"Rates of the virtual couplings of {robot.name} that move its bodies as wanted; world axes, twists"
        " [omega; v of the body's origin].",
    )
    T, q = pose_input(tape, "T_world_base"), tape.input("q", len(robot.joints))
    twists = {}
    for k, chain in enumerate(imposing_chains(mechanism)):
        full = chain.name in whole
        x = tape.input(f"twist_{k}", 6 if full else 3)
        twists[chain.name] = Twist(Vector(*x[:3]) if full else ZERO, Vector(*x[-3:]))
    motion = primary_motion(mechanism, T, q, twists)
    tape.output("primary", [motion[name] for name in primary])
