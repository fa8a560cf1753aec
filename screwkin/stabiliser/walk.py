"""A planned walk, walked anew on line: its steps and rhythm, and a robot's stabiliser as a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Rotation, Vector, X, Y, as_array, rotate
from screwkin.compiler.program import Program, Recorder, kept
from screwkin.compiler.records import identifier
from screwkin.compiler.run import run
from screwkin.errors import InputError
from screwkin.gait.intended import intended
from screwkin.gait.pitch import recorded_angles
from screwkin.gait.stance import stance_of
from screwkin.kinematics.body import center_of_mass, frame_pose
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.stabiliser.body import WalkingBody, body_of
from screwkin.stabiliser.cycle import (
    STARTING,
    STEPPING,
    STOPPING,
    Ahead,
    Memory,
    Sensed,
    StabilisedBody,
    cycle,
)
from screwkin.stabiliser.law import Gains, Rhythm
from screwkin.stabiliser.odometry import Whereabouts, back_to_plan
from screwkin.stabiliser.pairs import of_row, row, scalars_in
from screwkin.stabiliser.rhythm import CYCLE, footholds_of, rhythm_of, share_of, start_of, steps_of, swings_of
from screwkin.trajectory import Trajectory

T = TypeVar("T")
STANCE, OTHER = slice(4, 7), slice(7, 10)
"""Where the feet stand in a memory's array."""
KINDS = ("preview", "footsteps")
"""Kinds of gaits that a stabiliser can walk."""


@dataclass(frozen=True, eq=False)
class Felt:
    """What a robot feels, as arrays: attitude (3, 3) of its base against the vertical, joints q (n,).

    By foot, right and left: force (2,) [N], pressure (2, 2) in the tip's axes [m]; see ``cycle.Sensed``.
    """

    attitude: Array
    q: Array
    force: Array
    pressure: Array


@dataclass(frozen=True, eq=False)
class StabilisedState:
    """Where a stabilised walk is.

    memory (k,): see ``cycle.Memory``; q (n,): commanded joint positions; landed: steps that have; time
    since the start [s]; feet: where they stand by what was felt.
    """

    memory: Array
    q: Array
    landed: int
    time: float
    feet: Whereabouts


@dataclass(frozen=True, eq=False)
class StabilisedWalk:
    """A plan and its stabiliser; nothing in it changes.

    steps: (S, 3) displacements forward, left and turn, each in the axes of the foot that stands; footholds:
    (S, 3) x, y, yaw where they land; by cycle, q (K, n): planned joint positions, and heights (K,) of the
    waist [m]; start: the course at the beginning.
    """

    body: WalkingBody
    rhythm: Rhythm
    gains: Gains
    steps: Array
    footholds: Array
    q: Array
    heights: Array
    start: StabilisedState

    @cached_property
    def program(self) -> Program:
        """Of a cycle, for the robot's every walk."""
        return stabiliser_program(self.body.robot, *self.body.tips)

    def advanced(self, course: StabilisedState, felt: Felt, feedback: bool = True) -> StabilisedState:
        """The course a cycle later, with the command for its end."""
        feet = self._felt(course, felt)
        answer = run(self.program, self.inputs(replace(course, feet=feet), felt, feedback), ())
        memory, lands = answer["memory_after"], int(answer["landed"][0])
        if lands:
            feet = feet.landed(memory[STANCE], memory[OTHER])
        return StabilisedState(
            memory, answer["goal"], course.landed + lands, course.time + float(self.rhythm.dt), feet
        )

    def _felt(self, course: StabilisedState, felt: Felt) -> Whereabouts:
        """Where the feet are: looked up at rest, and at the end of every time on both."""
        mode, tau, _, side = course.memory[:4].tolist()
        tips = self.body.tips[::-1] if side > 0.0 else self.body.tips
        feet, robot, both = course.feet, self.body.robot, float(self.rhythm.both)
        if feet.north is None:
            return feet.oriented(robot, felt.attitude, felt.q, tips[0])
        if mode == STEPPING and course.landed and both < tau <= both + float(self.rhythm.dt):
            return feet.measured(robot, felt.attitude, felt.q, (tips[0], tips[1]))
        return feet

    def coming(self, course: StabilisedState, feedback: bool = True) -> Array:
        """The step in course and the next (2, 3); with feedback they lead back to the footholds."""
        coming, k = np.zeros((2, 3)), course.landed
        rows = self.steps[k : k + 2]
        if feedback and len(rows):
            side = float(course.memory[3])
            apart = np.outer([-side, side][: len(rows)], [0.0, 2.0 * float(self.rhythm.apart), 0.0])
            rows = back_to_plan(course.feet.stance, self.footholds[k : k + 2], rows + apart) - apart
        coming[: len(rows)] = rows
        return coming

    def inputs(self, course: StabilisedState, felt: Felt, feedback: bool = True) -> dict[str, Array]:
        """What the program takes for a cycle, by name."""
        k = course.landed
        now = min(self.phase(course) + 1, len(self.heights) - 1)
        q = np.where(self._legs, course.q, self.q[now])
        return {
            **self._constant,
            "memory": course.memory,
            "attitude": felt.attitude,
            "joints": felt.q,
            "force": felt.force,
            "pressure": felt.pressure,
            "steps": self.coming(course, feedback),
            "more": np.array([float(len(self.steps) - k - 1)]),
            "height": self.heights[now : now + 1],
            "command": q,
            "feedback": np.array([float(feedback)]),
        }

    def swings(self, course: StabilisedState) -> str | None:
        """Tip of the foot that is in the air as a course's command is reached."""
        mode, tau, _, side = course.memory[:4].tolist()
        aloft = mode == STEPPING and tau - float(self.rhythm.dt) > float(self.rhythm.both) + 1e-9
        return (self.body.tips[0] if side > 0.0 else self.body.tips[1]) if aloft else None

    def phase(self, course: StabilisedState) -> int:
        """The plan's cycle in which a course is, whose steps may last longer or shorter than planned."""
        mode, tau, period = course.memory[:3].tolist()
        T = float(self.rhythm.period)
        if mode == STARTING:
            time = tau
        else:
            since = tau if mode == STOPPING else min(tau / period, 1.0) * T
            time = float(self.rhythm.beginning) + course.landed * T + since
        return min(round(time / float(self.rhythm.dt)), len(self.heights) - 1)

    def allowance(self, commands: Trajectory) -> Array:
        """What commands for servos add to the plan's joint positions (K, n), by cycle."""
        times = commands.time[0] + float(self.rhythm.dt) * np.arange(len(self.q))
        return np.asarray(commands.sampled(times)[0] - self.q)

    @cached_property
    def _legs(self) -> Array:
        """(n,) bool: joints of the legs."""
        legs = np.zeros(len(self.body.robot.joints), dtype=bool)
        legs[[i for leg in self.body.legs for i in leg.joints]] = True
        return legs

    @cached_property
    def _constant(self) -> dict[str, Array]:
        return {
            "rhythm": np.array(row(self.rhythm)),
            "gains": np.array(row(self.gains)),
            "share": np.array([self.body.share]),
        }


