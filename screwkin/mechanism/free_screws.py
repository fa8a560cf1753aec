"""What a singular block of couplings leaves free: a motion that no primary coupling decides, and a wrench.

Both belong to the smallest singular value of the block's secondary screws. Its right vector sets links in
motion while the primary couplings rest; its left vector is a wrench that does no work on any secondary
coupling, so that only the primary ones carry it.

Source: Hunt (1978), Kinematic geometry of mechanisms; Fichter (1986), A Stewart platform-based manipulator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.mechanism.mechanism import Mechanism, welded_links
from screwkin.mechanism.rates import block_rows
from screwkin.mechanism.scaling import centre, characteristic_length
from screwkin.mechanism.screw_text import ScrewLine, twist_screw, wrench_screw
from screwkin.model.records import FLOOR

ALONE = 0.05
"""Share of the largest circuit's wrench below which another circuit takes no part."""
MOVING = 0.1
"""Share of the largest link motion from which on a link counts as moving."""


@dataclass(frozen=True)
class FreeScrews:
    """Motion and wrench of a singular block; places from the base's origin, world axes [m].

    Attributes:
        body: the link that moves: of those with most couplings, the one that moves most.
        motion: its motion while the primary couplings rest.
        wrench: of a block of one circuit, the wrench that does no work on any secondary coupling: only the
            primary ones carry it. Of more circuits, the wrench on the axis of the motion that does no work on
            it: on this axis the couplings carry a wrench of this pitch, in more than one way, and none other.
    """

    body: str
    motion: ScrewLine
    wrench: ScrewLine


def free_screws(mechanism: Mechanism, block: int, N: Array, S: Array, null: float) -> FreeScrews:
    """Motion and wrench of one block.

    Args:
        mechanism: the closed mechanism.
        block: index in ``mechanism.blocks``.
        N: its network matrix at one state, formed at the base origin.
        S: screws of all edges there (6, edges).
        null: singular values below this one count as zero.
    """
    circuits, inside = mechanism.blocks[block]
    size, middle = characteristic_length(mechanism.robot), centre(S)
    columns = [mechanism.secondary_columns[i] for i in inside]
    local = _at(N[block_rows(circuits)], middle, size)
    rates = np.zeros(len(mechanism.couplings))
    rates[columns] = np.linalg.svd(local[:, columns])[2][-1]
    body, twist = _moving_body(
        mechanism, free_link_twists(mechanism, S, mechanism.gears @ rates), middle, size
    )
    motion = twist_screw(twist, middle, size)
    wrench = _free_wrench(local, columns, mechanism.primary_columns, null, middle, size)
    if wrench is None:
        wrench = _on_the_axis(motion)
    return FreeScrews(body, motion, wrench_screw(wrench, middle, size))


def free_link_twists(mechanism: Mechanism, S: Array, rates: Array) -> dict[str, Array]:
    """Twist (6,) of every link, virtual ones included, when all edges move at some rates."""
    twists, edges = {FLOOR: np.zeros(6)}, list(enumerate(mechanism.graph.edges))
    if FLOOR not in mechanism.links:
        twists = {mechanism.links[0]: np.zeros(6)}
    while edges:
        reached = [(i, edge) for i, edge in edges if {edge[1], edge[2]} & set(twists)]
        if not reached:
            break
        for i, (_, tail, head) in reached:
            if tail in twists:
                twists.setdefault(head, twists[tail] + S[:, i] * rates[i])
            else:
                twists[tail] = twists[head] - S[:, i] * rates[i]
        edges = [pair for pair in edges if pair not in reached]
    return twists


def _at(N: Array, point: Array, size: float) -> Array:
    """Rows [omega; v at the point over the size] of every circuit."""
    rows = N.reshape(-1, 6, N.shape[-1])
    moved = rows[:, 3:] + np.cross(rows[:, :3], point[None, :, None], axis=1)
    return np.concatenate([rows[:, :3], moved / size], axis=1).reshape(N.shape)


def _moving_body(
    mechanism: Mechanism, twists: dict[str, Array], middle: Array, size: float
) -> tuple[str, Array]:
    """The link that moves, and how: of links with most couplings, the one that moves most."""
    robot = mechanism.robot
    vertex = welded_links(robot, robot.closures)
    named = [joint.parent for joint in robot.tree] + [joint.child for joint in robot.tree]
    named += [link for c in robot.closures for link in (c.link_a, c.link_b)]
    named += [limb.link for limb in robot.limbs]
    speeds, degree = {}, {}
    for name in robot.link_names:
        if vertex[name] in twists:
            omega, v = np.split(twists[vertex[name]], 2)
            both = np.concatenate([omega, (v + np.cross(omega, middle)) / size])
            speeds[name] = round(float(np.linalg.norm(both)), 9)  # equal of links that are one
            degree[name] = sum(vertex[name] in ends for _, *ends in mechanism.graph.edges)
    fastest = max(speeds.values())

    def rank(name: str) -> tuple[bool, int, float, int]:
        return speeds[name] > MOVING * fastest, degree[name], speeds[name], named.count(name)

    body = max(speeds, key=rank)
    return body, twists[vertex[body]]


def _free_wrench(
    local: Array, secondary: Sequence[int], primary: Sequence[int], null: float, middle: Array, size: float
) -> Array | None:
    """The wrench [m; f about the origin] that only primary couplings carry, if one circuit transmits it."""
    U, sigma, _ = np.linalg.svd(local[:, secondary])
    free = U[:, np.concatenate([sigma, np.zeros(len(U) - len(sigma))]) < max(null, sigma[-1] * (1 + 1e-9))]
    inner, works, _ = np.linalg.svd(free.T @ local[:, primary], full_matrices=False)
    vector = free @ inner[:, 0] if len(works) and works[0] > 1e-9 else U[:, len(sigma) - 1]
    parts = vector.reshape(-1, 6)
    sizes = np.linalg.norm(parts, axis=1)
    if (sizes > ALONE * sizes.max()).sum() > 1:
        return None
    part = parts[sizes.argmax()]
    m, f = part[:3], part[3:] / size  # power is m . omega + f . v, the rows hold v over the size
    return np.concatenate([m + np.cross(middle, f), f])


def _on_the_axis(motion: ScrewLine) -> Array:
    """The wrench [m; f] on the axis of a motion that does no work on it."""
    axis, point = np.array(motion.axis), np.array(motion.point)
    if np.isinf(motion.pitch):
        return np.concatenate([axis, np.zeros(3)])
    return np.concatenate([np.cross(point, axis) - motion.pitch * axis, axis])
