"""Why a robot cannot follow a plan: a target beyond reach or limits, or a freedom that a limb has not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Pose, as_array, pose_from_array, rotation_log, unstack
from screwkin.errors import LimitError, UnreachableError
from screwkin.gait.plan import Plan
from screwkin.ik.linked import beside
from screwkin.ik.pose import solve_pose
from screwkin.ik.pose_solution import PoseSolution
from screwkin.kinematics.landmarks import limb_root, waist_frame
from screwkin.kinematics.limits import limited_joints
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain, jacobian
from screwkin.model.records import LIMIT_TOLERANCE
from screwkin.model.robot import Limb, Robot
from screwkin.model.state import State

_MISSING = 1e-6
"""Singular value, relative to the largest, below which a limb cannot move its tip in a direction."""
_FREEDOMS = (
    ("turns", "about the direction of walking"),
    ("turns", "about the sideways axis"),
    ("turns", "about the vertical"),
    ("moves", "forwards"),
    ("moves", "sideways"),
    ("moves", "up and down"),
)


Free = Mapping[str, tuple[str, ...]]
"""By tip, the rotations of its virtual chain that follow."""


def refuse_turns(robot: Robot, plan: Plan, free: Free) -> None:
    """Raise where a plan turns feet about the vertical whose limbs have no joint for it.

    Args:
        robot: the robot.
        plan: what it is to follow.
        free: rotations of tips that follow.

    Raises:
        UnreachableError: names limb, sample and time, and what to change.
    """
    for foot in plan.feet:
        R = plan.T_world_tip[foot][:, :2, 0]
        turned = np.flatnonzero(np.abs(R[:, 0] * R[0, 1] - R[:, 1] * R[0, 0]) > _MISSING)
        if "rz" in free.get(foot, ()) and len(turned):
            limb, sample = robot.limb(foot), int(turned[0])
            joints = ", ".join(robot.joints[i].name for i in robot.leading(limb.link))
            when = f"{limb.name}, sample {sample} (t = {float(plan.time[sample]):.3f} s)"
            missing = f"no joint of {limb.name} ({joints}) turns {foot} about the vertical"
            advice = f"straight and sideways walks do not; set turn = 0 (now {plan.gait.turn:.3g} rad)"
            raise UnreachableError(f"{when}: {missing}; a turn needs one, {advice}", limb.name, sample)


def refuse_unreachable(
    robot: Robot, plan: Plan, targets: Mapping[str, Array], solution: PoseSolution, free: Free
) -> None:
    """Raise for the first sample that a robot cannot follow.

    Args:
        robot: the robot.
        plan: what it is to follow.
        targets: world poses (T, 4, 4) or positions (T, 3) of the tips, by name.
        solution: of these targets.
        free: rotations of tips that follow.

    Raises:
        UnreachableError, SingularError, LimitError: name limb, sample and time.
    """
    try:
        solution.raise_on_failure(robot, plan.time)
    except (UnreachableError, LimitError) as error:
        limb, sample = robot.limb(error.limb), error.sample
        target = targets[limb.tip][sample]
        missing = _missing_freedom(robot, limb, target, solution, sample, free.get(limb.tip, ()))
        when = f"{limb.name}, sample {sample} (t = {float(plan.time[sample]):.3f} s)"
        if missing:
            raise UnreachableError(f"{when}: {missing}", limb.name, sample) from None
        raise
    for limb in robot.limbs:
        _refuse_other_branch(robot, plan, targets, solution, limb, free)


def on_other_branch(
    robot: Robot, targets: Mapping[str, Array], solution: PoseSolution, limb: Limb, free: Free
) -> NDArray[np.bool_]:
    """Samples (T,) in which a limb stands beyond a singular posture, where only limits can have put it.

    The determinant of a limb's Jacobian keeps its sign on the way from home; it is judged for limbs with as
    many joints as their targets have freedoms.

    Args:
        robot: the robot.
        targets: world poses (T, 4, 4) or positions (T, 3) of the tips, by name.
        solution: of these targets.
        limb: one of the robot's.
        free: rotations of tips that follow.
    """
    own, target = list(robot.leading(limb.link)), targets.get(limb.tip)
    q = np.reshape(solution.state.q, (-1, len(robot.joints)))
    posed = target is not None and target.shape[-2:] == (4, 4)
    chain = SerialChain.of(robot, limb.name, free.get(limb.tip, ()) if posed else (), coupled=True)
    if target is None or len(chain.joints) != (6 if posed else 3):
        return np.zeros(len(q), dtype=bool)
    q = np.concatenate([np.array(robot.posture("home").q, dtype=float)[None], q])
    virtual = np.zeros((len(q), len(chain.joints) - len(own)))
    _, J = jacobian(chain, np.hstack([q[:, own], virtual]))
    sense = np.linalg.det(J[:, slice(0 if posed else 3, 6)])
    judged = abs(sense[0]) >= _MISSING * np.abs(sense).max()
    return np.asarray((sense[1:] * sense[0] < 0) & judged)


def _refuse_other_branch(
    robot: Robot, plan: Plan, targets: Mapping[str, Array], solution: PoseSolution, limb: Limb, free: Free
) -> None:
    """Refuse samples on another branch than home's.

    Raises:
        LimitError: names limb, sample and time, and the joint that meets its limit on the way, if one does.
    """
    other = np.flatnonzero(on_other_branch(robot, targets, solution, limb, free))
    if not len(other):
        return
    path = [*robot.leading(limb.link), *beside(robot, limb.name)]
    start = np.array(robot.posture("home").q, dtype=float)
    sample, joints, endless = int(other[0]), limited_joints(robot), np.inf
    one = {name: target[sample] for name, target in targets.items()}
    unlimited = replace(
        robot,
        joints=tuple(replace(joint, lower=-endless, upper=endless) for joint in robot.joints),
        coupled=tuple(replace(joint, lower=-endless, upper=endless) for joint in robot.coupled),
    )
    near = solve_pose(unlimited, one, State(plan.T_world_base[sample], start), free=free).state.q
    beyond = [max(joints[i].lower - near[i], near[i] - joints[i].upper) for i in path]
    worst = path[int(np.argmax(beyond))]
    joint = joints[worst]
    factor, unit = (1e3, "mm") if joint.type == "prismatic" else (180 / np.pi, "deg")
    when = f"{limb.name}, sample {sample} (t = {float(plan.time[sample]):.3f} s)"
    if max(beyond) <= LIMIT_TOLERANCE:
        raise LimitError(
            f"{when}: it is bent the other way than at home, and would pass a singular posture on the way"
            " there. Move the target, or bend the posture home as this sample",
            limb.name,
            sample,
        )
    limits = f"limits {factor * joint.lower:.1f} to {factor * joint.upper:.1f} {unit}"
    raise LimitError(
        f"{when}: {joint.name} at {factor * float(near[worst]):.1f} {unit}, {limits}; bent the other way the"
        f" limb would pass a singular posture",
        limb.name,
        sample,
    )


def _missing_freedom(
    robot: Robot, limb: Limb, target: Array, solution: PoseSolution, sample: int, follow: Sequence[str]
) -> str:
    """What no joint of a limb does although the target asks for it; empty if that is not the reason.

    Rotations of the tip that ``follow`` are not asked for.
    """
    if target.shape != (4, 4):
        return ""
    own, waist = list(robot.leading(limb.link)), waist_frame(robot)
    chain = SerialChain.of(robot, limb.name, tuple(follow), coupled=True)
    home = np.array(robot.posture("home").q, dtype=float)[own]
    tip, J = jacobian(chain, np.append(home, np.zeros(len(follow)))[None])
    place = np.ravel(as_array(tip.p, (1,)))
    length = max(float(np.linalg.norm(place - as_array(limb_root(robot, limb.name)).astype(float))), 1e-3)
    axes = np.kron(np.eye(2), as_array(waist.R).astype(float).T)
    weight = np.repeat([1.0, 1 / length], 3)
    J = weight[:, None] * (axes @ J[0])
    U, values, _ = np.linalg.svd(J)
    free = U[:, int((values > _MISSING * values[0]).sum()) :]
    residual = weight * _residual(robot, limb, target, solution, sample, waist)
    asked = free.T @ residual
    if not np.linalg.norm(asked) > 0.5 * np.linalg.norm(residual):
        return ""
    verb, how = _FREEDOMS[int(np.abs(free @ asked).argmax())]
    joints = ", ".join(robot.joints[i].name for i in own)
    return f"no joint of {limb.name} ({joints}) {verb} {limb.tip} {how}, as the gait asks"


def _residual(
    robot: Robot, limb: Limb, target: Array, solution: PoseSolution, sample: int, waist: Pose
) -> Array:
    """From the tip to its target (6,): rotation vector and translation in waist axes [rad and m]."""
    q = np.reshape(solution.state.q, (-1, len(robot.joints)))[sample]
    T = pose_from_array(np.reshape(solution.state.T_world_base, (-1, 4, 4))[sample])
    D = link_displacements(robot, unstack(q))
    tip, wanted = pose_in_base(robot, D, limb.tip), T.inverse @ pose_from_array(target)
    turn, gap = rotation_log(wanted.R @ tip.R.T), wanted.p - tip.p
    return np.concatenate([as_array(waist.R.T @ v).astype(float) for v in (turn, gap)])