def stabilised(robot: Robot, trajectory: Trajectory, gains: Gains | None = None) -> StabilisedWalk:
    """The stabilised walk of a plan: its own steps, rhythm and heights, from its first posture.

    Args:
        robot: with two legs that closed forms solve.
        trajectory: of kind ``preview`` or ``footsteps``, on level ground.
        gains: of the stabiliser.

    Raises:
        InputError: the plan is no walk of steps on level ground, or a leg has no closed form.

    Example:
        >>> import screwkin as sk
        >>> from screwkin.stabiliser.walk import stabilised
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> gait = sk.load_gait("preview").replace(Tc=0.5, stride=0.05, lift=0.015, lead=1.0)
        >>> walk = stabilised(robot, sk.walk(robot, gait, steps=3))
        >>> walk.steps.shape, walk.rhythm.period
        ((3, 3), 0.5)
    """
    _check_kind(trajectory)
    plan = intended(robot, trajectory)
    stance = stance_of(robot)
    right, left = stance.foot(-1), stance.foot(1)
    body = body_of(robot, right.name, left.name, 1.0)
    swings = swings_of(plan, body.tips)
    rhythm = rhythm_of(plan, body.tips, swings, np.array(right.sole))
    begin = start_of(plan, body, rhythm, swings)
    feet = Whereabouts(np.array(begin.stance), np.array(begin.other))
    times = np.arange(plan.time[0], plan.time[-1] + 0.5 * CYCLE, CYCLE)
    waist = plan.base_sampled(times) @ np.linalg.inv(as_array(body.T_waist_base))
    return StabilisedWalk(
        body=replace(body, share=share_of(plan, body)),
        rhythm=rhythm,
        gains=gains or Gains(),
        steps=steps_of(plan, body.tips, rhythm, swings),
        footholds=footholds_of(plan, body.tips, swings),
        q=plan.sampled(times)[0],
        heights=waist[:, 2, 3],
        start=StabilisedState(np.array(row(begin)), np.array(plan.q[0]), 0, 0.0, feet),
    )


def _check_kind(trajectory: Trajectory) -> None:
    """Refuse gaits of other CoM than a pendulum's, or feet that pitch; what records no gait is a plan."""
    recorded = trajectory.meta.get("gait")
    table = recorded.get("gait") if isinstance(recorded, Mapping) else None
    kind = table.get("kind") if isinstance(table, Mapping) else None
    if kind is not None and kind not in KINDS:
        raise InputError(f"a stabiliser walks plans of gaits of kind {' or '.join(KINDS)}, not {kind}")
    if turned := recorded_angles(trajectory):
        raise InputError(f"a stabiliser keeps soles level; plan the walk without {turned}")


