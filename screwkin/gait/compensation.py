"""Compensation of elastic servos: commands that make a compliant robot follow the planned motion.

A servo commanded q stands at q + theta, bent by the weight that it carries (``compliance.stiffness``). Two
remedies, both computed before the walk:

- ``swing``, the published one: in single support the position error of the other foot is subtracted from its
  target, and the leg's joints follow by inverse kinematics. The robot still sinks and leans; only the foot in
  the air is corrected.
- ``joint``: every joint is commanded q - theta. Posture and both feet are corrected. In double support the
  deflections of standing on either foot are blended by the load distribution, so that no command jumps.

In statics the robot stands still on a foot that its CoM is not above, and the ankle must hold it; in a walk
the ZMP is there. The model ``dynamic`` takes the torques tau of the walk itself and is free of that error. It
also allows for what a motor that moves takes of its own torque: with d = kt^2 / R of the back-EMF and viscous
friction, and a rotor of inertia A, the command is q + (tau + d qd + A qdd) / k.

Source: paper B, section 5, algorithm of four steps (``swing``); docs/papers.md.
"""

from __future__ import annotations

import numbers
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array, pose_from_array, unstack
from screwkin.compliance.springs import StiffnessChoice, drive_losses, joint_stiffness
from screwkin.compliance.stiffness import Deflection, static_deflection
from screwkin.compliance.stiffness import Method as StaticModel
from screwkin.errors import InputError, LimitError, NoSolutionError, one_of
from screwkin.gait.driven import at_rest, driven
from screwkin.gait.feed_forward import walking_torques
from screwkin.gait.loads import load_distribution
from screwkin.gait.realise import free_rotations
from screwkin.ik.pose import solve_pose
from screwkin.kinematics.limits import excess, limits_of, within, worst_joint
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.mechanism.choice import closed_mechanism
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.trajectory import Trajectory, check_joints

Method = Literal["swing", "joint"]
Model = Literal["linear", "nonlinear", "dynamic"]

METHODS: tuple[Method, ...] = ("swing", "joint")
MODELS: tuple[Model, ...] = ("linear", "nonlinear", "dynamic")
Way = Literal["swing", "joint", "dynamic"]
WAYS: Mapping[Way, tuple[Method, Model]] = {
    "swing": ("swing", "nonlinear"),
    "joint": ("joint", "linear"),
    "dynamic": ("joint", "dynamic"),
}
"""Method and model by name: the foot in the air, all joints by statics, all joints by the walk's torques."""
CREEP = 0.01
"""Speed around rest within which the torque for dry friction turns from one sign to the other [rad/s]."""


def compensate_walk(
    robot: Robot,
    trajectory: Trajectory,
    stiffness: StiffnessChoice = None,
    method: Method = "joint",
    passes: int = 1,
    model: Model = "nonlinear",
    damping: StiffnessChoice = None,
    armature: StiffnessChoice = None,
    friction: StiffnessChoice = None,
) -> Trajectory:
    """The trajectory with commands that allow for the servos' deflection under the robot's weight.

    Args:
        robot: the trajectory's robot, n joints.
        trajectory: the planned motion, T samples.
        stiffness: of the joints, see ``joint_stiffness``.
        method: ``swing`` moves the target of the foot in the air; ``joint`` commands q - theta.
        passes: how often the remaining error is predicted and subtracted.
        model: how deflections are predicted. For ``joint``, ``linear`` takes the torques of the planned
            posture; the compensated robot stands in it, so that the first pass is exact already. ``dynamic``,
            for ``joint`` only, takes those of the planned motion, and needs no further pass either.
        damping: what speed takes of the servos' torque, for ``dynamic``; see ``drive_losses``.
        armature: inertia of their rotors, likewise.
        friction: dry friction of their gears, likewise; it turns with the speed's sign, within ``CREEP``.

    Returns:
        Trajectory with the commanded ``q`` and ``qd``; all other fields stay those of the planned motion.
        ``meta["compensation"]`` holds method, model, passes and stiffness, for ``dynamic`` also damping,
        armature and friction.

    Raises:
        NoSolutionError: the joints are too soft for the robot's weight. UnreachableError, SingularError,
        LimitError: a compensated target or joint is out of reach. InputError: a choice is wrong, or the
        trajectory is not one of this robot's walks.
    """
    if model != "dynamic" and not (damping is None and armature is None and friction is None):
        raise InputError(f"damping, armature and friction are of model 'dynamic', not of {model!r}")
    k = joint_stiffness(robot, stiffness)
    figures = {"stiffness": k}
    *_, last = _commands(robot, trajectory, stiffness, method, passes, model)
    if model == "dynamic":
        d, inertia, dry = drive_losses(robot, stiffness, damping, armature, friction)
        held_back = dry * np.tanh(trajectory.qd / CREEP)
        last = last + (d * trajectory.qd + inertia * trajectory.qdd + held_back) / k
        figures |= {"damping": d, "armature": inertia, "friction": dry}
    q = trajectory.q + last
    _check_limits(robot, trajectory, q)
    choices = {
        "method": method,
        "model": model,
        "passes": int(passes),
        **{
            what: dict(zip(robot.joint_names, values.tolist(), strict=True))
            for what, values in figures.items()
        },
    }
    qd = trajectory.qd + change_rates(trajectory.time, last)
    return replace(trajectory, q=q, qd=qd, meta={**trajectory.meta, "compensation": choices})


