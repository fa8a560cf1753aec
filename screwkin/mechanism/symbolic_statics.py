"""Statics of small linkages in symbols: the wrench that runs round a loop, and the efforts that it asks for.

Where only efforts of couplings load a mechanism, all couplings of a circuit transmit one wrench, and Davies'
cut-set law becomes the transpose of his circuit law: efforts = N^T wrenches. Couplings without a motor ask
for none; that decides the wrenches, and these the efforts of the others.

Source: Davies (1983), Mechanical networks III: wrenches on circuit screws.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwkin.algebra.se3 import IDENTITY
from screwkin.errors import InputError, SingularError, one_of
from screwkin.mechanism.choice import independent
from screwkin.mechanism.mechanism import unchosen
from screwkin.mechanism.network import coupling_twists, network_of_twists
from screwkin.mechanism.symbolic import Matrix, Symbol, Tidy, named_formulas, symbolic_loops
from screwkin.model.robot import Robot
from screwkin.model.state import reference_posture


@dataclass(frozen=True)
class SymbolicStatics:
    """Closed forms, valid where the loops are closed.

    Attributes:
        symbols: symbol of every joint's position, by name.
        load: the symbol of the imposed effort [N m or N].
        efforts: of every coupling with a motor, by name [N m or N].
        wrenches: by the name of every loop the wrench (6,) [m; f] that runs round it, base axes, moment about
            the base origin; components that the linkage leaves undecided are zero.
    """

    symbols: Mapping[str, Symbol]
    load: Symbol
    efforts: Mapping[str, Any]
    wrenches: Mapping[str, Matrix]


def symbolic_statics(robot: Robot, loaded: str, active: Sequence[str]) -> SymbolicStatics:
    """Efforts that balance an effort at one coupling, in sympy.

    Args:
        robot: a mechanism without limbs, from ``load_robot(name, symbolic=True)``.
        loaded: name of the joint whose effort is imposed.
        active: names of the joints whose efforts balance it; as many as the mobility.

    Raises:
        UnknownNameError: no such joint.
        InputError: the table has limbs, no loops, or coupled joints.
        SingularError: these efforts cannot balance the load.
    """
    import sympy

    if robot.limbs:
        raise InputError(f"{robot.name} has limbs; symbolic statics are those of linkages without")
    loops, names = symbolic_loops(robot), robot.joint_names
    for name in (loaded, *active):
        one_of("joint", name, names)
    given = [name for name in names if name not in active]
    symbols, load = loops[0].symbols, sympy.Symbol("load", real=True)
    N = sympy.zeros(6 * len(loops), len(names))
    for row, loop in enumerate(loops):
        for column, name in enumerate(loop.couplings):
            N[6 * row : 6 * row + 6, names.index(name)] = loop.network_block[:, column]
    rows = _rows(Robot.from_text(robot.text, robot.path), given)
    tidy = Tidy(named_formulas(robot), [symbols[name] for name in names], tuple(symbols.values()))
    M = N[rows, [names.index(name) for name in given]].T
    right = sympy.Matrix([load if name == loaded else 0 for name in given])
    determinant = tidy(M.det(method="berkowitz"))
    share = (M.adjugate(method="berkowitz") * right).applyfunc(tidy)
    wrench = sympy.zeros(N.rows, 1)
    for row, value in zip(rows, share, strict=True):
        wrench[row] = value / determinant
    efforts = {}
    for name in active:
        column = N[rows, names.index(name)]
        work = (column.T * share)[0]
        efforts[name] = sympy.cancel(tidy(work) / determinant)
    return SymbolicStatics(
        symbols, load, efforts, {loop.name: wrench[6 * k : 6 * k + 6, 0] for k, loop in enumerate(loops)}
    )


def _rows(robot: Robot, given: Sequence[str]) -> list[int]:
    """Components of the loops' wrenches that the given efforts decide, at the numeric robot's posture."""
    bare, q = unchosen(robot), reference_posture(robot)
    N = network_of_twists(bare, coupling_twists(bare, IDENTITY, list(q)))
    known = N[:, [bare.position[name] for name in given]]
    rows = independent(np.asarray(known, dtype=float).T, range(len(known)))
    if len(rows) < len(given):
        raise SingularError(
            f"{len(given)} couplings have given efforts, but only {len(rows)} of them are independent: let "
            f"{len(given) - len(rows)} more joints balance the load"
        )
    return rows