def stabiliser_of(robot: Robot) -> Program:
    """The stabiliser's cycle of a robot, whose feet are those of its gaits.

    Raises:
        InputError: the robot cannot walk, or a leg has no closed form.
    """
    stance = stance_of(robot)
    return stabiliser_program(robot, stance.foot(-1).name, stance.foot(1).name)


def cycle_in_a_step(robot: Robot) -> dict[str, Array]:
    """Inputs of a cycle in the middle of a step of a robot that stands as at home, pushed and leaning."""
    stance, home = stance_of(robot), robot.posture("home")
    corners = np.array(stance.foot(-1).sole)
    (ahead, aside), half = np.mean(corners, axis=0), 0.5 * np.ptp(corners, axis=0)
    q, apart = np.array(home.q, dtype=float), stance.foot_y
    state = State(np.eye(4), q)
    tips = stance.foot(-1).name, stance.foot(1).name
    sole = min(float(frame_pose(robot, state, tip)[2, 3]) for tip in tips)
    com_height = float(center_of_mass(robot, state)[2]) - sole
    height = float((np.linalg.inv(as_array(stance.T_waist_base)) @ np.eye(4))[2, 3]) - sole
    rhythm = Rhythm(0.4, 0.25, 0.1 * apart, com_height, apart, tuple(half), (float(ahead), -float(aside)))
    still = (0.0, 0.0)
    memory = Memory(
        mode=STEPPING,
        tau=0.2,
        period=0.4,
        side=1.0,
        stance=(0.0, apart, 0.0),
        other=(-0.1 * apart, -apart, 0.0),
        com=(0.0, 0.5 * apart),
        rate=(0.5 * apart, 0.1 * apart),
        zmp=(0.0, 0.8 * apart),
        held=still,
        place=(0.1 * apart, -1.9 * apart),
        seen=1.0,
        gap=(0.001, -0.002),
        gap_rate=(0.01, 0.0),
        error=(0.001, 0.001),
        slope=still,
        lean=(0.01, -0.02),
        lasting=still,
        waist=(0.0, 0.5 * apart),
    )
    lean = as_array(rotate(X, 0.02) @ rotate(Y, -0.03))
    return {
        "rhythm": np.array(row(rhythm)),
        "gains": np.array(row(Gains())),
        "memory": np.array(row(memory)),
        "share": np.array([0.75]),
        "attitude": lean,
        "joints": q,
        "force": np.array([0.0, 9.81 * float(robot.mass)]),
        "pressure": np.full((2, 2), 0.1 * apart),
        "steps": np.array([[apart, 0.0, 0.05], [apart, 0.0, 0.0]]),
        "more": np.array([3.0]),
        "height": np.array([height]),
        "command": q,
        "feedback": np.array([1.0]),
    }


@kept
def stabiliser_program(robot: Robot, right: str, left: str) -> Program:
    """A cycle of a robot's stabilised walk as a straight-line program; see ``stabiliser.cycle``.

    Args:
        robot: with two legs that closed forms solve.
        right: tip of its right foot.
        left: tip of its left foot.
    """
    recorder = Recorder(
        identifier(robot.name, "stabiliser"),
        f"One cycle of a stabilised walk of {robot.name}: memory and joint positions after it; landed: 1 if a"
        " foot landed in it.",
    )

    def record(kind: type[T], name: str) -> T:
        return of_row(kind, recorder.input(name, scalars_in(kind)))

    rhythm, gains, memory = record(Rhythm, "rhythm"), record(Gains, "gains"), record(Memory, "memory")
    (share,) = recorder.input("share", 1)
    walker = StabilisedBody(body_of(robot, right, left, share), rhythm, gains)
    a = recorder.input("attitude", 3, 3)
    attitude = Rotation(*(Vector(a[k], a[3 + k], a[6 + k]) for k in range(3)))
    n = len(robot.joints)
    q = recorder.input("joints", n)
    force = recorder.input("force", 2)
    p = recorder.input("pressure", 2, 2)
    steps = recorder.input("steps", 2, 3)
    (more,), (height,) = recorder.input("more", 1), recorder.input("height", 1)
    command, (feedback,) = recorder.input("command", n), recorder.input("feedback", 1)
    senses = Sensed(attitude, q, (force[0], force[1]), ((p[0], p[1]), (p[2], p[3])))
    first, second = ((steps[k], steps[k + 1], steps[k + 2]) for k in (0, 3))
    after, joints, landed = cycle(
        walker, memory, senses, Ahead((first, second), more, height), command, feedback
    )
    recorder.output("memory_after", row(after))
    recorder.output("goal", joints)
    recorder.output("landed", [landed])
    return recorder.program()