@dataclass(frozen=True)
class Remaining:
    """Position error of the foot in the air after so many passes, against the nonlinear equilibrium.

    largest_mm: of |x|, |y|, |z| over the walk; norm_mm: largest distance; removed: share of the norm that the
    passes took away.
    """

    passes: int
    largest_mm: tuple[float, float, float]
    norm_mm: float
    removed: float


def convergence(
    robot: Robot,
    trajectory: Trajectory,
    stiffness: StiffnessChoice = None,
    passes: int = 5,
    method: Method = "swing",
    model: StaticModel = "nonlinear",
) -> tuple[Remaining, ...]:
    """Remaining position error of the swing foot after every pass of a compensation; row 0 is without any.

    Arguments and errors as of ``compensate_walk``. The error is measured in single support: the position of
    the other foot's tip in the nonlinear equilibrium, less the planned one, with the stance foot in place.
    """
    rows: list[Remaining] = []
    if model not in ("linear", "nonlinear"):
        raise InputError(f"model {model!r} knows no static equilibrium; valid: linear, nonlinear")
    for change in _commands(robot, trajectory, stiffness, method, passes, model):
        error = 1e3 * _swing_errors(robot, trajectory, trajectory.q + change, stiffness, "nonlinear")
        x, y, z = np.abs(error).max(axis=(0, 1)).tolist()
        norm = float(np.linalg.norm(error, axis=-1).max())
        first = rows[0].norm_mm if rows else norm
        rows.append(Remaining(len(rows), (x, y, z), norm, 1.0 - norm / first if first else 0.0))
    return tuple(rows)


def _commands(
    robot: Robot,
    trajectory: Trajectory,
    stiffness: StiffnessChoice,
    method: Method,
    passes: int,
    model: Model,
) -> Iterator[Array]:
    """What is added to the joint positions (T, n): nothing, then after each pass."""
    _check_choices(method, passes, model)
    check_joints(robot, trajectory.joint_names)
    strange = [foot for foot in trajectory.feet if foot not in robot.tip_names]
    if strange:
        raise InputError(f"the trajectory's feet {', '.join(strange)} are no tips of {robot.name}")
    shares = load_distribution(trajectory)
    change = np.zeros_like(trajectory.q)
    yield change
    shifts = np.zeros((trajectory.samples, len(trajectory.feet), 3))
    for _ in range(passes):
        if model == "dynamic":
            change = walking_torques(robot, trajectory) / joint_stiffness(robot, stiffness)
        elif method == "joint":
            at = trajectory.q if model == "linear" else trajectory.q + change
            change = -_blended_deflection(robot, trajectory, shares, at, stiffness, model)
        else:
            shifts = shifts - _swing_errors(robot, trajectory, trajectory.q + change, stiffness, model)
            change = _reached(robot, trajectory, shifts, trajectory.q + change) - trajectory.q
        yield change


def _blended_deflection(
    robot: Robot,
    trajectory: Trajectory,
    shares: Array,
    q: Array,
    stiffness: StiffnessChoice,
    model: StaticModel,
) -> Array:
    """Deflections (T, n) of standing on either foot, weighted by its share (T, 2) of the load."""
    theta = np.zeros_like(q)
    for i, share in enumerate(shares.T):
        rows = np.flatnonzero(share > 0)
        theta[rows] += share[rows, None] * _deflection(robot, trajectory, q, i, rows, stiffness, model).theta
    return theta


def _swing_errors(
    robot: Robot, trajectory: Trajectory, q: Array, stiffness: StiffnessChoice, model: StaticModel
) -> Array:
    """Position errors of feet in the air (T, feet, 3) [m]: deflected less planned; 0 for feet in contact."""
    errors = np.zeros((trajectory.samples, len(trajectory.feet), 3))
    alone = trajectory.contact.sum(axis=1) == 1
    for i in range(len(trajectory.feet)):
        rows = np.flatnonzero(alone & trajectory.contact[:, i])
        if not len(rows):
            continue
        bent = _deflection(robot, trajectory, q, i, rows, stiffness, model)
        T = pose_from_array(_standing(robot, trajectory, q, i, rows).T_world_base)
        D = link_displacements(robot, unstack(q[rows]))
        for j, foot in enumerate(trajectory.feet):
            if j != i:
                before = as_array((T @ pose_in_base(robot, D, foot)).p, (len(rows),))
                errors[rows, j] = before + bent.of(foot)[:, 3:] - trajectory.T_world_tip[foot][rows, :3, 3]
    return errors


