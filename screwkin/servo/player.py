"""Plays a trajectory on servos, watches them, and leaves them in the state it announces.

The order: read all servos and refuse what looks wrong; goals to where they are, torque on; a soft start to
the first sample; the trajectory, frame by frame on an absolute schedule; at rest for a moment; hold or go
limp. Whatever goes wrong, the servos are brought into the state for faults before anything else happens.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError, SafetyError
from screwkin.model.robot import Robot
from screwkin.servo.budget import budget
from screwkin.servo.bus import Bus
from screwkin.servo.examine import mending, servo_registers_differ
from screwkin.servo.frames import Frames, approach, frames_of, run_out
from screwkin.servo.gate import Bounds, Gate
from screwkin.servo.guarded import Guard, NoGuard
from screwkin.servo.leave import EndState, Final, leave
from screwkin.servo.line import BusError, LineLostError, Reply
from screwkin.servo.log import Log
from screwkin.servo.reading import Readings
from screwkin.servo.watch import FaultKind, PlayStopped, ServoFault, Thresholds, Watch
from screwkin.trajectory import Trajectory

_NEWEST = 0.4  # share of the newest reading in how far a joint is behind its goal; a tick is no jump
_SLACK = 0.1  # s, beyond what a late frame may be late, after which a player hangs


@dataclass(frozen=True)
class PlaySettings:
    """How to play.

    rate [Hz]; torque: share of what the limits allow; start_speed [rad/s] of the soft start; far [rad]: a
    greater distance from the measured pose to the first sample is refused; settle [s] at rest after the last
    sample; stop [s]: time to come to rest when asked to; tolerance [s]: a frame sent later counts as late;
    on_fault, at_end: what the servos are left in.
    """

    rate: float = 50.0
    torque: float = 1.0
    start_speed: float = 0.5
    far: float = 1.0
    settle: float = 0.5
    stop: float = 0.4
    tolerance: float = 0.002
    on_fault: EndState = "hold"
    at_end: EndState = "hold"
    thresholds: Thresholds = field(default_factory=Thresholds)


@dataclass(frozen=True, eq=False)
class PlayOutcome:
    """The result of a play; ``final`` is the state in which the servos were left."""

    frames: int
    late_frames: int
    max_tracking_error: float
    faults: tuple[ServoFault, ...]
    final: Final
    log: Log

    @property
    def known(self) -> bool:
        """Whether every servo confirmed how it was left."""
        return self.final.state != "unknown" and not self.final.unconfirmed

    @property
    def well(self) -> bool:
        """Whether it was played to its end, and the servos are in a known state."""
        return self.known and not self.faults

    def to_dict(self) -> dict[str, Any]:
        """As JSON data, without the log's arrays."""
        return {
            "frames": self.frames,
            "late_frames": self.late_frames,
            "max_tracking_error": self.max_tracking_error,
            "faults": [fault.to_dict() for fault in self.faults],
            "state": self.final.state,
            "unconfirmed": list(self.final.unconfirmed),
        }


class Governor(Protocol):
    """What gives the goals of every frame in place of a trajectory's, by what is measured."""

    @property
    def share(self) -> float:
        """Of the trajectory's time that is over."""
        ...

    @property
    def done(self) -> bool:
        """Whether it is at rest at its end."""
        ...

    def goals(self, measured: Array, time: float) -> Array:
        """Goals (n,) [rad] by joint positions now, at a time of the play [s].

        Args:
            measured: the last goals, less how far joints lagged behind theirs when they were read (n,) [rad].
            time: of the play [s].

        Raises:
            PlayStopped: the play may not go on.
        """
        ...


