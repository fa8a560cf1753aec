"""Which joints a gait drives: those with which legs follow poses and arms follow their hands.

A joint that moves no leg or arm, or more than one, rests at its ``home`` position, and so does the surplus
of a limb with more joints than its target asks for. The others then follow from base and tips alone, at
every sample, and their rates are the slopes of their positions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.screws import at
from screwkin.algebra.se3 import as_array
from screwkin.compiler.program import kept
from screwkin.gait.held import with_held_joints
from screwkin.gait.stance import Stance
from screwkin.gait.upright import upright
from screwkin.kinematics.positions import chain_jacobian, successive_displacement, tree_positions
from screwkin.mechanism.linkages import linkages
from screwkin.model.robot import Limb, Robot
from screwkin.trajectory import Trajectory

POSE, POSITION = 6, 3
"""Joints with which a limb follows a pose, and a position."""
_AROUND = 0.3
"""How far from home, joint by joint, the choice of a limb's joints looks [rad or m]."""
_LEAST = 0.01
"""Least room of a joint, which stands at its limit."""
_GOOD = 0.5
"""Share of the best volume from which the joints nearer to the base are taken."""


@dataclass(frozen=True, eq=False)
class Driven:
    """A robot and what a gait drives of it.

    Attributes:
        robot: the whole robot.
        moving: the robot without its held joints and without the limbs that rest, its feet's frames upright
            on their soles; itself if there is nothing to change.
        joints: indices of the moving joints among the robot's.
        home: q (n,) of the whole robot at home [rad or m].
        resting: names of the limbs that have too few joints to follow a target.
        at_rest: names of further limbs that follow none.
        turned: by tip whose frame was none on its sole, pose (4, 4) of the frame on it in that frame.
    """

    robot: Robot
    moving: Robot
    joints: tuple[int, ...]
    home: Array
    resting: tuple[str, ...]
    at_rest: tuple[str, ...]
    turned: Mapping[str, Array]

    def positions(self, q: Array) -> Array:
        """Joint positions (T, n) of the whole robot from those of the moving joints (T, m)."""
        whole = np.tile(self.home, (len(q), 1))
        whole[:, self.joints] = q
        return whole

    def rates(self, qd: Array) -> Array:
        """Rates or accelerations (T, n) of the whole robot from those of the moving joints (T, m)."""
        whole = np.zeros((len(qd), len(self.home)))
        whole[:, self.joints] = qd
        return whole

    def upright(self, tip: str, T_world_tip: Array) -> Array:
        """Poses (T, 4, 4) of the frame that a gait leads, from those of a tip."""
        turned = self.turned.get(tip)
        return T_world_tip if turned is None else T_world_tip @ turned

    def stance(self, stance: Stance) -> Stance:
        """The stance without hands that rest."""
        return replace(stance, hands=tuple(h for h in stance.hands if h.name in self.moving.tip_names))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the reader of a walk should know of limbs that rest."""
        few = f"rests: fewer than {POSITION} joints of its own cannot lead its tip"
        return tuple(f"{name} {few}" for name in self.resting)


def driven(robot: Robot, at_rest: tuple[str, ...] = ()) -> Driven:
    """What a gait drives of a robot with a ``home`` posture.

    Legs follow poses with up to six joints of their own. Arms of six joints follow poses, of any other number
    positions with the three that move the hand best; with fewer than three they rest. Linkages
    of joints that move follow them.

    Args:
        robot: with a ``home`` posture.
        at_rest: names of further limbs that follow no target.
    """
    moving, joints, home, resting, turned = _moving(robot, at_rest)
    return Driven(robot, moving or robot, joints, home, resting, at_rest, turned)


def arms_of(robot: Robot) -> tuple[str, ...]:
    """Names of the limbs that are arms."""
    return tuple(limb.name for limb in robot.limbs if limb.kind == "arm")


Parts = tuple[Robot | None, tuple[int, ...], Array, tuple[str, ...], Mapping[str, Array]]


def at_rest(trajectory: Trajectory) -> tuple[str, ...]:
    """Names of the limbs that rest in a walk though they have joints enough."""
    names = trajectory.meta.get("at_rest", ())
    return tuple(names) if isinstance(names, list | tuple) else ()


@kept
def _moving(robot: Robot, at_rest: tuple[str, ...]) -> Parts:
    """The parts of ``driven``, but None for the robot itself: what is compiled for them lasts as it does."""
    home = np.array(robot.posture("home").q, dtype=float)
    home.flags.writeable = False
    standing = upright(robot)
    turned = {
        limb.tip: as_array(limb.frame.inverse @ other.frame).astype(float)
        for limb, other in zip(robot.limbs, standing.limbs, strict=True)
        if limb.frame is not other.frame
    }
    chosen = {limb.name: _chosen(robot, limb, home) for limb in robot.limbs if limb.kind != "other"}
    few = tuple(name for name, joints in chosen.items() if not joints)
    resting = {*few, *at_rest, *(limb.name for limb in robot.limbs if limb.kind == "other")}
    moving = {i for name, joints in chosen.items() if name not in at_rest for i in joints}
    moving |= {i for linkage in linkages(robot) if moving & set(linkage.path) for i in linkage.joints}
    rest = {joint.name: float(home[i]) for i, joint in enumerate(robot.joints) if i not in moving}
    reduced = with_held_joints(standing, rest)
    if resting:
        limbs = tuple(limb for limb in reduced.limbs if limb.name not in resting)
        reduced = replace(reduced, limbs=limbs)
    return None if reduced is robot else reduced, tuple(sorted(moving)), home, few, turned


def _chosen(robot: Robot, limb: Limb, home: Array) -> tuple[int, ...]:
    """Indices of a limb's joints that move, from the base on; of coupled ones those that lead."""
    beside = [other for other in robot.limbs if other.name != limb.name and other.kind != "other"]
    others = {i for other in beside for i in robot.leading(other.link)}
    others |= {i for one in linkages(robot) for i in one.path if i not in one.imposed}  # they follow
    own = [i for i in robot.leading(limb.link) if i not in others]
    if limb.kind == "leg":
        count = min(POSE, len(own))
    else:
        count = POSE if len(own) == POSE else POSITION if len(own) >= POSITION else 0
    return tuple(own) if count == len(own) else _best(robot, limb, own, count, home)


