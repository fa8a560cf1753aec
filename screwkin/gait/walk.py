"""From a gait to a trajectory: plan, positions, rates, accelerations, and the balance of it all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array, unstack
from screwkin.dynamics.on_floor import ground_margin, ground_reaction, soles_on_floor
from screwkin.errors import NoSolutionError, expect
from screwkin.files import versions
from screwkin.gait.follow import Followed, follow
from screwkin.gait.lengths import fitted
from screwkin.gait.listed import Footsteps, closed, with_footsteps
from screwkin.gait.plan import whole_steps
from screwkin.gait.realise import free_rotations
from screwkin.gait.record import Gait
from screwkin.gait.remedy import with_remedy
from screwkin.gait.stance import stance_of
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.recorded import robot_record
from screwkin.model.robot import Robot
from screwkin.model.sprung import sprung_joints, stiffened, with_springs
from screwkin.trajectory import Trajectory

TRACED = ("numpy", "scipy", "screwkin")
SEEN = 0.05
"""Angle from which a foot's deviation from its plan is noted [deg]."""


def walk(robot: Robot, gait: Gait, steps: int | Footsteps | None = None, command: str = "") -> Trajectory:
    """The whole-body trajectory of a gait.

    Args:
        robot: with two legs, soles and a ``home`` posture; arms of three joints and more swing. Joints that
            move no limb, or more than one, rest at home.
        gait: from ``load_gait``.
        steps: number of steps, at least 1; default: the gait's own, 8 unless its file says otherwise. Or a
            list from ``footsteps``, which a gait of kind ``preview`` or ``footsteps`` steps onto. A gait with
            ``lead``, which one over a list has unless it says otherwise, begins and ends at home; a list that
            does not end with the feet side by side then has one step more.
        command: the command line to record in the file.

    Returns:
        Trajectory; ``meta["sigma"]`` holds the least singular value of every limb, ``meta["closure"]`` the
        largest closure error.

    Raises:
        UnreachableError, SingularError, LimitError: names limb, sample and time, and the keys of the gait
            with values that work.
        GaitError, InputError: the gait does not fit the robot.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> walk = sk.walk(robot, sk.load_gait("walk"), steps=1)
        >>> bool(walk.margin.min() > 0)                 # the ZMP stays inside the support polygon
        True
    """
    expect(robot, Robot, "robot", 'load_robot("NAME")')
    expect(gait, Gait, "gait", 'load_gait("NAME")')
    if sprung_joints(robot):
        return sprung_walk(robot, walk(stiffened(robot), gait, steps, command))
    if isinstance(steps, Footsteps):
        gait, steps = with_footsteps(gait, steps), len(steps)
    gait = fitted(gait, robot)
    steps = gait.steps if steps is None else steps
    if gait.places and gait.lead:
        gait, steps = closed(gait, stance_of(robot), whole_steps(steps))
    try:
        return planned_walk(robot, gait, steps, command)
    except NoSolutionError as error:
        raise with_remedy(error, robot, gait, steps) from None


def planned_walk(robot: Robot, gait: Gait, steps: int, command: str = "") -> Trajectory:
    """The whole-body trajectory of a gait that is fitted to the robot: ``walk`` without remedies.

    Args:
        robot: with two legs, soles and a ``home`` posture.
        gait: fitted to it.
        steps: number of steps, at least 1.
        command: the command line to record in the file.

    Raises:
        UnreachableError, SingularError, LimitError: names limb, sample and time.
        GaitError, InputError: the gait does not fit the robot.
    """
    if sprung_joints(robot):
        return sprung_walk(robot, planned_walk(stiffened(robot), gait, steps, command))
    return followed_trajectory(robot, follow(robot, gait, steps), steps, command)


def followed_trajectory(robot: Robot, done: Followed, steps: int, command: str = "") -> Trajectory:
    """The trajectory of a plan that the joints follow, with its balance.

    Args:
        robot: of the plan.
        done: the plan and the joints' motion.
        steps: number of steps, to record.
        command: the command line to record in the file.
    """
    drive, planned = done.drive, done.planned
    q = drive.positions(done.solution.state.q)
    qd, qdd = drive.rates(done.motion.qd), drive.rates(done.motion.qdd)
    tip_poses = _tip_poses(robot, done, q)
    zmp, com, wrench, _ = ground_reaction(
        robot, planned.T_world_base, q, qd, qdd, planned.base_twist, planned.base_acceleration
    )
    soles = soles_on_floor(robot, planned.feet, tip_poses, planned.terrain, wrench)
    return Trajectory(
        time=planned.time,
        joint_names=robot.joint_names,
        q=q,
        qd=qd,
        qdd=qdd,
        T_world_base=planned.T_world_base,
        base_twist=planned.base_twist,
        base_acceleration=planned.base_acceleration,
        T_world_tip=tip_poses,
        contact=planned.contact,
        feet=planned.feet,
        com=com,
        zmp=zmp,
        margin=ground_margin(zmp, com, wrench, soles, planned.contact),
        meta={
            "robot": robot_record(robot),
            "gait": planned.gait.to_dict(),
            "steps": steps,
            "boundaries": planned.boundaries.tolist(),
            "closure": float(done.solution.residual.max()),
            "sigma": done.sigma,
            "notes": [*planned.notes, *drive.notes, *done.notes, *_deviations(done, tip_poses)],
            **({"at_rest": list(drive.at_rest)} if drive.at_rest else {}),
            **({} if planned.terrain.flat else {"terrain": planned.terrain.to_dict()}),
            "versions": versions(*TRACED),
            "command": command,
        },
    )


def sprung_walk(robot: Robot, walked: Trajectory) -> Trajectory:
    """A walk of ``stiffened(robot)`` as one of the robot, whose sprung joints are planned to rest."""
    return replace(
        walked,
        joint_names=robot.joint_names,
        q=with_springs(robot, walked.q),
        qd=with_springs(robot, walked.qd),
        qdd=with_springs(robot, walked.qdd),
        meta={**walked.meta, "robot": robot_record(robot)},
    )


def _deviations(done: Followed, T_world_tip: Mapping[str, Array]) -> Iterator[str]:
    """How far rotations of feet that follow are from the plan, where one sees it."""
    for foot, free in free_rotations(done.mechanism).items():
        if foot not in done.planned.feet:
            continue
        limb = done.drive.moving.limb(foot).name
        R = done.drive.upright(foot, T_world_tip[foot])[:, :3, :3]
        turned = done.planned.T_world_tip[foot][:, :3, :3].swapaxes(1, 2) @ R
        lean, turn = np.degrees([np.arcsin(x.clip(-1, 1)) for x in (turned[:, 2, 1], turned[:, 1, 0])])
        for name, angle, what in (("rx", lean, "leans sideways"), ("rz", turn, "turns about the vertical")):
            most = np.abs(angle).max()
            if name in free and most > SEEN:
                yield f"{foot} {what} by up to {most:.2g} deg: no joint of {limb} can keep it from that"


def _tip_poses(robot: Robot, done: Followed, q: Array) -> dict[str, Array]:
    """Pose of every tip: feet as planned, others, and feet with free rotations, where joints carry them."""
    D, planned = link_displacements(robot, unstack(q)), done.planned
    T = pose_from_array(planned.T_world_base)
    carried = {*free_rotations(done.mechanism), *done.drive.turned}
    return {
        tip: planned.T_world_tip[tip]
        if tip in planned.T_world_tip and tip not in carried
        else as_array(T @ pose_in_base(robot, D, tip), (len(q),))
        for tip in robot.tip_names
    }
