"""Kernels of the whole body: poses, Jacobians, rates and accelerations, centre of mass and ZMP.

Each runs the public formulas once on graph scalars and is a ``Program`` with named inputs and outputs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

from screwkin.dynamics.newton_euler import GRAVITY, Bodies, ground_wrench, momentum
from screwkin.dynamics.zmp import cart_table_zmp, zmp_from_wrench
from screwkin.kernel.program import Program, Recorder
from screwkin.kernel.records import identifier, matrix, pose_input, twist_input
from screwkin.kinematics import positions
from screwkin.kinematics.mass import center_of_mass
from screwkin.model.robot import Robot
from screwkin.scalar import Scalar
from screwkin.screw import Displacement, at, wrench_at
from screwkin.se3 import ZERO, Pose, Twist, Vector
from screwkin.solve.limb_motion import LimbMotion


@cache
def tip_poses(robot: Robot) -> Program:
    """World poses of all tips."""
    return _poses(robot, "tip", lambda D: [positions.frame_pose(robot, D, limb.tip) for limb in robot.limbs])


@cache
def link_poses(robot: Robot) -> Program:
    """World poses of all links."""
    return _poses(robot, "link", lambda D: [d @ x.frame for d, x in zip(D, robot.links, strict=True)])


def _poses(robot: Robot, what: str, of: Callable[[Sequence[Displacement]], list[Pose]]) -> Program:
    recorder = Recorder(identifier(robot.name, f"{what}s"), f"World poses of the {what}s of {robot.name}.")
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    poses = [T @ pose for pose in of(positions.link_displacements(robot, q))]
    recorder.output(f"T_world_{what}", [x for pose in poses for x in matrix(pose)], len(poses), 4, 4)
    return recorder.program()


@cache
def mass_center(robot: Robot) -> Program:
    """World position of the centre of mass."""
    recorder = Recorder(identifier(robot.name, "com"), f"Centre of mass of {robot.name}, in the world.")
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    recorder.output("com", T @ center_of_mass(robot, positions.link_displacements(robot, q)))
    return recorder.program()


@cache
def limb_jacobian(robot: Robot, limb: str) -> Program:
    """Compact Jacobian of a tip: one column for every joint of its limb."""
    chosen = robot.limb(limb)
    path = robot.path_to(chosen.link)
    recorder = Recorder(
        identifier(robot.name, chosen.name, "jacobian"),
        f"Jacobian of {chosen.tip} of {robot.name}: rows [omega; v of the tip's origin], base axes; a column"
        " for every joint of the limb.",
    )
    q = recorder.input("q", len(robot.joints))
    D = positions.link_displacements(robot, q)
    tip = positions.frame_pose(robot, D, chosen.tip).p
    screws = positions.joint_screws(robot, D)
    columns = [at(tip, screws[i].twist) for i in path]
    rows = zip(*([*c.omega, *c.v] for c in columns), strict=True)
    recorder.output("J", [x for row in rows for x in row], 6, len(path))
    return recorder.program()


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


@cache
def motion(robot: Robot, accelerations: bool = False) -> Program:
    """Joint rates (and accelerations) from those of base and tips; tips' poses on the way.

    Limbs of six joints follow the twist of their tip, those of three joints its origin's velocity.
    """
    what = "rates and accelerations" if accelerations else "rates"
    recorder = Recorder(
        identifier(robot.name, "motion" if accelerations else "rates"),
        f"Joint {what} of {robot.name} that move base and tips as wanted, and the tips' poses; world axes,"
        " twists [omega; v of the body's origin].",
    )
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    sizes = [6 if len(robot.path_to(limb.link)) == 6 else 3 for limb in robot.limbs]

    def told(name: str, size: int) -> Twist:
        x = recorder.input(name, size)
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
    recorder.output("T_world_tip", [x for pose in poses for x in matrix(pose)], len(poses), 4, 4)
    order = range(len(robot.joints))
    recorder.output("qd", [qd[i] for i in order])
    if accelerations:
        recorder.output("qdd", [qdd[i] for i in order])
    recorder.output("determinant", [determinant for _, determinant in solved])
    return recorder.program()


@cache
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


@cache
def centroidal_momentum(robot: Robot) -> Program:
    """Momentum [angular about the CoM; linear], world axes."""
    recorder = Recorder(
        identifier(robot.name, "momentum"),
        f"Momentum of {robot.name} [angular about the centre of mass; linear], world axes.",
    )
    n = len(robot.joints)
    T, q, qd = pose_input(recorder, "T_world_base"), recorder.input("q", n), recorder.input("qd", n)
    bodies = Bodies.of(robot, T.R, q)
    h = momentum(bodies, qd, twist_input(recorder, "base_twist"))
    h = wrench_at(center_of_mass(robot, bodies.poses), h)
    recorder.output("momentum", [*h.m, *h.f])
    return recorder.program()


@cache
def balance(robot: Robot) -> Program:
    """CoM, centroidal momentum, ground wrench, ZMP and the cart-table's ZMP."""
    recorder = Recorder(
        identifier(robot.name, "zmp"),
        "Centre of mass, momentum [angular about it; linear], ground wrench [m; f] about the world origin,"
        f" ZMP and cart-table ZMP of {robot.name}; world axes.",
    )
    n = len(robot.joints)
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", n)
    qd, qdd = recorder.input("qd", n), recorder.input("qdd", n)
    twist, rate = twist_input(recorder, "base_twist"), twist_input(recorder, "base_acceleration")
    bodies = Bodies.of(robot, T.R, q)
    wrench = ground_wrench(bodies, qd, qdd, twist, rate, GRAVITY)
    local = center_of_mass(robot, bodies.poses)
    com = T.p + local
    h = wrench_at(local, momentum(bodies, qd, twist))
    rise = wrench.f * (1.0 / robot.mass)
    cart = cart_table_zmp(com, Vector(rise.x, rise.y, rise.z - GRAVITY), GRAVITY)
    about, zmp = wrench_at(-T.p, wrench), zmp_from_wrench(wrench, T.p)
    recorder.output("com", com)
    recorder.output("momentum", [*h.m, *h.f])
    recorder.output("wrench", [*about.m, *about.f])
    recorder.output("zmp", [zmp.x, zmp.y])
    recorder.output("cart_table", [cart.x, cart.y])
    return recorder.program()
