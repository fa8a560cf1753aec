"""Self-collision: how deep boxes of different links lie in each other, by MuJoCo's distance of convex bodies.

Left out are pairs that touch by construction: neighbours along the tree or by a closure, links without boxes
between them not counted, and pairs that touch in the posture ``home``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.kinematics.body import link_poses
from screwkin.model.records import Box
from screwkin.model.robot import Robot
from screwkin.model.state import State, home
from screwkin.sim.mujoco import mujoco_library
from screwkin.sim.run import Run
from screwkin.trajectory import Trajectory

TOUCH = 1e-4
"""Depth [m] up to which boxes touch and do not collide: faces that lie in one plane, and rounding."""
_SAMPLED = 0.01  # s, between looks at a simulation


@dataclass(frozen=True)
class SelfCollision:
    """Two links, how deep one lies in the other at most [mm], and when [s]."""

    links: tuple[str, str]
    depth_mm: float
    time: float

    def __str__(self) -> str:
        a, b = self.links
        return f"{a} in {b} by {self.depth_mm:.1f} mm at {self.time:.2f} s"

    def to_dict(self) -> dict[str, Any]:
        """As JSON data."""
        return {"links": list(self.links), "depth_mm": self.depth_mm, "time": self.time}


def self_collisions(robot: Robot, time: Array, q: Array) -> tuple[SelfCollision, ...]:
    """The deepest collision of every pair of links along joint positions, deepest first.

    Args:
        robot: with boxes on its links.
        time: (T,) [s], one at least.
        q: (T, n) joint positions [rad or m].

    Raises:
        MissingDependencyError: mujoco is not installed.
    """
    world = _World(robot)
    pairs = world.pairs(touching_at_home(robot, world))
    depth = world.depths(q, pairs)
    rows = depth.argmax(axis=0)
    return deepest(
        SelfCollision((world.links[a], world.links[b]), 1e3 * float(depth[row, k]), float(time[row]))
        for k, ((a, b), row) in enumerate(zip(pairs, rows, strict=True))
        if depth[row, k] > TOUCH
    )


def deepest(collisions: Iterable[SelfCollision]) -> tuple[SelfCollision, ...]:
    """The deepest collision of every pair of links, deepest first."""
    found: dict[tuple[str, str], SelfCollision] = {}
    for one in sorted(collisions, key=lambda one: -one.depth_mm):
        found.setdefault(one.links, one)
    return tuple(found.values())


def collisions_of_run(robot: Robot, trajectory: Trajectory, run: Run) -> tuple[SelfCollision, ...]:
    """The deepest collision of every pair of links along a plan, and along what happened up to a fall.

    Raises:
        MissingDependencyError: mujoco is not installed.
    """
    stood = (run.time < (np.inf if run.fallen_at is None else run.fallen_at)) & np.isfinite(run.q).all(axis=1)
    every = max(1, round(_SAMPLED / run.dt))
    time = np.concatenate([trajectory.time, run.time[stood][::every]])
    return self_collisions(robot, time, np.concatenate([trajectory.q, run.q[stood][::every]]))


def touching_at_home(robot: Robot, world: _World | None = None) -> tuple[tuple[str, str], ...]:
    """Pairs of links that are no neighbours and touch in the posture ``home``: by construction.

    Raises:
        MissingDependencyError: mujoco is not installed.
    """
    if "home" not in [posture.name for posture in robot.postures]:
        return ()
    world = world or _World(robot)
    pairs = world.pairs(())
    depth = world.depths(np.asarray(home(robot).q)[None], pairs)[0]
    touching = [
        (world.links[a], world.links[b]) for (a, b), d in zip(pairs, depth, strict=True) if d > -TOUCH
    ]
    return tuple(dict.fromkeys(touching))


class _World:
    """All boxes of a robot, free to be placed: ``links`` names the link of each."""

    def __init__(self, robot: Robot) -> None:
        self._mj = mj = mujoco_library()
        self._robot = robot
        boxes: list[tuple[str, Box]] = [(link.name, box) for link in robot.links for box in link.boxes]
        self.links = [name for name, _ in boxes]
        size = np.array([as_array(box.size) for _, box in boxes], dtype=float).reshape(-1, 3)
        self._radius = np.linalg.norm(size, axis=1) / 2
        self._center = np.zeros((len(boxes), 4, 4))
        for k, (name, box) in enumerate(boxes):
            T_base_link, place = as_array(robot.frame(name)[1]), np.eye(4)
            place[:3, 3] = as_array(box.center)
            self._center[k] = np.linalg.solve(np.asarray(T_base_link, dtype=float), place)
        self._row = [robot.link_names.index(name) for name in self.links]
        spec = mj.MjSpec()
        for half in size / 2:
            spec.worldbody.add_geom(type=mj.mjtGeom.mjGEOM_BOX, size=half)
        self._model = spec.compile()
        self._data = mj.MjData(self._model)

    def pairs(self, left_out: tuple[tuple[str, str], ...]) -> list[tuple[int, int]]:
        """Boxes of links that are no neighbours, without some pairs of links."""
        apart = {frozenset(pair) for pair in left_out} | _neighbours(self._robot)
        return [
            (a, b)
            for a, b in combinations(range(len(self.links)), 2)
            if self.links[a] != self.links[b] and frozenset((self.links[a], self.links[b])) not in apart
        ]

    def depths(self, q: Array, pairs: list[tuple[int, int]]) -> Array:
        """Depth (T, pairs) [m], negative for a distance; -TOUCH where boxes are at least that far apart."""
        depth = np.full((len(q), len(pairs)), -TOUCH)
        if not depth.size:
            return depth
        base = np.broadcast_to(np.eye(4), (len(q), 4, 4))
        T = link_poses(self._robot, State(base, q))[:, self._row] @ self._center
        R, p = T[..., :3, :3], T[..., :3, 3]
        first, second = np.array(pairs).T
        apart = np.linalg.norm(p[:, first] - p[:, second], axis=-1)
        for t, k in np.argwhere(apart < self._radius[first] + self._radius[second] + TOUCH):
            both = list(pairs[k])
            self._data.geom_xpos[both] = p[t, both]
            self._data.geom_xmat[both] = R[t, both].reshape(2, 9)
            depth[t, k] = -self._mj.mj_geomDistance(self._model, self._data, *pairs[k], TOUCH, None)
        return depth


def _neighbours(robot: Robot) -> set[frozenset[str]]:
    """Pairs of links with nothing but links without boxes between them, and pairs that a closure joins."""
    solid = {link.name for link in robot.links if link.boxes}
    parent = {joint.child: joint.parent for joint in robot.tree}
    found = {frozenset((closure.link_a, closure.link_b)) for closure in robot.closures}
    for name in solid:
        above = parent.get(name)
        while above is not None and above not in solid:
            above = parent.get(above)
        if above is not None:
            found.add(frozenset((name, above)))
    return found