class Player:
    """Plays on a bus that is open.

    Args:
        bus: with the robot's servos.
        robot: whose limits hold.
        settings: how to play.
        stop: asked in every frame whether to come to rest early.
        progress: called when a frame of the trajectory is due with the share of its time that was played,
            from 0 to 1.
        log: of the robot's joints; by default in memory.
        guard: who takes over where the player cannot go on; nobody for servos that end with this process.
        governor: gives the goals of every frame of the trajectory; by default they are the trajectory's.
    """

    def __init__(
        self,
        bus: Bus,
        robot: Robot,
        settings: PlaySettings | None = None,
        stop: Callable[[], bool] = lambda: False,
        progress: Callable[[float], None] = lambda share: None,
        log: Log | None = None,
        guard: Guard | None = None,
        governor: Governor | None = None,
    ) -> None:
        self.bus, self.robot, self.settings = bus, robot, settings or PlaySettings()
        self.bounds = Bounds.of(robot, torque=self.settings.torque)
        self.gate = Gate(bus, self.bounds)
        self.readings = Readings(bus, self.bounds)
        self.watch = Watch(self.bounds, self.settings.thresholds)
        self.log = log or Log(self.bounds.names, self.bounds.ids)
        self.guard: Guard = guard or NoGuard()
        self._stop, self._progress, self._governor = stop, progress, governor
        self._goal = self._behind = np.full(len(self.bounds.ids), np.nan)
        self._frames = self._late = 0
        self._began = bus.clock.now()
        self._due = 0.0
        self._resting = self._rests = False

    def play(self, trajectory: Trajectory) -> PlayOutcome:
        """Play the trajectory, and leave the servos as the settings say.

        Raises:
            SafetyError: beyond limits, the servos are not in a state to begin, or there is no guardian:
                nothing has moved. KeyboardInterrupt: it was to stop before anything had moved.
            InputError: more frames per second than the bus carries. Any other exception is passed on after
                the servos were brought into the state for faults.
        """
        frames = frames_of(self.bounds, trajectory, self.settings.rate)
        carried = budget(self.bounds.profiles, self.bus.baud)
        if frames.rate > carried.limit:
            raise InputError(
                f"{frames.rate:g} frames per second are more than the bus carries: {carried.limit:.0f}"
            )
        retries, patience = self.bus.retries, self.bus.patience
        pose = self.ready_pose(frames.q[0])
        self.readings.plan(frames.rate, self.settings.thresholds.interval)
        if self._stop():
            raise KeyboardInterrupt
        fault: ServoFault | None = None
        final = Final("unknown", self.bounds.names)
        state = self.settings.on_fault
        self.bus.retries = 0  # in a play nobody waits: a lost reply is asked for again in the next frame
        self._arm()
        try:
            self._run(frames, pose)
            state, self._rests = self.settings.at_end, True
        except PlayStopped as stopped:
            fault = stopped.fault
        except LineLostError as error:
            fault = ServoFault("line", "", -1, self._time(), str(error))
        except SafetyError as error:
            fault = ServoFault("gate", "", -1, self._time(), str(error))
        except KeyboardInterrupt:
            fault = ServoFault("interrupted", "", -1, self._time(), "stopped by the user")
        finally:
            final = self._known(leave(self.gate, self.bus, state, self._rests), state)
            self.bus.retries, self.bus.patience = retries, patience
            self.log.flush(self._time())
        faults = (fault,) if fault else ()
        return PlayOutcome(self._frames, self._late, self.watch.max_tracking_error, faults, final, self.log)

    def ready_pose(self, first: Array) -> Array:
        """The measured pose (n,) [rad], if the servos may begin.

        Raises:
            SafetyError: a servo is silent or complains, or the first sample is far; all reasons at once.
        """
        reasons: list[str] = []
        pose = np.full(len(self.bounds.ids), np.nan)
        wanted, mend = Bounds.of(self.robot), mending(self.bus, self.robot)
        for k, (name, id) in enumerate(zip(self.bounds.names, self.bounds.ids, strict=True)):
            try:
                if differ := list(servo_registers_differ(self.bus, wanted, k, mend)):
                    reasons += map(str, differ)
                    continue
                reply = self.readings.ask(k)
                values = self.readings.values(k, reply)
                pose[k] = values["position"]
                self.watch.seen(k, values, reply.errors, 0.0)
            except LineLostError as error:
                raise SafetyError(f"the servos cannot be asked, at {name} (servo {id}): {error}") from None
            except BusError as error:
                reasons.append(f"{name}: {error}")
            except PlayStopped as stopped:
                reasons.append(f"{name} (servo {id}): {stopped.fault.message}")
        away = np.abs(pose - first)
        reasons += [
            f"{self.bounds.names[k]} (servo {self.bounds.ids[k]}) stands {away[k]:.2f} rad from its first "
            f"goal, at most {self.settings.far:.2f}: move it nearer, or allow more with --far"
            for k in np.flatnonzero(away > self.settings.far)
        ]
        if reasons:
            raise SafetyError("the servos are not ready: " + "; ".join(reasons))
        return pose

    def _arm(self) -> None:
        """From now on somebody else leaves the servos as announced, should this process not do it."""
        silence = 1.0 / self.settings.rate + self.settings.thresholds.late + _SLACK
        self.guard.arm(self.bounds, self.settings.on_fault, self.bus.patience, silence)

    def _known(self, final: Final, state: EndState) -> Final:
        """The state the servos are in; where nobody answers, the guardian tries on a port opened anew."""
        if final.state != "unknown":
            self.guard.dismiss()
            return final
        self.bus.close()
        return self.guard.take_over(state) or final

    def _run(self, frames: Frames, pose: Array) -> None:
        start = self.bounds.within(pose)
        self.gate.torque_limit()
        self.gate.stay(dict(enumerate(self.bounds.ticks(start).tolist())))
        self.gate.torque(True)
        if self.readings.torque_is_read():
            self.watch.torque_limits = self.bounds.torque
        self._began = self.bus.clock.now()
        self._due = self._began
        self._behind = pose - start
        self._stream(approach(start, frames.q[0], self.settings.start_speed, frames.rate), None)
        if self._governor is None:
            self._stream(frames.q, frames.time)
            last = frames.q[-1]
        else:
            last = self._governed(self._governor, float(frames.time[-1]))
        self._stream(np.repeat(last[None], math.ceil(self.settings.settle * frames.rate), axis=0), None)

    def _governed(self, governor: Governor, lasts: float) -> Array:
        """Send a governor's goals until it is done; the last ones (n,) [rad]."""
        while True:
            self._wait()
            goal = governor.goals(self._goal + self._behind, self._time())
            self._send(goal, governor.share * lasts, lasts, goal[None], 1)
            if governor.done:
                return goal

    def _stream(self, q: Array, times: Array | None) -> None:
        """Send goals (F, n) [rad] frame by frame, of a trajectory at times (F,) [s] or of none."""
        for i, goal in enumerate(q):
            self._wait()
            time, lasts = (math.nan, math.nan) if times is None else (float(times[i]), float(times[-1]))
            self._send(goal, time, lasts, q, i)

    def _wait(self) -> None:
        """Until the next frame is due."""
        if (wait := self._due - self.bus.clock.now()) > 0:
            self.bus.clock.sleep(wait)

    def _send(self, goal: Array, time: float, lasts: float, q: Array, i: int) -> None:
        """Send a frame, which is due, then read servos as long as there is time.

        Args:
            goal: of the frame (n,) [rad].
            time: of the trajectory that lasts so long [s], NaN beside it.
            lasts: see there.
            q: goals (F, n) on which it would come to rest.
            i: of which this frame is the next.
        """
        period, clock = 1.0 / self.settings.rate, self.bus.clock
        if not math.isnan(time):
            self._progress(time / lasts)
        if not self._resting and (kind := self._reason_to_stop()) is not None:
            self._come_to_rest(q, i, *kind)
        late = clock.now() - self._due
        self.gate.goals(goal, period)
        self._goal, self._frames = goal, self._frames + 1
        self._late += late > self.settings.tolerance
        self.log.frame(self._due - self._began, late + self._due - self._began, time, goal)
        self.watch.frame(goal, late, self._time())
        self._due += period
        self._read(goal)
        self.log.flush(self._time())

    def _reason_to_stop(self) -> tuple[FaultKind, str] | None:
        """Why the play should end in order, if it should."""
        if self._stop():
            return "interrupted", "stopped by the user"
        if self.log.failure is not None:
            return "log", str(self.log.failure)
        if self.guard.lost:
            return "guardian", "the guardian has gone: nobody would take over, should this program die"
        return None

    def _come_to_rest(self, q: Array, i: int, kind: FaultKind, why: str) -> None:
        """Run on ever more slowly for a moment, then stop."""
        self._resting = True
        try:
            self._stream(run_out(q, i, self.settings.stop, self.settings.rate), None)
            self._rests = True
        except PlayStopped as stopped:
            if stopped.fault.kind != "late":
                raise
            why += f"; not run out: {stopped.fault.message}"  # of that alone nobody would have stopped
        raise PlayStopped(ServoFault(kind, "", -1, self._time(), why))

    def _read(self, goal: Array) -> None:
        def taken(k: int, reply: Reply) -> None:
            values, time = self.readings.values(k, reply), self._time()
            self._behind[k] += _NEWEST * (values["position"] - float(goal[k]) - self._behind[k])
            self.log.measured(k, values, time)
            self.watch.seen(k, values, reply.errors, time)
            self.watch.tracked(k, values, float(goal[k]), time)

        def lost(k: int) -> None:
            self.watch.lost(k, self._time())

        self.readings.read(self._due, taken, lost)

    def _time(self) -> float:
        return self.bus.clock.now() - self._began


def describe(outcome: PlayOutcome, ids: Sequence[int]) -> str:
    """One sentence about how a play ended."""
    how = "; ".join(map(str, outcome.faults)) or "played to its end"
    return f"{how}. {outcome.final.sentence(len(ids))}"
