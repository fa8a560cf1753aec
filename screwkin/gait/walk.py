"""From a gait to a trajectory: plan, positions, rates, accelerations, and the balance of it all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array, unstack
from screwkin.errors import LimitError, SingularError, UnreachableError, expect
from screwkin.files import text_sha256, versions
from screwkin.gait.balance import ground_margin, ground_reaction, soles_on_floor
from screwkin.gait.driven import Driven, driven
from screwkin.gait.plan import Plan, plan
from screwkin.gait.preview_plan import preview_plan
from screwkin.gait.realise import differentiate, free_rotations, positions
from screwkin.gait.record import Gait
from screwkin.gait.stance import stance_of
from screwkin.ik.pose_solution import PoseSolution
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.mechanism.choice import closed_mechanism
from screwkin.mechanism.joint_motion import JointMotion
from screwkin.mechanism.mechanism import Mechanism
from screwkin.mechanism.rates import block_names
from screwkin.model.library import ROBOTS, data_folder
from screwkin.model.robot import Robot, robot_text
from screwkin.trajectory import Trajectory

TRACED = ("numpy", "scipy", "screwkin")
SEEN = 0.05
"""Angle from which a foot's deviation from its plan is noted [deg]."""


def walk(robot: Robot, gait: Gait, steps: int | None = None, command: str = "") -> Trajectory:
    """The whole-body trajectory of a gait.

    Args:
        robot: with two legs, soles and a ``home`` posture; arms of three joints and more swing. Joints that
            move no limb, or more than one, rest at home.
        gait: from ``load_gait``.
        steps: number of steps, at least 1; default: the gait's own, 8 unless its file says otherwise.
        command: the command line to record in the file.

    Returns:
        Trajectory; ``meta["sigma"]`` holds the least singular value of every limb, ``meta["closure"]`` the
        largest closure error.

    Raises:
        UnreachableError, SingularError, LimitError: names limb, sample and time.
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
    table = robot_text(robot)
    steps = gait.steps if steps is None else steps
    realised = _realised(robot, gait, steps)
    drive, planned = realised.drive, realised.planned
    q = drive.positions(realised.solution.state.q)
    qd, qdd = drive.rates(realised.motion.qd), drive.rates(realised.motion.qdd)
    tip_poses = _tip_poses(robot, realised, q)
    zmp, com, wrench, _ = ground_reaction(
        robot, planned.T_world_base, q, qd, qdd, planned.base_twist, planned.base_acceleration
    )
    soles = soles_on_floor(robot, planned.feet, tip_poses)
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
            "robot": {
                "name": robot.name,
                "table": table,
                "sha256": text_sha256(table),
                "path": _table_file(robot),
            },
            "gait": gait.to_dict(),
            "steps": steps,
            "boundaries": planned.boundaries.tolist(),
            "closure": float(realised.solution.residual.max()),
            "sigma": realised.sigma,
            "notes": [*planned.notes, *drive.notes, *realised.notes, *_followed(realised, tip_poses)],
            **({"at_rest": list(drive.at_rest)} if drive.at_rest else {}),
            "versions": versions(*TRACED),
            "command": command,
        },
    )


def _table_file(robot: Robot) -> str:
    """The file of the robot's own table; none for a bundled robot, or one edited since it was read."""
    path = Path(robot.path) if robot.text_matches and robot.path else None
    if path is None or not path.is_file() or path.resolve().is_relative_to(data_folder(ROBOTS).resolve()):
        return ""
    return str(path.resolve())


@dataclass(frozen=True, eq=False)
class _Realised:
    """A plan with the joint motion that follows it.

    Attributes:
        drive: what moves.
        mechanism: of what moves.
        planned: T samples.
        solution: joint positions.
        motion: joint rates and accelerations.
        notes: why limbs rest.
    """

    drive: Driven
    mechanism: Mechanism
    planned: Plan
    solution: PoseSolution
    motion: JointMotion
    notes: tuple[str, ...]

    @property
    def sigma(self) -> dict[str, float]:
        """Least singular value of every block."""
        names = block_names(self.mechanism)
        return dict(zip(names, self.motion.sigma.min(axis=0).tolist(), strict=True))


def _realised(robot: Robot, gait: Gait, steps: int) -> _Realised:
    """The walk in task space and in joints; an arm that cannot follow its hand rests at home.

    Raises:
        UnreachableError, SingularError, LimitError: a leg cannot follow; names limb, sample and time.
    """
    whole, at_rest, notes = stance_of(robot), tuple[str, ...](), tuple[str, ...]()
    while True:
        drive = driven(robot, at_rest)
        mechanism, stance = closed_mechanism(drive.moving), drive.stance(whole)
        try:
            if gait.kind == "preview":
                planned = preview_plan(mechanism, gait, stance, steps)
            else:
                planned = plan(gait, stance, steps)
            solution = positions(mechanism, planned)
            motion = differentiate(mechanism, planned, solution.state)
        except (UnreachableError, SingularError, LimitError) as error:
            if error.limb not in [limb.name for limb in robot.limbs if limb.kind != "leg"]:
                raise
            at_rest, notes = (*at_rest, error.limb), (*notes, f"{error.limb} rests: {error}")
        else:
            return _Realised(drive, mechanism, planned, solution, motion, notes)


def _followed(realised: _Realised, T_world_tip: Mapping[str, Array]) -> Iterator[str]:
    """How far rotations of feet that follow are from the plan, where one sees it."""
    for foot, free in free_rotations(realised.mechanism).items():
        if foot not in realised.planned.feet:
            continue
        limb = realised.drive.moving.limb(foot).name
        R = realised.drive.upright(foot, T_world_tip[foot])[:, :3, :3]
        turned = realised.planned.T_world_tip[foot][:, :3, :3].swapaxes(1, 2) @ R
        lean, turn = np.degrees([np.arcsin(x.clip(-1, 1)) for x in (turned[:, 2, 1], turned[:, 1, 0])])
        for name, angle, what in (("rx", lean, "leans sideways"), ("rz", turn, "turns about the vertical")):
            most = np.abs(angle).max()
            if name in free and most > SEEN:
                yield f"{foot} {what} by up to {most:.2g} deg: no joint of {limb} can keep it from that"


def _tip_poses(robot: Robot, realised: _Realised, q: Array) -> dict[str, Array]:
    """Pose of every tip: feet as planned, others, and feet with free rotations, where joints carry them."""
    D, planned = link_displacements(robot, unstack(q)), realised.planned
    T = pose_from_array(planned.T_world_base)
    carried = {*free_rotations(realised.mechanism), *realised.drive.turned}
    return {
        tip: planned.T_world_tip[tip]
        if tip in planned.T_world_tip and tip not in carried
        else as_array(T @ pose_in_base(robot, D, tip), (len(q),))
        for tip in robot.tip_names
    }
