"""Rates and accelerations of limbs from the motion of base and tips, as a program: reciprocal screws."""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar
from screwkin.algebra.screws import Displacement
from screwkin.algebra.se3 import ZERO, Pose, Twist, Vector
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, matrix, pose_input, twist_input
from screwkin.errors import InputError
from screwkin.kinematics import positions
from screwkin.kinematics.formula import formula
from screwkin.kinematics.kinds import Joints, TipTwists
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
            and {robot.tree[i].name for i in path} <= set(secondary)
            and not (own - free) & set(secondary)
        )

    return tuple(limb.name for limb in robot.limbs if solvable(limb))


@formula
def joint_rates(
    robot: Robot, T_world_base: Pose, q: Joints, base_twist: Twist, tip_twists: TipTwists
) -> list[Scalar]:
    """Joint rates that move base and tips as wanted, by reciprocal screws, limb by limb.

    Args:
        robot: n joints; its limbs share none and have six joints, or three.
        state:
        base_twist: [omega; v of the base origin], world axes.
        tip_twists: of every tip [omega; v of the tip's origin], or v alone (..., 3); of a limb of three
            joints only v matters.

    Returns:
        qd (..., n) [rad/s]. Singular limbs are not marked: ``secondary_rates`` does that.

    Raises:
        InputError: the tips' motion does not determine all joints, or a tip's twist is missing.
        ShapeError: a wrong shape, NaN or infinity, or a base pose that is not rigid.

    Example:
        >>> import numpy as np
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> still = dict.fromkeys([limb.tip for limb in robot.limbs], np.zeros(6))
        >>> forward = np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0])      # the base by 0.1 m/s, the tips stay
        >>> qd = sk.joint_rates(robot, sk.home(robot), forward, still)
        >>> qd.shape == (len(robot.joints),)
        True
    """
    limbs = _all_limbs(robot)
    for limb in limbs:
        if limb.tip not in tip_twists:
            raise InputError(f"tip_twists has no {limb.tip}")
        if len(robot.path_to(limb.link)) == 6 and tip_twists[limb.tip].omega is ZERO:
            raise InputError(f"the twist of {limb.tip} has 3 components, but its limb has six joints")
    D = positions.link_displacements(robot, q, Displacement(T_world_base.R, ZERO, ZERO))
    qd: dict[int, Scalar] = {}
    for limb in limbs:
        moved = LimbMotion.of(robot, limb, D, q, best_link(robot, limb.name))
        rates, _ = moved.rates(base_twist, tip_twists[limb.tip])
        qd.update(zip(moved.path, rates, strict=True))
    return [qd[i] for i in range(len(robot.joints))]


def _all_limbs(robot: Robot) -> tuple[Limb, ...]:
    if not robot.limbs or not follows(robot, robot.joint_names):
        raise InputError(
            f"{robot.name}: rates follow limbs of six joints, or of three, that share none and have neither "
            "loops of their own nor coupled joints; ask secondary_rates of its closed_mechanism"
        )
    return robot.limbs


@kept
def motion_program(
    robot: Robot, accelerations: bool = False, limbs: tuple[str, ...] | None = None
) -> Program:
    """Joint rates (and accelerations) of limbs from those of base and tips, and the tips' poses.

    Args:
        robot: n joints.
        accelerations: compute these too.
        limbs: such as ``solvable_limbs`` names; default: all limbs.

    Returns:
        Program of ``T_world_base q base_twist``, ``twist_TIP`` for every limb, (6,) or of three joints (3,),
        and with accelerations ``base_acceleration`` and ``acceleration_TIP``. Outputs ``T_world_tip``, ``qd``
        (and ``qdd``) of the limbs' joints in table order, and each limb's ``determinant``.

    Raises:
        InputError: without ``limbs``, the tips' motion does not determine all joints.
    """
    what = "rates and accelerations" if accelerations else "rates"
    recorder = Recorder(
        identifier(robot.name, "motion" if accelerations else "rates"),
        f"Joint {what} of {robot.name} that move base and tips as wanted, and the tips' poses; world axes,"
        " twists [omega; v of the body's origin].",
    )
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    chosen = _all_limbs(robot) if limbs is None else [robot.limb(name) for name in limbs]
    sizes = [6 if len(robot.path_to(limb.link)) == 6 else 3 for limb in chosen]

    def given(name: str, size: int) -> Twist:
        x = recorder.input(name, size)
        return Twist(Vector(*x[:3]) if size == 6 else ZERO, Vector(*x[-3:]))

    base = given("base_twist", 6)
    tips = [given(identifier("twist", limb.tip), size) for limb, size in zip(chosen, sizes, strict=True)]
    D = positions.link_displacements(robot, q, Displacement(T.R, ZERO, ZERO))
    motions = [LimbMotion.of(robot, limb, D, q, best_link(robot, limb.name)) for limb in chosen]
    solved = [limb.rates(base, tip) for limb, tip in zip(motions, tips, strict=True)]
    qd: dict[int, Scalar] = {}
    for limb, (rates, _) in zip(motions, solved, strict=True):
        qd.update(zip(limb.path, rates, strict=True))
    poses = [Pose(limb.tip.R, T.p + limb.tip.p) for limb in motions]
    recorder.output("T_world_tip", [x for pose in poses for x in matrix(pose)], len(poses), 4, 4)
    recorder.output("qd", [qd[i] for i in sorted(qd)])
    if accelerations:
        qdd: dict[int, Scalar] = {}
        base_rate = given("base_acceleration", 6)
        for limb, tip, size, row in zip(motions, tips, sizes, chosen, strict=True):
            second = given(identifier("acceleration", row.tip), size)
            values = limb.accelerations(base, tip, base_rate, second, [qd[i] for i in limb.path])
            qdd.update(zip(limb.path, values, strict=True))
        recorder.output("qdd", [qdd[i] for i in sorted(qdd)])
    recorder.output("determinant", [determinant for _, determinant in solved])
    return recorder.program()


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
