"""Arithmetic operations of a chain's kinematics, as straight-line programs of the library's compiler."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Screw
from screwkin.algebra.se3 import UNTURNED, Pose, Twist, Vector, map_scalars
from screwkin.analysis.chains import ModelChain, by_dh, by_library, by_screws
from screwkin.compiler.program import Program, Recorder
from screwkin.compiler.records import matrix
from screwkin.kinematics.positions import screws_in

Model = Callable[[Sequence[Scalar]], tuple[Pose, list[Twist]]]
"""Tip pose and Jacobian columns of a chain for its joint positions."""

Count = Mapping[str, int]

_ROUNDING = 1e-12  # m: what a change of reference leaves of equal lengths


def models_of(chain: ModelChain) -> Mapping[str, Model]:
    """The ways to compute a chain: ``dh``, ``screw`` (the textbook's) and ``library``."""
    return {
        "dh": partial(by_dh, chain.table),
        "screw": partial(by_screws, chain.screws, chain.frame),
        "library": partial(by_library, chain.screws, chain.frame),
    }


def model_program(model: Model, joints: int, outputs: str = "both") -> Program:
    """Tip pose (4, 4) and Jacobian (n, 6) of a model as a straight-line program of q (n,).

    Args:
        model: the way to compute a chain.
        joints: n.
        outputs: ``fk``, ``jacobian`` or ``both``.
    """
    recorder = Recorder("chain", "Tip pose and Jacobian of a chain.")
    tip, columns = model(recorder.input("q", joints))
    if outputs != "jacobian":
        recorder.output("pose", matrix(tip), 4, 4)
    if outputs != "fk":
        recorder.output("jacobian", columns, joints, 6)
    return recorder.program()


def operations(chains: Sequence[ModelChain]) -> Mapping[str, Count]:
    """Operations of all chains together, by way of computing: ``fk``, ``jacobian``, and ``both`` at once.

    Sums, products, quotients and functions of the program that would run count one each; common parts count
    once, changes of sign not at all. Lengths are numbers; zeros and ones of the tables fold away. Ways:

    - ``dh``: the chains' tables;
    - ``screw``: the textbook's successive displacements in the base frame;
    - ``screw_best_reference``: the same, with each chain's screws expressed at the joint axis where that is
      cheapest; the Jacobian is expressed there too, the tip's pose still in the base frame;
    - ``library``: the same screws as the library runs them, from axis point to axis point.
    """
    total: dict[str, dict[str, int]] = {}
    for chain in chains:
        joints = len(chain.screws)
        counts = {way: _count(model, joints) for way, model in models_of(chain).items()}
        points = {tuple(screw.s0): screw.s0 for screw in chain.screws}
        moved = [_count(partial(_about, chain, point), joints) for point in points.values()]
        counts["screw_best_reference"] = min([counts["screw"], *moved], key=lambda count: count["both"])
        for way, count in counts.items():
            sums = total.setdefault(way, dict.fromkeys(count, 0))
            sums.update({part: sums[part] + number for part, number in count.items()})
    return total


def _count(model: Model, joints: int) -> Count:
    return {part: model_program(model, joints, part).operations for part in ("fk", "jacobian", "both")}


def _about(chain: ModelChain, point: Vector, q: Sequence[Any]) -> tuple[Pose, list[Twist]]:
    """By the textbook's screws, expressed about a point in base axes."""
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
