"""Does the planned walk stand up to physics? A verdict with its reasons."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.agreement import agreed, settled
from screwkin.analysis.compliance import Conditions, StudyRow, Trial, repeated, summarised
from screwkin.analysis.engines import (
    AUTO,
    RIGID,
    Engine,
    Refinement,
    SimulatedCompliance,
    engines_for,
    opened,
    servo_for,
)
from screwkin.analysis.verdict import Criteria, Measured, fallen_again, reasons_of
from screwkin.compiler.run import compile_program
from screwkin.errors import InputError
from screwkin.files import text_sha256
from screwkin.gait.balance import zmp as balance_of
from screwkin.gait.compensation import stiffness_of, way_of
from screwkin.gait.ground import ground_of
from screwkin.gait.intended import intended
from screwkin.kinematics.limits import limited_joints
from screwkin.model.robot import Robot, robot_text
from screwkin.sim.camera import Camera, Picture
from screwkin.sim.feedback import Loop, Senses, WalkController
from screwkin.sim.measure import Slip, ZmpRecord, slip, speed_use, torque_needed, torque_use, zmp_record
from screwkin.sim.perturbation import NONE, Perturbation
from screwkin.sim.render import pictures
from screwkin.sim.run import Run, simulate
from screwkin.sim.self_collision import collisions_of_run
from screwkin.stabiliser.walk import stabilised
from screwkin.trajectory import Trajectory, check_joints

_MEASURED = (
    *("passed", "reasons", "fell", "fell_at", "distance", "end_error_mm", "end_turn_deg", "zmp_rms_mm"),
    *("zmp_max_mm", "ankle_rms_xy_mm", "slip_mm", "max_tilt_deg", "min_base_height"),
)
_FINER = {
    "usual": Refinement(),
    "half the step": Refinement(step=2),
    "twice the iterations": Refinement(iterations=2),
}


@dataclass(frozen=True, eq=False)
class Validation(Measured):
    """The verdict with the run it rests on; series and pictures are for reports."""

    run: Run
    zmp: ZmpRecord
    study: StudyRow | None = None
    pictures: tuple[Picture, ...] = ()


def validate(
    robot: Robot,
    trajectory: Trajectory,
    engine: Engine = "auto",
    *,
    servo: str | Path = AUTO,
    gui: bool = False,
    camera: Camera | None = None,
    criteria: Criteria | None = None,
    compliance: SimulatedCompliance | None = None,
    progress: Callable[[float], None] | None = None,
    motion: Trajectory | None = None,
    check_solver: bool = False,
    perturbation: Perturbation = NONE,
    feedback: bool = False,
) -> Validation:
    """Play the trajectory in a simulator and judge what happened.

    Args:
        robot: the robot of the trajectory.
        trajectory: what to play.
        engine: ``pybullet`` or ``mujoco`` (bodies, motors, contacts); ``auto``, all of them that are
            installed, which must agree; or ``kinematic`` (perfect tracking; never passes).
        servo: ``table`` (motors of the models that the robot's table names, sent commands that allow for
            their torque, as ``send`` does), ``rigid`` (commands are followed exactly), the name or the file
            of a servo model, for all joints; or ``auto``: ``table`` where the table names all models and the
            trajectory is a walk on two feet, else ``rigid``.
        gui: show a window, in real time.
        camera: take its pictures of what happens; they need neither display nor simulator.
        criteria: what a walk must satisfy.
        compliance: of springs for servos, and of soles; by default all are rigid. In repeated runs the robot
            may not fall.
        progress: called now and then with the share done.
        motion: what the joints do instead, as of servos that were measured; judged against the trajectory.
        check_solver: simulate at half the step and at twice the iterations too; a verdict that this changes,
            or that lies within what it changes, is undecided and has not passed.
        perturbation: what differs from the plan in the simulation; the plan stays what it is judged by.
        feedback: walk the plan's steps with the stabiliser (``stabiliser.walk``), which feels attitude,
            joints and feet, in place of its recorded commands.

    Returns:
        Validation: ``passed``, ``reasons`` and what was measured.

    Raises:
        InputError: unknown engine or servo, a trajectory of another robot, or compliance that the engine has
            not.
        MissingDependencyError: the engine is not installed.

    Example:
        >>> import screwkin as sk
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> walk = sk.walk(robot, sk.load_gait("walk"), steps=1)
        >>> sk.validate(robot, walk, "kinematic").passed        # perfect tracking proves nothing
        False
    """
    _check_fit(robot, trajectory)
    rule, report = criteria or Criteria(), progress or (lambda share: None)
    wanted = compliance or SimulatedCompliance()
    by_itself = AUTO if motion is None else RIGID
    on = servo_for(by_itself if servo == AUTO else servo, robot, trajectory, engine, wanted)
    compliance = wanted.on(on).for_trajectory(robot, trajectory)
    walk = stabilised(robot, trajectory) if feedback else None
    if walk is not None:
        compile_program(walk.program)
    commands = motion or compliance.commands(robot, trajectory)
    start = (motion or intended(robot, trajectory)).q[0]
    names, terrain = engines_for(engine, robot, compliance), ground_of(trajectory)
    ways = _FINER if check_solver and names != ("kinematic",) else {"usual": Refinement()}
    first = (0.2 if compliance.repeat else 1.0) / (len(names) * len(ways))
    done = 0

    def played(name: Engine, finer: Refinement) -> Validation:
        nonlocal done
        loop = None
        if walk is not None:
            controller = WalkController(walk, commands=commands if motion is None else None)
            loop = Loop(controller, Senses(robot, perturbation, walk.body.tips))
        backend = opened(robot, name, compliance, gui and not done, finer, terrain, perturbation)
        try:
            run = simulate(
                robot,
                commands,
                backend,
                rule.schedule,
                lambda share: report(first * (done + share)),
                start,
                perturbation,
                loop,
            )
        finally:
            backend.close()
        done += 1
        check = judged(robot, trajectory, run, rule, compliance)
        if commands is trajectory or motion is not None:
            return check
        return replace(check, **allowed_for(commands))

    checks = []
    for name in names:
        usual, *others = [played(name, way) for way in ways.values()]
        finer = dict(zip(list(ways)[1:], others, strict=True))
        checks.append(settled(usual, finer, lambda check: reasons_of(check, rule)) if finer else usual)
    check = agreed(checks)
    check = replace(check, pictures=film(robot, trajectory, check.run, camera) if camera else ())
    if not compliance.repeat or compliance.servos is None:
        return check
    first = 0.2
    conditions = Conditions(sole_stiffness=compliance.sole_stiffness)

    def later(share: float) -> None:
        report(first + (1.0 - first) * share)

    return _repeated(check, repeated(robot, trajectory, compliance.servos.stiffness, conditions, later))


def allowed_for(commands: Trajectory) -> dict[str, Any]:
    """The fields of a verdict that say how commands for motors allow for them, and for what stiffness."""
    allowed = stiffness_of(commands)
    stiffness = {**allowed} if isinstance(allowed, Mapping) else None
    return {"compensation": way_of(commands), "joint_stiffness": stiffness}


def _repeated(check: Validation, trials: Sequence[Trial]) -> Validation:
    """The verdict with repeated runs, none of which may fall."""
    (row,) = summarised(trials)
    reasons = (*check.reasons, *fallen_again(row.to_dict()))
    return replace(check, repeated=row.to_dict(), study=row, reasons=reasons, passed=not reasons)


def film(robot: Robot, trajectory: Trajectory, run: Run, camera: Camera) -> tuple[Picture, ...]:
    """Pictures of a run at even times of the trajectory, up to the end of what was seen."""
    times = np.linspace(trajectory.time[0], trajectory.time[-1], camera.pictures)
    rows = np.searchsorted(run.time, times[times <= run.time[-1] + 1e-9] - 1e-9)
    seen = run.time[rows], run.T_world_base[rows], run.q[rows]
    return tuple(pictures(robot, *seen, camera, ground_of(trajectory)))


def _check_fit(robot: Robot, trajectory: Trajectory) -> None:
    check_joints(robot, trajectory.joint_names)
    legs = [limb.tip for limb in robot.limbs if limb.kind == "leg"]
    missing = [foot for foot in legs if foot not in trajectory.feet]
    if missing:
        raise InputError(f"the trajectory has no contact of {', '.join(missing)} of robot {robot.name}")


def judged(
    robot: Robot,
    trajectory: Trajectory,
    run: Run,
    criteria: Criteria,
    compliance: SimulatedCompliance | None = None,
) -> Validation:
    """The verdict on a finished run, of compliant or rigid servos and soles."""
    compliance = (compliance or SimulatedCompliance()).for_trajectory(robot, trajectory)
    springs = compliance.servos.stiffness if compliance.servos is not None else None
    zmp, slipped = zmp_record(run, trajectory), slip(run, trajectory, robot)
    rms, largest = _deviation(zmp.contact - zmp.planned)
    ankle = None if _rods_end_at_feet(robot) else _deviation(zmp.ankle - zmp.contact)[0]
    last, planned = run.T_world_base[-1], trajectory.T_world_base
    reached = _distance(trajectory.T_world_base[0], last)
    torque, speed = torque_needed(run, robot, trajectory), speed_use(trajectory, robot)
    facts = Validation(
        passed=False,
        reasons=(),
        warnings=(
            *_warnings(robot, trajectory, run, slipped, speed),
            *_pressed(robot, run, torque, criteria.torque_share),
        ),
        engine=run.engine,
        engine_settings={run.engine: dict(run.settings)},
        servo=run.servo,
        criteria=criteria,
        fell=run.fallen_at is not None,
        fell_at=run.fallen_at,
        distance=reached,
        end_error_mm=1e3 * _distance(planned[-1], last),
        end_turn_deg=float(np.rad2deg(_turn(planned[-1], last))),
        zmp_rms_mm=max(rms) if rms else None,
        zmp_max_mm=max(largest) if largest else None,
        zmp_rms_xy_mm=rms,
        zmp_max_xy_mm=largest,
        ankle_rms_xy_mm=ankle,
        slip_mm=1e3 * slipped.largest,
        slip_total_mm=1e3 * slipped.total,
        slip_turn_deg=float(np.rad2deg(slipped.turned)),
        max_tilt_deg=float(np.rad2deg(run.tilt.max())),
        min_base_height=float(run.T_world_base[:, 2, 3].min()),
        torque_use=dict(zip(robot.joint_names, torque.tolist(), strict=True)),
        **planned_facts(robot, trajectory),
        compensation=way_of(trajectory),
        joint_stiffness=dict(springs) if isinstance(springs, Mapping) else None,
        sole_stiffness=compliance.sole_stiffness,
        repeated=None,
        engines={},
        solver=None,
        undecided=False,
        self_collisions=None if run.engine == "kinematic" else collisions_of_run(robot, trajectory, run),
        run=run,
        zmp=zmp,
    )
    reasons = (*_unmeasured(run), *reasons_of(facts, criteria))
    check = replace(facts, passed=not reasons, reasons=reasons)
    measured = check.to_dict()
    return replace(check, engines={run.engine: {name: measured[name] for name in _MEASURED}})


def planned_facts(robot: Robot, trajectory: Trajectory) -> dict[str, Any]:
    """The fields of a verdict that follow from robot and trajectory alone, without a simulator."""
    T, speed = trajectory.T_world_base, speed_use(trajectory, robot)
    return {
        "planned_distance": _distance(T[0], T[-1]),
        "min_margin_mm": 1e3 * least_margin(robot, trajectory),
        "speed_use": dict(zip(robot.joint_names, speed.tolist(), strict=True)),
        "trajectory_sha256": trajectory.sha256,
        "robot_sha256": text_sha256(robot_text(robot)),
    }


def least_margin(robot: Robot, trajectory: Trajectory) -> float:
    """The smallest margin [m], recorded or computed anew: a verdict does not rest on what a file says."""
    anew = balance_of(robot, intended(robot, trajectory))
    return float(np.min([trajectory.margin.min(), anew.margin.min()]))


def _unmeasured(run: Run) -> Iterator[str]:
    """Series of a run that hold no number where one was to be measured."""
    names = ("T_world_base", "q", "qd", "torque", "T_world_foot", "ground_wrench", "foot_force")
    for name in names:
        rows = np.asarray(getattr(run, name)).reshape(len(run.time), -1)
        bad = ~np.isfinite(rows).all(axis=1)
        if bad.any():
            yield f"the simulation gave no number for {name} at {run.time[int(bad.argmax())]:.2f} s"


def _warnings(robot: Robot, trajectory: Trajectory, run: Run, slipped: Slip, speed: Array) -> tuple[str, ...]:
    """What does not fail a walk but should be known."""
    warnings = []
    recorded = trajectory.meta.get("robot")
    if isinstance(recorded, Mapping) and recorded.get("table") != robot_text(robot):
        warnings.append(
            f"judged with another table of {robot.name} than the one that the trajectory records; it cannot "
            "be sent with this verdict"
        )
    if way_of(trajectory) != "none" and run.servo == "rigid":
        warnings.append("commands that allow for elastic servos, simulated on rigid ones")
    fast = [
        f"{joint.name} {use * joint.velocity:.1f} of {joint.velocity:.1f} rad/s"
        for joint, use in zip(limited_joints(robot), speed, strict=True)
        if use > 1.0
    ]
    if fast:
        warnings.append(f"planned joint speed above the servo's: {', '.join(fast)}")
    if "feedback" in run.settings:
        warnings.append("walked with feedback, not the recorded commands; send refuses this verdict")
    if "perturbation" in run.settings:
        warnings.append("simulated in a world other than the planned one; send refuses this verdict")
    if run.touched:
        warnings.append(f"links other than feet touched the floor: {', '.join(run.touched)}")
    if slipped.turned > np.deg2rad(5.0):
        warnings.append(f"a stance foot turns by {np.rad2deg(slipped.turned):.1f} deg")
    return tuple(warnings)


def _pressed(robot: Robot, run: Run, needed: Array, most: float) -> Iterator[str]:
    """A word on servos at their limit only because rigid legs press against each other."""
    used = torque_use(run, robot)
    names = [
        f"{name} {100 * share:.0f} % ({100 * least:.0f} % without)"
        for name, share, least in zip(robot.joint_names, used, needed, strict=True)
        if share > most >= least
    ]
    if names:
        yield f"rigid legs press their feet against each other, which no motion needs: {', '.join(names)}"


def _rods_end_at_feet(robot: Robot) -> bool:
    """Whether a loop ends at a leg's last link, so that the joint above it does not carry the foot alone."""
    feet = {limb.link for limb in robot.limbs if limb.kind == "leg"}
    return any({closure.link_a, closure.link_b} & feet for closure in robot.closures)


def _deviation(error: Array) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Root mean square and largest magnitude per axis [mm] of (M, 2) [m]; None without measurements."""
    error = 1e3 * error[np.isfinite(error).all(axis=1)]
    if not len(error):
        return None, None
    rms, largest = np.sqrt(np.mean(error**2, axis=0)), np.abs(error).max(axis=0)
    return (float(rms[0]), float(rms[1])), (float(largest[0]), float(largest[1]))


def _distance(a: Array, b: Array) -> float:
    """Horizontal distance between two poses [m]."""
    return float(np.hypot(*(b[:2, 3] - a[:2, 3])))


def _turn(a: Array, b: Array) -> float:
    """Difference of heading of two poses [rad], signed."""
    between = a[:3, :3].T @ b[:3, :3]
    return float(np.arctan2(between[1, 0], between[0, 0]))
