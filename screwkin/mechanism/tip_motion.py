"""Rates and accelerations of limbs that follow their tips, on a tape: reciprocal screws, limb by limb."""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Displacement
from screwkin.algebra.se3 import ZERO, Pose, Twist, Vector
from screwkin.compiler.program import Recorder, kept
from screwkin.compiler.records import Tape, identifier, matrix, pose_input, twist_input
from screwkin.kinematics import positions
from screwkin.kinematics.tape import Formula
from screwkin.mechanism.limb_motion import LimbMotion
from screwkin.model.robot import Robot


def follows(robot: Robot, secondary: Sequence[str]) -> bool:
    """True if all joints follow the tips of limbs that share none: six joints a pose, three a position.

    Args:
        robot: the robot.
        secondary: names of the couplings that follow.
    """
    paths = [robot.path_to(limb.link) for limb in robot.limbs]
    used = sorted(i for path in paths for i in path)
    return (
        used == list(range(len(robot.joints)))
        and all(len(path) in (3, 6) for path in paths)
        and not robot.closures
        and set(robot.joint_names) <= set(secondary)
    )


@Formula
def motion(tape: Tape, robot: Robot, accelerations: bool = False) -> None:
    """Joint rates (and accelerations) from those of base and tips; tips' poses on the way.

    Limbs of six joints follow the twist of their tip, those of three joints its origin's velocity.
    """
    what = "rates and accelerations" if accelerations else "rates"
    tape.title(
        identifier(robot.name, "motion" if accelerations else "rates"),
        f"Joint {what} of {robot.name} that move base and tips as wanted, and the tips' poses; world axes,"
        " twists [omega; v of the body's origin].",
    )
    T, q = pose_input(tape, "T_world_base"), tape.input("q", len(robot.joints))
    sizes = [6 if len(robot.path_to(limb.link)) == 6 else 3 for limb in robot.limbs]

    def told(name: str, size: int) -> Twist:
        x = tape.input(name, size)
        return Twist(Vector(*x[:3]) if size == 6 else ZERO, Vector(*x[-3:]))

    base = told("base_twist", 6)
    tips = [told(identifier("twist", limb.tip), size) for limb, size in zip(robot.limbs, sizes, strict=True)]
    D = positions.link_displacements(robot, q, Displacement(T.R, ZERO, ZERO))
    limbs = [LimbMotion.of(robot, limb, D, q, best_link(robot, limb.name)) for limb in robot.limbs]
    qd: dict[int, Scalar] = {}
    qdd: dict[int, Scalar] = {}
    solved = [limb.rates(base, tip) for limb, tip in zip(limbs, tips, strict=True)]
    for limb, (rates, _) in zip(limbs, solved, strict=True):
        qd.update(zip(limb.path, rates, strict=True))
    if accelerations:
        base_rate = told("base_acceleration", 6)
        for limb, tip, size, name in zip(limbs, tips, sizes, robot.tip_names, strict=True):
            second = told(identifier("acceleration", name), size)
            found = limb.accelerations(base, tip, base_rate, second, [qd[i] for i in limb.path])
            qdd.update(zip(limb.path, found, strict=True))
    poses = [Pose(limb.tip.R, T.p + limb.tip.p) for limb in limbs]
    tape.output("T_world_tip", [x for pose in poses for x in matrix(pose)], len(poses), 4, 4)
    order = range(len(robot.joints))
    tape.output("qd", [qd[i] for i in order])
    if accelerations:
        tape.output("qdd", [qdd[i] for i in order])
    tape.output("determinant", [determinant for _, determinant in solved])


@kept
def best_link(robot: Robot, limb: str) -> int:
    """After how many joints of a limb the link stands in whose axes its rates take least.

    Of links amid the limb, by the number of operations.
    """

    def cost(joints: int) -> int:
        recorder = Recorder("trial", "")
        q = recorder.input("q", len(robot.joints))
        base, tip = twist_input(recorder, "base"), twist_input(recorder, "tip")
        R = pose_input(recorder, "T").R
        D = positions.link_displacements(robot, q, Displacement(R, ZERO, ZERO))
        rates, _ = LimbMotion.of(robot, robot.limb(limb), D, q, joints).rates(base, tip)
        recorder.output("rates", rates)
        return recorder.program().operations

    joints = len(robot.path_to(robot.limb(limb).link))
    return min(range(joints // 3, joints // 2 + 2), key=cost)
