"""What a plan asks of the joints: positions by closing loops, rates and accelerations by Davies' method."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import (
    Twist,
    Vector,
    as_array,
    twist_from_array,
    vector_from_array,
)
from screwkin.dynamics.support import sole_corners
from screwkin.errors import InputError
from screwkin.gait.plan import Plan
from screwkin.gait.stance import LEFT, RIGHT, Foot, Hand, Stance
from screwkin.ik.loops import PoseSolution
from screwkin.ik.whole_body import solve_samples
from screwkin.kinematics.positions import frame_pose, link_displacements
from screwkin.mechanism.choice import RANK_TOLERANCE
from screwkin.mechanism.joint_motion import joint_motion
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.rates import block_names
from screwkin.mechanism.singularity import refuse_singular
from screwkin.model.robot import Limb, Robot
from screwkin.model.state import State


def stance_of(robot: Robot) -> Stance:
    """What a gait must know of a robot, read from its table at the home posture.

    Raises:
        InputError: a fixed base, no ``home`` posture, not one leg on either side, or a leg without sole.
    """
    if robot.base != "floating":
        raise InputError(f"robot {robot.name} has a fixed base; only one with a floating base can walk")
    if "home" not in [posture.name for posture in robot.postures]:
        raise InputError(f"robot {robot.name} has no posture 'home'; a walk needs one with bent knees")
    D = link_displacements(robot, list(robot.posture("home").q))
    feet, hands, places = [], [], []
    for limb in robot.limbs:
        p = frame_pose(robot, D, limb.tip).p
        side = LEFT if p.y > 0 else RIGHT
        if limb.kind == "leg":
            outline = tuple((float(x), float(y)) for x, y, _ in sole_corners(robot, limb.tip))
            feet.append(Foot(limb.tip, side, outline, _body(robot, limb)))
            places.append(abs(float(p.y)))
        else:
            root = robot.joints[robot.path_to(limb.link)[0]].screw.s0
            hands.append(Hand(limb.tip, side, (float(root.x), float(root.y), float(root.z))))
    if sorted(foot.side for foot in feet) != [RIGHT, LEFT]:
        raise InputError(f"robot {robot.name} has {len(feet)} legs; a walk needs one on either side")
    return Stance(sum(places) / len(places), tuple(feet), tuple(hands))


def _body(robot: Robot, limb: Limb) -> tuple[tuple[float, float], ...]:
    """Corners (x, y) of the boxes of a limb's last link, in the frame of its tip [m]."""
    corners = [
        limb.frame.inverse @ (box.center + Vector(a * box.size.x, b * box.size.y, c * box.size.z) * 0.5)
        for box in robot.link(limb.link).boxes
        for a, b, c in product((-1, 1), repeat=3)
    ]
    return tuple((float(corner.x), float(corner.y)) for corner in corners)


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions and their derivatives (T, n), and every limb's least singular value (T, limbs)."""

    q: Array
    qd: Array
    qdd: Array
    sigma: Array
    limbs: tuple[str, ...]


def positions(robot: Robot, mechanism: Mechanism, made: Plan, guess: Array | None = None) -> PoseSolution:
    """Joint positions of a plan; ``guess`` (T, n) or (n,) defaults to the home posture.

    Raises:
        UnreachableError, SingularError, LimitError: names limb, sample and time.
    """
    start = np.array(robot.posture("home").q) if guess is None else guess
    targets = {"base": made.T_world_base, **_targets(robot, mechanism, made)}
    solution = solve_samples(robot, targets, State(made.T_world_base, start))
    solution.raise_on_failure(robot, made.time)
    return solution


def _targets(robot: Robot, mechanism: Mechanism, made: Plan) -> dict[str, Array]:
    """Poses of the feet; of the hands the positions, or poses level with the waist where all is imposed."""
    home = link_displacements(robot, list(robot.posture("home").q))
    targets: dict[str, Array] = dict(made.T_world_tip)
    for hand, position in made.hand_position.items():
        if not _turns(mechanism, hand):
            targets[hand] = position
            continue
        level = as_array(frame_pose(robot, home, hand).R)
        pose = made.T_world_base.copy()
        pose[:, :3, :3] = made.T_world_base[:, :3, :3] @ level
        pose[:, :3, 3] = position
        targets[hand] = pose
    return targets


def _turns(mechanism: Mechanism, tip: str) -> bool:
    """True if the rotations of a tip's chain are imposed, not monitored."""
    return any(name.startswith(f"{tip}.r") for name in mechanism.primary)


def differentiate(mechanism: Mechanism, made: Plan, state: State) -> Motion:
    """Rates and accelerations of the joints from those of the plan, by Davies' method.

    Raises:
        SingularError: names limb, sample and time.
    """
    T, q = made.T_world_base, state.q
    found = joint_motion(mechanism, T, q, _imposed(made, 0), _imposed(made, 1))
    refuse_singular(mechanism, T, q, found.sigma < RANK_TOLERANCE, made.time)
    return Motion(q, found.qd, found.qdd, found.sigma, block_names(mechanism))


def _imposed(made: Plan, order: int) -> dict[str, Twist]:
    """Twists (order 0) or their derivatives (1) of waist, feet and hands; hands turn with the waist."""
    base = twist_from_array((made.base_twist, made.base_acceleration)[order])
    tips = (made.tip_twist, made.tip_acceleration)[order]
    hands = (made.hand_velocity, made.hand_acceleration)[order]
    moved = {"waist": base, **{name: twist_from_array(value) for name, value in tips.items()}}
    return moved | {name: Twist(base.omega, vector_from_array(value)) for name, value in hands.items()}
