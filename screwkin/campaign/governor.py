"""A stabilised walk on servos: every frame's goals by what the robot feels, and a gate of its own.

The controller is the one of the simulations. Where a joint would come further from its plan than in the
campaign that let the walk pass, where the IMU is silent or leans, or the walk does not end, the play stops.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.campaign.feedback_bound import FeedbackBound
from screwkin.errors import InputError
from screwkin.kinematics.body import frame_pose
from screwkin.model.state import State
from screwkin.servo.imu import Imu
from screwkin.servo.watch import PlayStopped, ServoFault
from screwkin.sim.feedback import WalkController
from screwkin.stabiliser.walk import Felt

OLDEST = 0.05
"""Of the IMU's newest frame [s]."""
UPRIGHT = 0.15
"""Between the vertical of IMU and plan before the first step [rad]."""
SLACK = 0.01
"""By how much a joint may come further from its plan than in the campaign [rad]."""
LONGEST = 1.4
"""Of a walk, as a multiple of its plan's time."""


class FeedbackGovernor:
    """What a player asks for the goals of every frame; see ``player.Governor``.

    Args:
        controller: of the walk; its period is that of the frames.
        imu: on the base, axes along those of the base.
        now: the time by which the IMU's frames are dated [s].
        bound: what a campaign allows.
        names: of the joints with servos, in the order of goals.
    """

    def __init__(
        self,
        controller: WalkController,
        imu: Imu,
        now: Callable[[], float],
        bound: FeedbackBound,
        names: tuple[str, ...],
    ) -> None:
        robot = controller.walk.body.robot
        self._controller, self._imu, self._now, self._names = controller, imu, now, names
        self._columns = [robot.joint_names.index(name) for name in names]
        self._bound = np.array([bound.deviation[name] for name in robot.joint_names]) + SLACK
        self._joints = robot.joint_names
        self._longest = LONGEST * len(controller.walk.q)
        self._frames = 0
        controller.reset()

    @property
    def period(self) -> float:
        """From frame to frame [s]."""
        return self._controller.period

    @property
    def share(self) -> float:
        """Of the plan's time that is walked."""
        walk = self._controller.walk
        return walk.phase(self._controller.course) / (len(walk.q) - 1)

    @property
    def done(self) -> bool:
        """Whether the walk is at rest at its end."""
        return self.share >= 1.0

    def goals(self, measured: Array, time: float) -> Array:
        """Goals (n,) of the servos [rad], by joint positions as they were read last.

        Raises:
            PlayStopped: the walk may not go on.
        """
        reading = self._read(time)
        q = self._controller.course.q.copy()
        q[self._columns] = measured
        if not np.isfinite(q).all():
            self._stop(time, "a joint's position was never read")
        if self._frames == 0 and (lean := self._lean(reading, q)) > UPRIGHT:
            self._stop(
                time,
                f"the IMU says that the base leans by {lean:.2f} rad beside feet that stand flat, at most "
                f"{UPRIGHT:g}: mount it with its axes along the base's",
            )
        felt = Felt(reading, q, np.ones(2), np.zeros((2, 2)))
        goal = self._controller.answer(felt)
        self._frames += 1
        over = self._controller.deviation - self._bound
        if not (over <= 0.0).all():  # a number that is none is within no bound
            k = int(over.argmax())
            self._stop(
                time,
                f"{self._joints[k]} would be {self._controller.deviation[k]:.3f} rad from its plan, "
                f"allowed {self._bound[k]:.3f} after the campaign",
            )
        if self._frames > self._longest:
            self._stop(time, f"the walk lasts more than {LONGEST:g} times as long as planned")
        return np.asarray(goal[self._columns])

    def _read(self, time: float) -> Array:
        try:
            reading = self._imu.poll()
        except OSError as error:
            self._stop(time, f"the IMU's port is gone: {error}")
        if reading is None:
            self._stop(time, "the IMU has said nothing; is it in mode UART-RVC?")
        if (age := self._now() - reading.time) > OLDEST:
            self._stop(time, f"the IMU has said nothing for {age:.3f} s, at most {OLDEST:g}")
        return reading.attitude

    def _lean(self, attitude: Array, q: Array) -> float:
        """Angle between the vertical of the IMU and that of the soles, which stand flat [rad]."""
        body = self._controller.walk.body
        up = frame_pose(body.robot, State(np.eye(4), q), body.tips[0])[:3, 2]
        return float(np.arccos(np.clip(attitude[2] @ up, -1.0, 1.0)))

    def _stop(self, time: float, why: str) -> NoReturn:
        raise PlayStopped(ServoFault("feedback", "", -1, time, why))


def check_cycle(rate: float, period: float) -> None:
    """Refuse frames that are not the cycles of the walk.

    Raises:
        InputError: another rate.
    """
    if abs(rate * period - 1.0) > 1e-9:
        raise InputError(f"--rate {rate:g}: a walk with feedback goes at {1.0 / period:g} frames per second")
