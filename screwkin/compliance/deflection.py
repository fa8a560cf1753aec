"""Programs of elastic joints: how far a robot on one frame deflects under its weight.

The formulas of ``compliance.supported`` on graph scalars. Springs and weight are one symmetric matrix whose
pattern is the tree seen from the support: eliminated from the far joints on, it fills nothing in, and the
signs of its pivots decide stability (Sylvester's law of inertia; Golub and Van Loan 2013, 4.1 and 11.1).
"""

from __future__ import annotations

from collections.abc import Sequence

from screwkin.algebra.scalar import Scalar, abs_, sqrt, where
from screwkin.algebra.se3 import IDENTITY, NO_TWIST, Pose, Twist, Vector, rotation_log
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier, matrix, pose_input
from screwkin.compliance.supported import Supported
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.model.robot import Robot

LEAST_PIVOT = 1e-6
"""Pivot, over what it is the difference of, from which its sign is beyond rounding."""
ABOUT = (
    "stable: 1 if springs and weight resist every further deflection; certified: 1 if that is beyond rounding"
)


@kept
def linear(robot: Robot, support: str) -> Program:
    """Deflection to first order, by the torques of the posture that is commanded.

    Args:
        robot: n joints, without loops of its own, with mass.
        support: the frame that stands still: a tip, a link or ``base``.
    """
    recorder = Recorder(
        identifier(robot.name, support, "deflection"),
        f"How the elastic joints of {robot.name} deflect under its weight while {support} stands still, to"
        " first order: their deflections theta [rad], the base's pose after it, and the change of base and"
        " tips [rotation vector; translation], world axes; residual: norm of theta + torque / stiffness;"
        f" {ABOUT}.",
    )
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    k, (gravity,) = recorder.input("stiffness", len(robot.joints)), recorder.input("gravity", 1)
    here = Supported(robot, support, IDENTITY, link_displacements(robot, q), _up(T))
    theta = [-torque / x for torque, x in zip(here.gravity_torques(gravity), k, strict=True)]
    foot = here.pose(support)
    bent = _standing(robot, support, _sum(q, theta), foot.R.T @ here.up)
    twists = [
        sum((twist * theta[i] for i, twist in here.jacobian(frame).items()), start=NO_TWIST)
        for frame in frames(robot)
    ]
    pivots, _ = _eliminated(here, k, gravity, theta)
    recorder.output("theta", theta)
    recorder.output("T_world_base_after", matrix(T @ foot @ bent.pose(support).inverse), 4, 4)
    recorder.output("change", [Twist(T.R @ x.omega, T.R @ x.v) for x in twists], len(twists), 6)
    recorder.output("residual", [_residual(bent, theta, k, gravity)[1]])
    recorder.output("stable", [_stable(pivots)])
    recorder.output("certified", [_certified(pivots)])
    return recorder.program()


@kept
def newton_step(robot: Robot, support: str) -> Program:
    """A step of Newton's method towards the equilibrium of springs and weight.

    Args:
        robot: n joints, without loops of its own, with mass.
        support: the frame that stands still.
    """
    recorder = Recorder(
        identifier(robot.name, support, "newton_step"),
        f"A step of Newton's method towards the deflections theta at which springs carry {robot.name} while"
        f" {support} stands still; residual: norm of theta + torque / stiffness before the step; {ABOUT}.",
    )
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    theta = recorder.input("theta", len(robot.joints))
    k, (gravity,) = recorder.input("stiffness", len(robot.joints)), recorder.input("gravity", 1)
    foot = pose_in_base(robot, link_displacements(robot, q), support)
    bent = _standing(robot, support, _sum(q, theta), foot.R.T @ _up(T))
    r, norm = _residual(bent, theta, k, gravity)
    pivots, step = _eliminated(bent, k, gravity, [-x * y for x, y in zip(k, r, strict=True)])
    recorder.output("residual", [norm])
    recorder.output("step", step)
    recorder.output("stable", [_stable(pivots)])
    recorder.output("certified", [_certified(pivots)])
    return recorder.program()


