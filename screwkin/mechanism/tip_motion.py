"""Rates and accelerations of limbs from the motion of base and tips, as a program: reciprocal screws."""

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
from screwkin.model.robot import Limb, Robot


def solvable_limbs(robot: Robot, secondary: Sequence[str]) -> tuple[str, ...]:
    """Limbs whose joints the motion of their tips determines: six by its twist, three by its velocity.

    Args:
        robot: the robot.
        secondary: names of the secondary couplings: all joints of such a limb, none of them shared, and of
            its tip's chain at most the rotations where there are three joints, nothing where there are six.
    """
    if robot.closures:
        return ()
    paths = {limb.name: robot.path_to(limb.link) for limb in robot.limbs}

    def solvable(limb: Limb) -> bool:
        path = paths[limb.name]
        others = {i for name, other in paths.items() if name != limb.name for i in other}
        own = {f"{limb.tip}.{coupling}" for coupling in limb.chain}
        free = {f"{limb.tip}.r{axis}" for axis in "xyz"} if len(path) == 3 else set()
        return (
            len(path) in (3, 6)
            and len(own) == 6
            and not others & set(path)
            and {robot.joint_names[i] for i in path} <= set(secondary)
            and not (own - free) & set(secondary)
        )

    return tuple(limb.name for limb in robot.limbs if solvable(limb))


@Formula
def motion(
    tape: Tape, robot: Robot, accelerations: bool = False, limbs: tuple[str, ...] | None = None
) -> None:
    """Joint rates (and accelerations) of limbs from those of base and tips; tips' poses on the way.

    Limbs of six joints have a given twist of their tip, those of three joints its origin's velocity.
    ``limbs`` are such limbs that share no joints; default: all limbs. ``qd`` and ``qdd`` are of their joints,
    in the order of the table.
    """
    what = "rates and accelerations" if accelerations else "rates"
    tape.title(
        identifier(robot.name, "motion" if accelerations else "rates"),
        f"Joint {what} of {robot.name} that move base and tips as wanted, and the tips' poses; world axes,"
        " twists [omega; v of the body's origin].",
    )
    T, q = pose_input(tape, "T_world_base"), tape.input("q", len(robot.joints))
    chosen = [limb for limb in robot.limbs if limbs is None or limb.name in limbs]
    sizes = [6 if len(robot.path_to(limb.link)) == 6 else 3 for limb in chosen]

    def given(name: str, size: int) -> Twist:
        x = tape.input(name, size)
        return Twist(Vector(*x[:3]) if size == 6 else ZERO, Vector(*x[-3:]))

    base = given("base_twist", 6)
    tips = [given(identifier("twist", limb.tip), size) for limb, size in zip(chosen, sizes, strict=True)]
    D = positions.link_displacements(robot, q, Displacement(T.R, ZERO, ZERO))
    motions = [LimbMotion.of(robot, limb, D, q, best_link(robot, limb.name)) for limb in chosen]
    qd: dict[int, Scalar] = {}
    qdd: dict[int, Scalar] = {}
    solved = [limb.rates(base, tip) for limb, tip in zip(motions, tips, strict=True)]
    for limb, (rates, _) in zip(motions, solved, strict=True):
        qd.update(zip(limb.path, rates, strict=True))
    if accelerations:
        base_rate = given("base_acceleration", 6)
        for limb, tip, size, row in zip(motions, tips, sizes, chosen, strict=True):
            second = given(identifier("acceleration", row.tip), size)
            values = limb.accelerations(base, tip, base_rate, second, [qd[i] for i in limb.path])
            qdd.update(zip(limb.path, values, strict=True))
    poses = [Pose(limb.tip.R, T.p + limb.tip.p) for limb in motions]
    tape.output("T_world_tip", [x for pose in poses for x in matrix(pose)], len(poses), 4, 4)
    tape.output("qd", [qd[i] for i in sorted(qd)])
    if accelerations:
        tape.output("qdd", [qdd[i] for i in sorted(qdd)])
    tape.output("determinant", [determinant for _, determinant in solved])


def follows(robot: Robot, secondary: Sequence[str]) -> bool:
    """True if the motion of the tips determines all joints of the robot.

    Args:
        robot: the robot.
        secondary: names of the secondary couplings.
    """
    limbs = [robot.limb(name) for name in solvable_limbs(robot, secondary)]
    return sum(len(robot.path_to(limb.link)) for limb in limbs) == len(robot.joints)


@kept
def best_link(robot: Robot, limb: str) -> int:
    """After how many joints of a limb the link stands in whose axes its rates take the fewest operations.

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
