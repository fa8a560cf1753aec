"""Arms: the longest pair of mirrored branches beside the legs, as far as it is one chain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwkin.anatomy.groups import Group
from screwkin.anatomy.limbs import LEAST, Pair, Standing, depth
from screwkin.anatomy.skeleton import Skeleton
from screwkin.anatomy.symmetry import Symmetry


def arm_pairs(
    skeleton: Skeleton, stance: Standing, groups: Sequence[Group] = ()
) -> tuple[Pair | None, tuple[Pair, ...]]:
    """The pair of arms, None without one, and the pairs that are neither arms nor legs.

    Of pairs that groups of the SRDF hold, else of all, it is the one that reaches furthest.
    """
    if not stance.others:
        return None, ()
    named = {i for group in groups for i in group.joints}
    best = max(stance.others, key=lambda pair: ({pair.one, pair.other} <= named, _reach(skeleton, pair.one)))
    return best, tuple(pair for pair in stance.others if pair is not best)


def _reach(skeleton: Skeleton, root: int) -> float:
    """Greatest distance of what a branch carries from its root's axis point [m]."""
    start = skeleton.place((skeleton.robot.tree[root].child,))
    return max(float(np.linalg.norm(skeleton.place((name,)) - start)) for name in skeleton.links_beyond(root))


def arm_chains(skeleton: Skeleton, symmetry: Symmetry, pair: Pair) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Joints of both arms: down to where one is no single chain any more, or has no partner.

    A branch that carries no further joint (a gear, one finger of a gripper) is no continuation; where
    several carry some, or joints follow one another, the hand begins.
    """
    first, own = [pair.one], len(skeleton.robot.joints)
    leaders = {joint.leader for joint in skeleton.robot.coupled}
    while True:
        further = skeleton.next(first[-1])
        longer = [k for k in further if depth(skeleton, k) > 1] if len(further) > 1 else list(further)
        if len(longer) != 1 or not symmetry.pairs[longer[0]] or longer[0] >= own:
            break
        if skeleton.robot.tree[longer[0]].name in leaders:
            break
        first.append(longer[0])
    second = tuple(int(symmetry.partner[i]) for i in first)
    return (tuple(first), second) if len(first) >= LEAST else ((), ())