@kept
def moved(robot: Robot, support: str) -> Program:
    """Base pose after a deflection, and the displacement of base and tips.

    Args:
        robot: n joints, without loops of its own.
        support: the frame that stands still.
    """
    recorder = Recorder(
        identifier(robot.name, support, "moved"),
        f"The base's pose after deflections theta of {robot.name} on {support}, and the change of base and"
        " tips [rotation vector; translation], world axes.",
    )
    T, q = pose_input(recorder, "T_world_base"), recorder.input("q", len(robot.joints))
    theta = recorder.input("theta", len(robot.joints))
    before = Supported(robot, support, T, link_displacements(robot, q))
    after = Supported.of(robot, support, before.pose(support), _sum(q, theta))
    pairs = [(before.pose(frame), after.pose(frame)) for frame in frames(robot)]
    recorder.output("T_world_base_after", matrix(after.base), 4, 4)
    recorder.output("change", [Twist(rotation_log(b.R @ a.R.T), b.p - a.p) for a, b in pairs], len(pairs), 6)
    return recorder.program()


def frames(robot: Robot) -> tuple[str, ...]:
    """Frames whose change is an output, in their order."""
    return ("base", *robot.tip_names)


def _sum(q: Sequence[Scalar], theta: Sequence[Scalar]) -> list[Scalar]:
    return [x + y for x, y in zip(q, theta, strict=True)]


def _up(T: Pose) -> Vector:
    """The world's vertical in the axes of a frame."""
    return Vector(T.R.x.z, T.R.y.z, T.R.z.z)


def _standing(robot: Robot, support: str, q: Sequence[Scalar], up: Vector) -> Supported:
    """The robot at q, expressed in the axes of its base, where screws have most zeros.

    ``up`` is the vertical in the axes of the support.
    """
    D = link_displacements(robot, q)
    return Supported(robot, support, IDENTITY, D, pose_in_base(robot, D, support).R @ up)


def _residual(
    here: Supported, theta: Sequence[Scalar], k: Sequence[Scalar], gravity: Scalar
) -> tuple[list[Scalar], Scalar]:
    """theta + torque / k, zero in equilibrium, and its norm."""
    r = [x + torque / y for x, torque, y in zip(theta, here.gravity_torques(gravity), k, strict=True)]
    return r, sqrt(sum(x * x for x in r))


def _eliminated(
    here: Supported, k: Sequence[Scalar], gravity: Scalar, b: Sequence[Scalar]
) -> tuple[list[tuple[Scalar, Scalar]], list[Scalar]]:
    """The matrix A of springs and weight: its pivots, each with the size of its diagonal; and x of A x = b.

    Joints far from the support first, so that eliminating one couples only joints that are coupled already.
    """
    weight = here.gravity_stiffness(gravity)
    A = {**weight, **{(i, i): x + weight.get((i, i), 0) for i, x in enumerate(k)}}
    far = [
        len(here.path(joint.parent if i in here.stance else joint.child))
        for i, joint in enumerate(here.robot.joints)
    ]
    order = sorted(range(len(k)), key=lambda i: -far[i])
    x, factors = list(b), {}
    for place, i in enumerate(order):
        near = [j for j in order[place + 1 :] if _pair(i, j) in A]
        factors[i] = [(j, A[_pair(i, j)] / A[i, i]) for j in near]
        for count, (j, factor) in enumerate(factors[i], 1):
            x[j] = x[j] - factor * x[i]
            for m in near[:count]:
                A[_pair(j, m)] = A.get(_pair(j, m), 0) - factor * A[_pair(i, m)]
    for i in reversed(order):
        x[i] = x[i] / A[i, i] - sum(factor * x[j] for j, factor in factors[i])
    return [(A[i, i], x + abs_(weight.get((i, i), 0))) for i, x in enumerate(k)], x


def _pair(i: int, j: int) -> tuple[int, int]:
    return min(i, j), max(i, j)


def _stable(pivots: Sequence[tuple[Scalar, Scalar]]) -> Scalar:
    stable: Scalar = True
    for pivot, _ in pivots:
        stable = (pivot > 0) & stable
    return where(stable, 1.0, 0.0)


def _certified(pivots: Sequence[tuple[Scalar, Scalar]]) -> Scalar:
    certified: Scalar = True
    for pivot, size in pivots:
        certified = (abs_(pivot) > LEAST_PIVOT * size) & certified
    return where(certified, 1.0, 0.0)
