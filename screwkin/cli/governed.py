"""``send --feedback``: the IMU that is named, and what governs the play by it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Z, as_array, rotate
from screwkin.analysis.readiness import Ready
from screwkin.campaign.feedback_bound import FeedbackBound, bound_beside
from screwkin.campaign.governor import FeedbackGovernor, check_cycle
from screwkin.compiler.run import compile_program
from screwkin.errors import InputError
from screwkin.kinematics.body import frame_pose
from screwkin.model.state import State
from screwkin.servo.bus import Bus, open_line
from screwkin.servo.imu import BAUD, Imu
from screwkin.servo.line import ByteLine, Clock, MonotonicClock
from screwkin.servo.virtual.bus import VirtualBus
from screwkin.servo.virtual.imu import VirtualImu
from screwkin.sim.feedback import WalkController
from screwkin.stabiliser.walk import stabilised

VIRTUAL = "virtual"


@dataclass(frozen=True, eq=False)
class FeedbackWanted:
    """A walk that may be walked with feedback: its controller, what a campaign allows, and the IMU's port."""

    may: Ready
    controller: WalkController
    bound: FeedbackBound
    port: str

    def governor(self, line: ByteLine, clock: Clock) -> FeedbackGovernor:
        """What a player asks for goals; the IMU is read from now on."""
        line.reset_input_buffer()
        imu = Imu(line, clock)
        return FeedbackGovernor(self.controller, imu, clock.now, self.bound, self.may.bounds.names)


def imu_port(feedback: str, real: bool) -> str:
    """The port of ``imu:PORT``.

    Args:
        feedback: as the option has it.
        real: whether the servos are on a port.

    Raises:
        InputError: it names no IMU, or a virtual one beside real servos.
    """
    kind, _, port = feedback.partition(":")
    if kind != "imu" or not port:
        raise InputError(f"--feedback {feedback}: write imu:PORT, such as imu:/dev/ttyUSB1, or imu:{VIRTUAL}")
    if real == (port == VIRTUAL):
        raise InputError(
            f"--feedback imu:{VIRTUAL} goes with virtual servos, and an IMU on a port with --port: write "
            f"{'imu:/dev/ttyUSB1' if real else 'imu:' + VIRTUAL}"
        )
    return port


def feedback_wanted(path: Path, may: Ready, rate: float, port: str) -> FeedbackWanted:
    """The walk of a file with feedback, if a campaign lets it be walked so.

    Raises:
        SafetyError: none does. InputError: no stabiliser walks it, or another rate than its cycles'.
    """
    walk = stabilised(may.robot, may.trajectory)
    check_cycle(rate, WalkController.period)
    bound = bound_beside(path, may.robot, may.verdict)
    compile_program(walk.program)
    return FeedbackWanted(may, WalkController(walk, commands=may.commands), bound, port)


@contextmanager
def governed_by_imu(wanted: FeedbackWanted | None) -> Iterator[FeedbackGovernor | None]:
    """The governor by an IMU on a port, which is closed after; nothing where none is wanted.

    Raises:
        PortError: the port cannot be opened.
    """
    if wanted is None:
        yield None
        return
    line = open_line(wanted.port, BAUD)
    try:
        yield wanted.governor(line, MonotonicClock())
    finally:
        line.close()


def governed_virtually(wanted: FeedbackWanted, bus: Bus) -> FeedbackGovernor:
    """The governor by an IMU on a base whose standing foot is flat, wherever the bus's virtual servos are."""
    may, course = wanted.may, wanted.controller
    robot, mounted = may.robot, may.servos.joints
    columns = [robot.joint_names.index(servo.joint) for servo in mounted]
    assert isinstance(bus.line, VirtualBus)
    servos = bus.line.servos

    def attitude() -> Array:
        q = np.array(course.course.q)
        for column, servo, joint in zip(columns, servos, mounted, strict=True):
            q[column] = joint.direction * (servo.body.output - joint.zero)
        side, yaw = course.course.memory[[3, 6]]
        tip = course.walk.body.tips[int(side > 0.0)]
        foot = frame_pose(robot, State(np.eye(4), q), tip)[:3, :3]
        return np.asarray(as_array(rotate(Z, float(yaw))) @ foot.T)

    return wanted.governor(VirtualImu(bus.clock, attitude), bus.clock)
