"""One run of a trajectory through a backend: settle, play, hold, and write down everything."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.dynamics.terrain import Terrain
from screwkin.gait.ground import ground_of
from screwkin.kinematics.mass import mass_center
from screwkin.kinematics.positions import link_displacements
from screwkin.mechanism.holds import on_floor
from screwkin.model.robot import Robot
from screwkin.model.state import State
from screwkin.sim.backend import Backend, Command, Observation
from screwkin.sim.feedback import Loop
from screwkin.sim.perturbation import NONE, Perturbation
from screwkin.trajectory import Trajectory


@dataclass(frozen=True)
class Schedule:
    """How a trajectory is played.

    settle: standing at the first sample before it starts [s]; hold: standing at the last one after its end
    [s]; fallen_tilt [rad] and fallen_height (share of the planned height of the base above the floor): beyond
    these the robot has fallen; aftermath: how long the fall is watched [s].
    """

    settle: float = 0.5
    hold: float = 0.5
    fallen_tilt: float = np.deg2rad(30.0)
    fallen_height: float = 0.6
    aftermath: float = 0.4


@dataclass(frozen=True, eq=False)
class Run:
    """What happened, one row per step; rows are at the end of their step.

    engine, servo, settings: see ``Backend``; dt [s];
    time (K,) [s] of the trajectory, negative while settling; planned_base, T_world_base (K, 4, 4);
    q_planned, q, qd, torque (K, n); T_world_foot (K, feet, 4, 4); ground_wrench (K, 6): [m; f] of all
    contacts about the world origin; foot_force (K, feet, 3) of the contacts of the legs' last links, of feet
    that closures hold on the floor by their ankles' sensors;
    ankle_wrench (K, feet, 6): ground wrench by the ankle sensors; contact (K, feet) bool: where a controller
    has its feet on the floor, None where the plan says so; touched: other links that met the floor;
    fallen_at [s], None if it stood to the end.
    """

    engine: str
    servo: str
    settings: Mapping[str, Any]
    dt: float
    time: Array
    planned_base: Array
    T_world_base: Array
    q_planned: Array
    q: Array
    qd: Array
    torque: Array
    T_world_foot: Array
    ground_wrench: Array
    foot_force: Array
    ankle_wrench: Array
    contact: NDArray[np.bool_] | None
    touched: tuple[str, ...]
    fallen_at: float | None

    @property
    def tilt(self) -> Array:
        """Angle (K,) between the base's z axis and the vertical [rad]."""
        return _tilt(self.T_world_base)


def simulate(
    robot: Robot,
    trajectory: Trajectory,
    backend: Backend,
    schedule: Schedule | None = None,
    progress: Callable[[float], None] | None = None,
    start: Array | None = None,
    perturbation: Perturbation = NONE,
    loop: Loop | None = None,
) -> Run:
    """Play a trajectory in a backend, which stays open.

    Commands are the cubic Hermite interpolation of the samples: for every step the position at its start and
    the mean rate through it, so a perfect servo is exact at every step's end.

    Args:
        robot: of which the trajectory speaks, joints in table order.
        trajectory: what to play.
        backend: where to play it.
        schedule: settling, holding and when a fall is a fall.
        progress: called now and then with the share done, 0 to 1.
        start: positions (n,) of the joints at first, by default the first commands. Commands that allow for
            elastic servos are no posture: in them feet would stand in the floor, which throws the robot up.
        perturbation: of which the push is given here; the backend has the rest.
        loop: what commands the joints from the start on instead, by what the robot feels.
    """
    rule = schedule or Schedule()
    dt, since = backend.dt, float(trajectory.time[0])
    count = round((rule.settle + trajectory.duration + rule.hold) / dt)
    times: Array = since - rule.settle + dt * np.arange(count + 1, dtype=np.float64)
    terrain = ground_of(trajectory)
    q, _ = trajectory.sampled(times)
    planned = trajectory.base_sampled(times)
    qd = np.diff(q, axis=0) / dt
    first = backend.reset(State(planned[0], q[0] if start is None else start))
    watched = _watched(robot, State(planned[0], q[0]), terrain)
    low = rule.fallen_height * terrain.above_plane(_carried(planned, watched))
    upright = math.cos(rule.fallen_tilt)
    seen: list[Observation] = []
    contact: list[NDArray[np.bool_]] = []
    fallen_at: float | None = None
    for k in range(count):
        force = perturbation.force(float(times[k]), dt)
        if loop is not None and since - 1e-9 <= times[k]:
            q[k], qd[k] = loop.command(seen[-1] if seen else first, dt)
        if loop is not None:
            contact.append(loop.contact)
        backend.step(Command(q[k], qd[k], planned[k + 1], force))
        seen.append(backend.observe())
        now = float(times[k + 1])
        if progress is not None and k % 100 == 99:
            progress((k + 1) / count)
        if fallen_at is None:
            T = seen[-1].T_world_base
            if T[2, 2] < upright or terrain.above_plane(_carried(T, watched)) < low[k + 1]:
                fallen_at = now
        if fallen_at is not None and now > fallen_at + rule.aftermath - dt / 2:
            break
    rows = len(seen)
    return Run(
        engine=backend.name,
        servo=backend.servo,
        settings=dict(backend.settings) | ({} if loop is None else {"feedback": loop.noted()}),
        dt=dt,
        time=times[1 : rows + 1],
        planned_base=planned[1 : rows + 1],
        q_planned=q[1 : rows + 1],
        contact=np.array(contact) if contact else None,
        fallen_at=fallen_at,
        **_columns(robot, seen),
    )


