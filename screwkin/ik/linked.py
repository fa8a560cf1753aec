"""Limbs with linkages: the joints beside a limb's own path, and their limits, for every solution of the limb.

What a limb's joints do is solved as if they were free; then each linkage says what its motors and pins do
there. A branch counts as a solution where every linkage closes, and as inside the limits where motors and
pins are inside theirs too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.ik.linkage import with_followers
from screwkin.ik.solutions import LimbSolutions, ordered
from screwkin.kinematics import limits
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.linkages import limb_linkages, linkages
from screwkin.model.robot import Robot
from screwkin.model.state import reference_posture


def beside(robot: Robot, limb: str) -> tuple[int, ...]:
    """Indices in q of the joints of a limb's linkages that follow, or are not on the way to its tip."""
    parts = limb_linkages(robot, limb)
    return tuple(i for one in parts for i in one.joints if i not in one.path or i not in one.imposed)


def linked_chain(robot: Robot, chain: SerialChain) -> SerialChain:
    """A limb's chain whose names, places and limits go on with the joints of its linkages.

    Args:
        robot: the robot.
        chain: of one of its limbs; its screws and its tip stay those of the way to the tip.
    """
    more = list(beside(robot, chain.limb))
    lower, upper = (end[more] for end in limits.limits_of(robot))
    return replace(
        chain,
        names=(*chain.names, *(robot.joint_names[i] for i in more)),
        joints=(*chain.joints, *more),
        lower=np.concatenate([chain.lower, lower]),
        upper=np.concatenate([chain.upper, upper]),
        turning=np.concatenate([chain.turning, [robot.joints[i].type == "revolute" for i in more]]),
    )


def completed_limb(robot: Robot, chain: SerialChain, q: Array) -> tuple[Array, Array]:
    """Positions of a limb's joints and of those of its linkages, and what the linkages leave open.

    Args:
        robot: the robot.
        chain: of n joints of one of its limbs.
        q: (B, n) [rad or m].

    Returns:
        (B, m) in the order of ``linked_chain``, and (B,) [m and rad, norm].
    """
    parts, count = limb_linkages(robot, chain.limb), len(robot.joints)
    own = [(k, i) for k, i in enumerate(chain.joints) if i < count]
    whole = np.tile(np.array(reference_posture(robot), dtype=float), (len(q), 1))
    whole[:, [i for _, i in own]] = q[:, [k for k, _ in own]]
    gap = np.zeros(len(q))
    for linkage in parts:
        done = with_followers(robot, linkage, whole)
        whole, gap = done.q, np.hypot(gap, np.where(done.closed, 0.0, done.gap))
    return np.concatenate([q, whole[:, list(beside(robot, chain.limb))]], axis=1), gap


def with_linkages(robot: Robot, solutions: LimbSolutions, guess: Array) -> LimbSolutions:
    """The solutions of a limb with the joints of its linkages, judged with their limits, best first.

    Args:
        robot: the robot.
        solutions: (..., branches, n) of the limb as if its joints were free.
        guess: (..., n) or with the linkages' joints (..., m) [rad or m].
    """
    chain = solutions.chain
    assert chain is not None
    linked, batch = linked_chain(robot, chain), solutions.q.shape[:-2]
    count, (k, n) = int(np.prod(batch)), solutions.q.shape[-2:]
    q = np.asarray(solutions.q).reshape(count * k, n)
    there = np.isfinite(q).all(axis=1)
    whole, gap = np.full((len(q), len(linked.names)), np.nan), np.full(len(q), np.inf)
    whole[there], gap[there] = completed_limb(robot, chain, q[there])
    shape = (count, k)
    near = np.broadcast_to(guess, (*batch, np.shape(guess)[-1])).reshape(count, -1)
    if near.shape[1] == n:
        near, _ = completed_limb(robot, chain, near)
    return ordered(
        linked,
        solutions.method,
        np.nan_to_num(whole).reshape(*shape, -1),
        np.asarray(solutions.valid).reshape(shape) & (gap == 0).reshape(shape),
        np.hypot(np.asarray(solutions.residual).reshape(shape), gap.reshape(shape)),
        np.asarray(solutions.iterations).reshape(shape),
        near,
        batch,
    )


def first_linked(robot: Robot, solutions: LimbSolutions) -> Array:
    """Of every sample's branches the first with which all joints of the linkages are inside their limits.

    Args:
        robot: the robot.
        solutions: (B, k, n) of a limb as if its joints were free, best first.

    Returns:
        (B, n); the first branch where there is none.
    """
    chain = solutions.chain
    assert chain is not None
    linked, q = linked_chain(robot, chain), solutions.best.copy()
    left = np.arange(len(q))
    for k in range(solutions.q.shape[1]):
        left = left[solutions.valid[left, k]]
        if not len(left):
            break
        own = solutions.q[left, k]
        whole, gap = completed_limb(robot, chain, own)
        good = (gap == 0) & linked.within(whole)
        q[left[good]] = own[good]
        left = left[~good]
    return q


def carried_by_motors(robot: Robot, motors: Sequence[str], q: Array, others: Array) -> Array:
    """Positions (B, n) of all joints from those of motors: what linkages make of them.

    Args:
        robot: of n joints.
        motors: names of m joints.
        q: their positions (B, m) [rad or m].
        others: (B, n), of which the joints of no linkage count that have no motor.
    """
    whole = others.copy()
    whole[:, [robot.joint_names.index(name) for name in motors]] = q
    for linkage in linkages(robot):
        whole = with_followers(robot, linkage, whole, linkage.motors).q
    return whole
