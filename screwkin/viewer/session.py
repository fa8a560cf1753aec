"""What a viewer shows now, and what every control makes of it: pure functions, no browser."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import ScrewkinError
from screwkin.gait.record import Gait
from screwkin.model.robot import Robot
from screwkin.trajectory import Trajectory
from screwkin.viewer.controls import dragged
from screwkin.viewer.scene import displacements, first_pose
from screwkin.viewer.track import Playhead, Track, track_of

SPEEDS = ("0.1", "0.25", "0.5", "1", "2")
"""How fast a motion may be played, of its own speed."""


@dataclass(frozen=True, eq=False)
class Session:
    """What is shown.

    Attributes:
        robot: whose it is.
        T_world_base: (4, 4) of the pose that is shown.
        q: (n,) of the pose that is shown [rad or m].
        Ts: (L, 4, 4), what carries every link's pieces into the world.
        gait: that its sliders change, if it walks.
        changes: of the gait by its sliders.
        steps: of the walk.
        track: the motion that is played, if there is one.
        clock: of the motion.
        note: what to tell of the last thing that was asked for.
        advice: what ends the note that the gait cannot be planned as it is, before any slider is moved.
    """

    robot: Robot
    T_world_base: Array
    q: Array
    Ts: Array
    gait: Gait | None = None
    changes: Mapping[str, float] = field(default_factory=dict)
    steps: int = 4
    track: Track | None = None
    clock: Playhead = field(default_factory=lambda: Playhead(0.0))
    note: str = ""
    advice: str = ""

    @property
    def sample(self) -> int | None:
        """The sample of the motion that is shown; None without a motion."""
        return None if self.track is None else self.track.sample(self.clock.time)

    @property
    def reading(self) -> str:
        """The ZMP, its margin and the time, in words."""
        k, track = self.sample, self.track
        if k is None or track is None:
            return "no motion yet"
        x, y, _ = 1e3 * track.zmp[k]
        return (
            f"ZMP x {x:.1f} mm, y {y:.1f} mm; margin {1e3 * track.margin[k]:.1f} mm; t {track.time[k]:.2f} s"
        )


def begun(robot: Robot, gait: Gait | None = None, steps: int = 4, advice: str = "") -> Session:
    """A robot as it stands, before any motion."""
    T, q = first_pose(robot)
    return Session(robot, T, q, displacements(robot, T, q), gait=gait, steps=steps, advice=advice)


def with_motion(session: Session, trajectory: Trajectory, note: str = "") -> Session:
    """The session with a motion, at the same share of it as before, playing on if it played."""
    track = track_of(session.robot, trajectory)
    old = session.clock
    share = old.time / old.duration if old.duration else 0.0
    clock = replace(old, duration=track.duration, time=share * track.duration)
    return at_playhead(replace(session, track=track, clock=clock, note=note))


def at_playhead(session: Session) -> Session:
    """The session in the pose of its clock's time."""
    k, track = session.sample, session.track
    if k is None or track is None:
        return session
    return replace(session, T_world_base=track.T_world_base[k], q=track.q[k], Ts=track.Ts[k])


def replanned(session: Session, plan: Callable[..., Trajectory] | None = None) -> Session:
    """The session with its gait planned anew; what cannot be planned is a note, and the motion stays.

    Args:
        session: with a gait.
        plan: makes a trajectory of a robot, a gait and a number of steps; default: ``walk``, without
            remedies for what cannot be walked, as they take longer than a slider may.
    """
    if session.gait is None:
        return session
    try:
        gait = session.gait.replace(**session.changes) if session.changes else session.gait
        trajectory = (plan or _walked)(session.robot, gait, session.steps)
    except ScrewkinError as error:
        return replace(session, note=f"not planned: {error}{'' if session.changes else session.advice}")
    least = 1e3 * float(trajectory.margin.min())
    way = trajectory.T_world_base[-1, :2, 3] - trajectory.T_world_base[0, :2, 3]
    walked = f"{np.linalg.norm(way):.3f} m in {trajectory.duration:.1f} s"
    return with_motion(session, trajectory, f"planned: {walked}, margin at least {least:.1f} mm")


def _walked(robot: Robot, gait: Gait, steps: int) -> Trajectory:
    """A walk, loaded once the robot is seen: it is half of all that is loaded."""
    from screwkin.gait.lengths import fitted
    from screwkin.gait.walk import planned_walk, walk

    return walk(robot, gait) if gait.places else planned_walk(robot, fitted(gait, robot), steps)


def advanced(session: Session, seconds: float) -> Session:
    """The session so many seconds later."""
    if not session.clock.playing:
        return session
    return at_playhead(replace(session, clock=session.clock.after(seconds)))


def handled(session: Session, asked: Mapping[str, object]) -> Session:
    """The session after what was asked for: values by the keys of controls, the latest of each.

    Keys: ``play``, ``time`` [s], ``speed``, ``home``, ``joint NAME`` [rad or m], ``gait KEY``.
    """
    changes = dict(session.changes)
    for key, value in asked.items():
        what, _, name = key.partition(" ")
        if what == "play" and session.track is not None:
            session = replace(session, clock=session.clock.toggled())
        elif what == "time":
            session = at_playhead(replace(session, clock=session.clock.at(float(str(value)))))
        elif what == "speed":
            session = replace(session, clock=replace(session.clock, speed=float(str(value))))
        elif what == "home":
            T, q = first_pose(session.robot)
            session = _posed(session, T, q)
        elif what == "joint":
            session = _with_joint(session, name, float(str(value)))
        elif what == "gait":
            changes[name] = float(str(value))
    if changes != dict(session.changes):
        session = replanned(replace(session, changes=changes))
    return session


def _with_joint(session: Session, joint: str, value: float) -> Session:
    """One joint dragged by hand: the motion stops there."""
    session = replace(session, clock=_stopped(session.clock))
    try:
        q = dragged(session.robot, session.q, joint, value)
    except ScrewkinError as error:
        return replace(session, note=str(error))
    return _posed(session, session.T_world_base, np.asarray(q))


def _posed(session: Session, T_world_base: Array, q: Array) -> Session:
    """The session in another pose, where no motion goes on."""
    Ts = displacements(session.robot, T_world_base, q)
    return replace(session, T_world_base=T_world_base, q=q, Ts=Ts, clock=_stopped(session.clock), note="")


def _stopped(clock: Playhead) -> Playhead:
    return replace(clock, playing=False)