def _watched(robot: Robot, state: State, terrain: Terrain) -> Array:
    """The point of the base whose height says whether the robot has fallen, in base axes (3,).

    The base's origin; where that lies below half the CoM's height, as on the floor between the feet, the
    place of the CoM in the given state.
    """
    com = as_array(mass_center(robot, link_displacements(robot, state.q.tolist()))).astype(float)
    origin, above = terrain.above_plane(_carried(state.T_world_base, np.stack([0 * com, com])))
    return 0 * com if origin > 0.5 * above else com


def _carried(T: Array, points: Array) -> Array:
    """World positions of points (..., 3) of base axes under poses (..., 4, 4)."""
    return np.asarray((T[..., :3, :3] @ points[..., None])[..., 0] + T[..., :3, 3])


def _columns(robot: Robot, seen: list[Observation]) -> dict[str, Any]:
    """The observations as arrays, contacts gathered per step and per leg."""
    names = ("T_world_base", "q", "qd", "torque", "T_world_foot", "ankle_wrench")
    columns: dict[str, Any] = {name: np.array([getattr(o, name) for o in seen]) for name in names}
    feet = {limb.link: i for i, limb in enumerate(limb for limb in robot.limbs if limb.kind == "leg")}
    held = [robot.limb(tip).link for tip in on_floor(robot)]
    rows = [
        (k, c.link, *c.point, *c.force)
        for k, o in enumerate(seen)
        for c in o.contacts
        if c.link not in held or c.link not in feet
    ]
    wrench = np.zeros((len(seen), 6))
    forces = np.zeros((len(seen), len(feet), 3))
    for link in set(held) & set(feet):  # contact and closure share what they carry: its ankle feels both
        wrench += columns["ankle_wrench"][:, feet[link]]
        forces[:, feet[link]] = columns["ankle_wrench"][:, feet[link], 3:]
    if rows:
        step = np.array([row[0] for row in rows])
        numbers = np.array([row[2:] for row in rows])
        point, force = numbers[:, :3], numbers[:, 3:]
        np.add.at(wrench, step, np.hstack([np.cross(point, force), force]))
        foot = np.array([feet.get(row[1], -1) for row in rows])
        np.add.at(forces, (step[foot >= 0], foot[foot >= 0]), force[foot >= 0])
    others = dict.fromkeys(row[1] for row in rows if row[1] not in feet)
    return {**columns, "ground_wrench": wrench, "foot_force": forces, "touched": tuple(others)}


def _tilt(T: Array) -> Array:
    """Angle between z axes and the vertical [rad]; exact near 0, where the arc cosine is not."""
    return np.asarray(np.arctan2(np.hypot(T[..., 0, 2], T[..., 1, 2]), T[..., 2, 2]))