def _standing(robot: Robot, trajectory: Trajectory, q: Array, foot: int, rows: NDArray[np.intp]) -> State:
    """The robot commanded q[rows] (B, n) on one foot, which stands where the trajectory has it."""
    stance = trajectory.feet[foot]
    own = pose_in_base(robot, link_displacements(robot, unstack(q[rows])), stance)
    base = pose_from_array(trajectory.T_world_tip[stance][rows]) @ own.inverse
    return State(as_array(base, (len(rows),)), q[rows])


def _deflection(
    robot: Robot,
    trajectory: Trajectory,
    q: Array,
    foot: int,
    rows: NDArray[np.intp],
    stiffness: StiffnessChoice,
    model: StaticModel,
) -> Deflection:
    """Deflections (B, ...) of the robot commanded q[rows] on one foot, all of them stable equilibria."""
    stance = trajectory.feet[foot]
    state = _standing(robot, trajectory, q, foot, rows)
    bent = static_deflection(robot, state, stance, stiffness, model)
    bad = rows[~(bent.converged & bent.stable)]
    if len(bad):
        raise NoSolutionError(
            f"t = {trajectory.time[bad[0]]:.3f} s: standing on {stance} the joints are too soft for the "
            f"robot's weight: no stable equilibrium in {len(bad)} of {len(rows)} samples. Raise the stiffness"
        )
    return bent


def _reached(robot: Robot, trajectory: Trajectory, shifts: Array, guess: Array) -> Array:
    """Joint positions (T, n) with the base in place and the feet beside theirs by (T, feet, 3)."""
    drive, targets = driven(robot, at_rest(trajectory)), {"base": trajectory.T_world_base}
    for i, foot in enumerate(trajectory.feet):
        targets[foot] = drive.upright(foot, trajectory.T_world_tip[foot]).copy()
        targets[foot][:, :3, 3] += shifts[:, i]
    free = free_rotations(closed_mechanism(drive.moving))
    start = State(trajectory.T_world_base, guess[:, drive.joints])
    solution = solve_pose(drive.moving, targets, start, free=free)
    solution.raise_on_failure(drive.moving, trajectory.time)
    reached = guess.copy()
    reached[:, drive.joints] = solution.state.q
    moved = (shifts != 0).any(axis=(1, 2))[:, None]
    return np.where(moved, reached, guess)


def change_rates(time: Array, change: Array) -> Array:
    """Rates (T, n) of a change of the joint positions that overshoots nowhere, though it jumps at liftoff."""
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(time, change, axis=0).derivative()(time))


def _check_limits(robot: Robot, trajectory: Trajectory, q: Array) -> None:
    lower, upper = limits_of(robot)
    if not within(q, lower, upper).all():
        row = int(excess(q, lower, upper).argmax())
        i = int(worst_joint(q[row], lower, upper))
        factor, unit = (1e3, "mm") if robot.joints[i].type == "prismatic" else (180 / np.pi, "deg")
        raise LimitError(
            f"t = {trajectory.time[row]:.3f} s: {robot.joints[i].name} is compensated to "
            f"{factor * q[row, i]:.1f} {unit}, beyond its limits {factor * lower[i]:.1f} to "
            f"{factor * upper[i]:.1f} {unit}; bend the leg less in the gait, or raise the stiffness"
        )


def way_of(trajectory: Trajectory) -> Way | Literal["none"]:
    """How a trajectory is compensated, by name.

    Raises:
        InputError: its ``meta`` names another way.
    """
    entry = trajectory.meta.get("compensation")
    if entry is None:
        return "none"
    own = (entry.get("method"), entry.get("model")) if isinstance(entry, Mapping) else (None, None)
    for way, (method, model) in WAYS.items():
        if own[0] == method and (own[1] == "dynamic") == (model == "dynamic"):
            return way
    raise InputError(f"meta names a compensation {entry!r} that is not known; valid: {', '.join(WAYS)}")


def stiffness_of(trajectory: Trajectory) -> StiffnessChoice:
    """The joints' stiffness that a trajectory is compensated for; None if it is not."""
    entry = trajectory.meta.get("compensation")
    given = entry.get("stiffness") if isinstance(entry, Mapping) else None
    return dict(given) if isinstance(given, Mapping) else None


def _check_choices(method: str, passes: object, model: str) -> None:
    for what, chosen, valid in (("method", method, METHODS), ("model", model, MODELS)):
        one_of(f"{what} of compensation", chosen, valid)
    if model == "dynamic" and method != "joint":
        raise InputError("model 'dynamic' is for method 'joint'; a foot's target is corrected by statics")
    if isinstance(passes, bool) or not isinstance(passes, numbers.Integral) or passes < 1:
        raise InputError(f"passes is {passes!r}; it must be a whole number of at least 1")
