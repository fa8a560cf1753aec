"""A motion as a viewer plays it: where everything is at every sample, and the clock that says which."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.analysis.placed_soles import support_phases
from screwkin.dynamics.on_floor import soles_on_floor
from screwkin.dynamics.terrain import Terrain
from screwkin.gait.ground import ground_of
from screwkin.model.robot import Robot
from screwkin.sim.camera import following
from screwkin.trajectory import Trajectory
from screwkin.viewer.scene import displacements


@dataclass(frozen=True, eq=False)
class Track:
    """A trajectory of T samples of a robot with L links, ready to be shown.

    Attributes:
        time: (T,) [s] from 0.
        Ts: (T, L, 4, 4), what carries every link's pieces into the world.
        q: (T, n) [rad or m].
        T_world_base: (T, 4, 4).
        com, gcom, zmp: (T, 3) [m]; the last two on the ground below.
        margin: (T,) of the ZMP [m].
        soles: by foot (T, corners, 3) [m], where the soles are seen from above, on the floor.
        contact: (T, feet).
        polygons: first sample, last sample and corners (k, 3) [m] of every phase of support.
        terrain: what it walks on.
        followed: (T, 3) [m], where one looks who goes along.
    """

    time: Array
    Ts: Array
    q: Array
    T_world_base: Array
    com: Array
    gcom: Array
    zmp: Array
    margin: Array
    soles: tuple[Array, ...]
    contact: Array
    polygons: tuple[tuple[int, int, Array], ...]
    terrain: Terrain
    followed: Array

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return float(self.time[-1])

    def sample(self, time: float) -> int:
        """The sample nearest to a time [s]."""
        after = int(np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1))
        return after - int(time - self.time[after - 1] <= self.time[after] - time)

    def polygon(self, sample: int) -> Array:
        """Corners (k, 3) of the support polygon at a sample [m]; none where no foot stands."""
        return next((c for begin, end, c in self.polygons if begin <= sample <= end), np.zeros((0, 3)))


def track_of(robot: Robot, trajectory: Trajectory) -> Track:
    """What is seen of a trajectory of that robot."""
    terrain = ground_of(trajectory)
    phases, soles = [], np.zeros((trajectory.samples, 0, 4, 2))
    if trajectory.feet:
        soles = soles_on_floor(robot, trajectory.feet, trajectory.T_world_tip, terrain)
        phases = support_phases(soles, trajectory.contact)
    return Track(
        time=trajectory.time - trajectory.time[0],
        Ts=displacements(robot, trajectory.T_world_base, trajectory.q),
        q=trajectory.q,
        T_world_base=trajectory.T_world_base,
        com=trajectory.com,
        gcom=_on_ground(trajectory.com[:, :2]),
        zmp=_on_ground(trajectory.zmp),
        margin=trajectory.margin,
        soles=tuple(_on_ground(soles[:, k]) for k in range(soles.shape[1])),
        contact=trajectory.contact,
        polygons=tuple((begin, end, _on_ground(polygon)) for begin, end, polygon in phases),
        terrain=terrain,
        followed=following(trajectory.time, trajectory.T_world_base),
    )


def _on_ground(points: Array) -> Array:
    """Points (..., 2) at z = 0, where the ZMP is defined."""
    return np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)


@dataclass(frozen=True)
class Playhead:
    """The time that is shown [s], whether it runs, how fast, and where it ends [s]."""

    duration: float
    time: float = 0.0
    playing: bool = False
    speed: float = 1.0

    def after(self, seconds: float) -> Playhead:
        """The clock so many seconds later; it stops at its end."""
        if not self.playing:
            return self
        time = self.time + self.speed * seconds
        return replace(self, time=min(time, self.duration), playing=time < self.duration)

    def toggled(self) -> Playhead:
        """Started, from the beginning if it stood at its end; or stopped."""
        if self.playing:
            return replace(self, playing=False)
        return replace(self, playing=True, time=0.0 if self.time >= self.duration else self.time)

    def at(self, time: float) -> Playhead:
        """The same at another time, within its duration."""
        return replace(self, time=min(max(time, 0.0), self.duration))
