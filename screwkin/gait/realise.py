"""What a plan asks of the joints: positions by closing loops, rates and accelerations by Davies' method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import (
    Twist,
    Vector,
    as_array,
    pose_from_array,
    twist_from_array,
    unstack,
    vector_from_array,
)
from screwkin.compiler.records import identifier
from screwkin.compiler.run import run
from screwkin.dynamics.support import sole_corners
from screwkin.errors import InputError, LimitError
from screwkin.gait.plan import Plan
from screwkin.gait.stance import LEFT, RIGHT, Foot, Hand, Stance
from screwkin.ik.pose import solve_pose
from screwkin.ik.pose_solution import PoseSolution
from screwkin.kinematics.limits import LIMIT_TOLERANCE
from screwkin.kinematics.positions import frame_pose, link_displacements
from screwkin.mechanism.least_values import least_values
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.network import blend, coupling_twists, network_matrix
from screwkin.mechanism.rates import (
    SecondarySolution,
    block_names,
    secondary_accelerations,
    secondary_rates,
)
from screwkin.mechanism.singularity import refuse_singular
from screwkin.mechanism.tip_motion import follows, motion
from screwkin.mechanism.virtual_motion import primary_motion
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
    solution = solve_pose(robot, targets, State(made.T_world_base, start))
    solution.raise_on_failure(robot, made.time)
    _refuse_jumps(robot, targets, solution.state.q, start, made.time)
    return solution


JUMP = 1.0
"""Joint step [rad] from sample to sample that only another branch of a limb can make."""


def _refuse_jumps(robot: Robot, targets: dict[str, Array], q: Array, start: Array, time: Array) -> None:
    """Refuse a motion that stays inside the limits only by another branch of a limb.

    Raises:
        LimitError: names limb, sample and time of the branch that is nearest to where the motion comes from.
    """
    before = np.vstack([np.atleast_2d(start)[:1], q[:-1]])
    turning = [joint.type == "revolute" for joint in robot.joints]
    jumps = np.flatnonzero((np.abs(q - before)[:, turning] > JUMP).any(axis=1))
    if not len(jumps):
        return
    k = int(jumps[0])
    free = tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in robot.joints)
    here = {name: target[k] for name, target in targets.items()}
    nearest = solve_pose(replace(robot, joints=free), here, State(targets["base"][k], before[k]))
    for name in nearest.limbs:
        joints = list(robot.path_to(robot.limb(name).link))
        for joint, x in ((robot.joints[i], float(nearest.state.q[i])) for i in joints):
            if not joint.lower - LIMIT_TOLERANCE <= x <= joint.upper + LIMIT_TOLERANCE:
                at = ", ".join(f"{np.degrees(value):.1f}" for value in (joint.lower, joint.upper))
                raise LimitError(
                    f"{name}, sample {k} (t = {float(time[k]):.3f} s): {joint.name} at"
                    f" {np.degrees(x):.1f} deg, limits {at} deg;"
                    " only another branch of the limb is within the limits",
                    name,
                    k,
                )


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
    """Rates and accelerations of the joints from those of the plan, through N and its derivative."""
    q, T = unstack(state.q), pose_from_array(made.T_world_base)
    if follows(robot := mechanism.robot, mechanism.secondary):
        qd, qdd = _compiled_motion(robot, made, state.q)
        sigma = least_values(mechanism, made.T_world_base, state.q)
        found = SecondarySolution(qd, sigma, block_names(mechanism))
        if found.singular.any():
            twists = coupling_twists(mechanism, T.R, q)
            refuse_singular(mechanism, network_matrix(mechanism, twists, (len(made.time),)), found, made.time)
        return Motion(state.q, qd, qdd, sigma, found.blocks)
    twists = coupling_twists(mechanism, T.R, q)
    N = network_matrix(mechanism, twists, (len(made.time),))
    first, second = _imposed(made, 0), _imposed(made, 1)
    order, batch = mechanism.primary, (len(made.time),)
    rates = primary_motion(mechanism, T, q, first)
    primary = as_array([rates[name] for name in order], batch)
    secondary = secondary_rates(mechanism, N, primary)
    refuse_singular(mechanism, N, secondary, made.time)
    everything = blend(mechanism.primary_columns, primary, mechanism.secondary_columns, secondary.values)
    accelerations = primary_motion(mechanism, T, q, first, second)
    driven = as_array([accelerations[name] for name in order], batch)
    bent = secondary_accelerations(mechanism, twists, N, everything, driven)
    changes = blend(mechanism.primary_columns, driven, mechanism.secondary_columns, bent.values)
    real = [mechanism.position[name] for name in mechanism.robot.joint_names]
    return Motion(state.q, everything[:, real], changes[:, real], secondary.sigma, secondary.blocks)


def _imposed(made: Plan, order: int) -> dict[str, Twist]:
    """Twists (order 0) or their derivatives (1) of waist, feet and hands; hands turn with the waist."""
    base = twist_from_array((made.base_twist, made.base_acceleration)[order])
    tips = (made.tip_twist, made.tip_acceleration)[order]
    hands = (made.hand_velocity, made.hand_acceleration)[order]
    moved = {"waist": base, **{name: twist_from_array(value) for name, value in tips.items()}}
    return moved | {name: Twist(base.omega, vector_from_array(value)) for name, value in hands.items()}


def _compiled_motion(robot: Robot, made: Plan, q: Array) -> tuple[Array, Array]:
    """The same rates and accelerations by the compiled reciprocal screws of each limb."""
    count, inputs = (len(made.time),), {"T_world_base": made.T_world_base, "q": q}
    inputs |= {"base_twist": made.base_twist, "base_acceleration": made.base_acceleration}
    for order, what in enumerate(("twist", "acceleration")):
        imposed = _imposed(made, order)
        for limb in robot.limbs:
            told = as_array(imposed[limb.tip], count)
            whole = len(robot.path_to(limb.link)) == 6
            inputs[identifier(what, limb.tip)] = told if whole else told[:, 3:]
    found = run(motion.program(robot, True), inputs)
    return found["qd"], found["qdd"]
