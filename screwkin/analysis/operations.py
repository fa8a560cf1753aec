"""Arithmetic operations of symbolic kinematics after common-subexpression elimination."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from screwkin.algebra import scalar, se3
from screwkin.algebra import screws as screw
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import UNTURNED, Pose, Twist, Vector, leaves, map_scalars
from screwkin.analysis import chains
from screwkin.analysis.chains import Chain, by_dh, by_screws, by_steps
from screwkin.cache import remembered
from screwkin.kinematics import positions
from screwkin.kinematics.positions import screws_in
from screwkin.model import dh

_COUNTED = (chains, positions, dh, screw, se3, scalar)
"""Modules whose formulas are counted."""

Model = Callable[[Sequence[Any]], tuple[Pose, list[Twist]]]
"""Tip pose and Jacobian columns of a chain for its joint positions."""

Count = Mapping[str, int]

_ROUNDING = 1e-12  # m: what a change of reference leaves of equal lengths


def operations(chains: Sequence[Chain]) -> Mapping[str, Count]:
    """Operations of all chains together, by way of computing: ``fk``, ``jacobian``, and ``both`` at once.

    Every sum, product and function counts one (sympy's count); lengths are numbers, zeros and ones of the
    tables fold away. The ways are

    - ``dh``: the chains' tables;
    - ``algebra.screws``: successive displacements in the base frame;
    - ``screw_best_reference``: the same, with each chain's screws told at the joint axis where that is
      cheapest; the Jacobian is told there too, the tip's pose still in the base frame;
    - ``screw_by_steps``: the same screws, carried from axis point to axis point.

    Counting takes seconds, so what was counted once is kept in the cache folder.
    """
    text = [Path(str(module.__file__)).read_text(encoding="utf-8") for module in _COUNTED]
    text.append(Path(__file__).read_text(encoding="utf-8"))
    made_of = "\n".join([repr(tuple(chains)), version("sympy"), *text])
    counted: Mapping[str, Count] = remembered("operations", made_of, lambda: _counted(chains))
    return counted


def _counted(chains: Sequence[Chain]) -> Mapping[str, Count]:
    each: dict[str, list[Count]] = {"dh": [], "screw": [], "screw_best_reference": [], "screw_by_steps": []}
    for chain in chains:
        joints = len(chain.screws)
        at_base = _count(partial(by_screws, chain.screws, chain.frame), joints)
        points = {tuple(screw.s0): screw.s0 for screw in chain.screws}
        moved = [_count(partial(_about, chain, point), joints) for point in points.values()]
        each["dh"].append(_count(partial(by_dh, chain.table), joints))
        each["screw"].append(at_base)
        each["screw_best_reference"].append(min([at_base, *moved], key=lambda count: count["both"]))
        each["screw_by_steps"].append(_count(partial(by_steps, chain.screws, chain.frame), joints))
    return {
        way: {part: sum(count[part] for count in counts) for part in ("fk", "jacobian", "both")}
        for way, counts in each.items()
    }


def _about(chain: Chain, point: Vector, q: Sequence[Any]) -> tuple[Pose, list[Twist]]:
    """By screws told about a point, in base axes."""
    reference = Pose(UNTURNED, point)
    screws = [_folded(screw) for screw in screws_in(reference, chain.screws)]
    frame = reference.inverse @ chain.frame
    tip, columns = by_screws(screws, Pose(frame.R, map_scalars(_whole, frame.p)), q)
    return reference @ tip, columns


def _folded(screw: Screw) -> Screw:
    """The screw with the zeros of its axis point as structure."""
    return Screw(screw.s, map_scalars(_whole, screw.s0), screw.pitch)


def _whole(x: Any) -> Any:
    return 0 if abs(x) < _ROUNDING else x


def _count(model: Model, joints: int) -> Count:
    import sympy

    tip, columns = model(sympy.symbols(f"q1:{joints + 1}", real=True))
    fk, jacobian = leaves(tip), [x for column in columns for x in leaves(column)]
    return {"fk": _after_cse(fk), "jacobian": _after_cse(jacobian), "both": _after_cse(fk + jacobian)}


def _after_cse(expressions: Sequence[Any]) -> int:
    import sympy

    replaced, reduced = sympy.cse([sympy.sympify(x) for x in expressions])
    return sum(int(x.count_ops()) for x in [*(value for _, value in replaced), *reduced])