def _best(robot: Robot, limb: Limb, own: Sequence[int], count: int, home: Array) -> tuple[int, ...]:
    """The ``count`` joints that move a tip best: largest volume of their columns, at home and around it.

    A joint counts by its room to the nearer of its limits. Joints near the base are preferred where they are
    half as good as any: so toes rest, not ankles, and wrists before elbows.
    """
    if not count:
        return ()
    path, rows = robot.path_to(limb.link), slice(0, 6) if count == POSE else slice(3, 6)
    screws, start = (
        [robot.tree[i].screw for i in path],
        np.array(tree_positions(robot, home.tolist()))[list(path)],
    )
    offsets = [np.zeros(len(path)), *(s * _AROUND * e for e in np.eye(len(path)) for s in (1, -1))]
    joints = [robot.joints[i] for i in own]
    room = {
        i: float(np.clip(min(home[i] - joint.lower, joint.upper - home[i]) / _AROUND, _LEAST, 1.0))
        for i, joint in zip(own, joints, strict=True)
    }
    total = dict.fromkeys(combinations(own, count), 0.0)
    for offset in offsets:
        thetas = list(start + offset)
        tip = successive_displacement(screws, thetas, A_ref_k=limb.frame).p
        columns = dict.fromkeys(own, np.zeros(count))
        for k, column in zip(path, chain_jacobian(screws, thetas), strict=True):
            leader, ratio = robot.gears[k]
            if leader in columns:
                twist = as_array(at(tip, column)).astype(float)
                columns[leader] = columns[leader] + float(ratio) * twist[rows]
        for choice in total:
            scaled = [room[i] * columns[i] for i in choice]
            total[choice] += abs(np.linalg.det(np.stack(scaled)))
    best = max(total.values())
    return next(choice for choice, volume in total.items() if volume >= _GOOD * best)
