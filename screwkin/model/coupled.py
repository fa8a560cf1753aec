"""Coupled joints: how they follow, and what they leave to the joint that leads them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from screwkin.model.records import LIMIT_TOLERANCE, CoupledJoint, Joint


def coupling_text(joint: CoupledJoint) -> str:
    """How a coupled joint follows, as in ``finger = -2 thumb + 0.1``; its ratio 1 and offset 0 left out."""
    ratio = {1.0: "", -1.0: "-"}.get(joint.ratio, f"{joint.ratio:.6g} ")
    offset = f" {'-' if joint.offset < 0 else '+'} {abs(joint.offset):.6g}" if joint.offset else ""
    return f"{joint.name} = {ratio}{joint.leader}{offset}"


Coupling = tuple[str, float, float]
"""Leader, ratio and offset of a joint."""


def coupled_joint(joint: Joint, coupling: Coupling) -> CoupledJoint:
    """The joint, following another one instead of having a coordinate."""
    leader, ratio, offset = coupling
    return CoupledJoint(**vars(joint), leader=leader, ratio=ratio, offset=offset)


def composed(couplings: Mapping[str, Coupling], name: str) -> Coupling:
    """What a joint follows in the end, where its leader may follow another joint.

    Args:
        couplings: of all joints that follow another one, by their names; without circles.
        name: of one of them.
    """
    leader, ratio, offset = couplings[name]
    while leader in couplings:
        leader, further, start = couplings[leader]
        ratio, offset = ratio * further, ratio * start + offset
    return leader, ratio, offset


def coupling_of(joint: CoupledJoint) -> dict[str, Any]:
    """A joint's coupling by the keys of a table."""
    return {"joint": joint.leader, "ratio": joint.ratio, "offset": joint.offset}


def tightened(joint: Joint, coupled: Iterable[CoupledJoint]) -> Joint:
    """The joint with the limits and the greatest speed that it and the joints coupled to it leave together.

    Args:
        joint: with a coordinate.
        coupled: all coupled joints of the robot.

    Returns:
        The joint; where they leave it no position, ``lower`` is above ``upper``.
    """
    for follower in coupled:
        if follower.leader != joint.name:
            continue
        lower, upper = _ends(follower)
        rate = abs(follower.ratio)
        joint = replace(
            joint,
            lower=max(joint.lower, lower),
            upper=min(joint.upper, upper),
            velocity=min(joint.velocity, follower.velocity / rate if rate else math.inf),
        )
    return joint


def _ends(follower: CoupledJoint) -> tuple[float, float]:
    """Positions of the leader between which a coupled joint is within its own limits."""
    ends = [end - follower.offset for end in (follower.lower, follower.upper)]
    if not follower.ratio:
        inside = ends[0] <= LIMIT_TOLERANCE and ends[1] >= -LIMIT_TOLERANCE
        return (-math.inf, math.inf) if inside else (math.inf, -math.inf)
    lower, upper = sorted(end / follower.ratio + 0.0 for end in ends)
    return lower, upper
