"""A perturbation applied: to the robot, to the ground, and to what its servos do, for every engine alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import Vector
from screwkin.dynamics.terrain import Block, Terrain
from screwkin.model.records import Inertia, Link
from screwkin.model.robot import Robot
from screwkin.sim.backend import Command
from screwkin.sim.delay import DelayLine
from screwkin.sim.drive import UNLIMITED, Actuation, Servos
from screwkin.sim.motors import MotorServos
from screwkin.sim.perturbation import DEFAULTS, Perturbation, by_name

FAR = 50.0
"""How far the ground beyond a rise reaches [m]."""


def perturbed_robot(robot: Robot, by: Perturbation) -> Robot:
    """The robot with the masses, inertias, CoM and payload of a perturbation; itself where it has none.

    Raises:
        UnknownNameError: a factor of mass is for none of its links.
    """
    factors = by_name(by.mass, robot.link_names, 1.0, "link")
    same = (factors == 1.0).all() and by.inertia == 1.0 and not any(by.com) and not by.payload
    if same:
        return robot
    links = []
    for link, factor in zip(robot.links, factors.tolist(), strict=True):
        i = link.inertia
        turned = factor * by.inertia
        heavier = replace(
            link,
            mass=link.mass * factor,
            inertia=Inertia(*(turned * x for x in (i.xx, i.yy, i.zz, i.xy, i.xz, i.yz))),
        )
        if link.name == robot.base_link:
            x, y, z = by.com
            com = Vector(link.com.x + x, link.com.y + y, link.com.z + z)
            heavier = _loaded(replace(heavier, com=com), by)
        links.append(heavier)
    return replace(robot, links=tuple(links))


def _loaded(link: Link, by: Perturbation) -> Link:
    """A link with a point mass on it."""
    if not by.payload:
        return link
    com = np.array([link.com.x, link.com.y, link.com.z], dtype=float)
    m, extra, apart = float(link.mass), by.payload, np.array(by.payload_at) - com
    reduced = m * extra / (m + extra)
    d = reduced * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    i = link.inertia
    together = com + extra / (m + extra) * apart
    return replace(
        link,
        mass=m + extra,
        com=Vector(*together.tolist()),
        inertia=Inertia(
            i.xx + d[0, 0], i.yy + d[1, 1], i.zz + d[2, 2], i.xy + d[0, 1], i.xz + d[0, 2], i.yz + d[1, 2]
        ),
    )


def perturbed_ground(terrain: Terrain, by: Perturbation) -> Terrain:
    """The ground with the rise of a perturbation: all that lies beyond ``rise_at``, blocks apart."""
    if not by.rise:
        return terrain
    low, high = sorted((terrain.ground, terrain.ground + by.rise))
    side = 1.0 if by.rise > 0 else -1.0  # where the higher half lies
    x = by.rise_at + side * FAR
    return replace(terrain, ground=low, blocks=(*terrain.blocks, Block(x, 0.0, 0.0, 2 * FAR, 2 * FAR, high)))


def perturbed_servos(servos: Servos, robot: Robot, by: Perturbation, dt: float) -> Servos:
    """The servos with lag, weakness, play and dropped frames; themselves where nothing of it is.

    Raises:
        UnknownNameError: a figure is for none of the robot's joints.
    """
    lag, play, stiffness, torque = (
        by_name(getattr(by, key), robot.joint_names, DEFAULTS[key], "joint")
        for key in ("lag", "backlash", "stiffness", "torque")
    )
    weak = bool(by.fade or (torque != 1.0).any())
    if not (weak or by.dropped or lag.any() or play.any() or (stiffness != 1.0).any()):
        return servos
    effort = np.array([joint.effort for joint in robot.joints], dtype=float)
    if isinstance(servos, MotorServos):
        lag = lag + servos.lag
        servos = servos.at_once()
    return PerturbedServos(
        servos,
        DelayLine(lag, dt),
        0.5 * play,
        stiffness,
        torque * effort if weak else UNLIMITED + 0.0 * effort,
        by,
    )


class PerturbedServos:
    """Servos behind a line that delays and drops commands, with play and weakness of their own."""

    def __init__(
        self, own: Servos, line: DelayLine, play: Array, stiffness: Array, effort: Array, by: Perturbation
    ) -> None:
        """Servos behind a line; play to either side, factor of the error and greatest torque of each (n,)."""
        self.name, self.rotor_inertia = own.name, own.rotor_inertia
        self.relative_rotors = own.relative_rotors
        self._own, self._line, self._by = own, line, by
        self._play, self._stiffness, self._effort = play, stiffness, effort
        self.reset(np.zeros(len(play)))

    def reset(self, q: Array) -> None:
        """Servos at rest at positions (n,), and no command on its way."""
        self._own.reset(q)
        self._line.reset()
        self._draw = np.random.default_rng([self._by.seed, 1])
        self._steps, self._frame, self._lost = 0, -1, False
        self._arrived: Array | None = None

    def actuate(self, q: Array, qd: Array, motor: Array, command: Command, dt: float) -> Actuation:
        """What the servos do with what arrived, of the error beyond their play, as far as they are able."""
        goal, rate = self._line.through(self._received(command, dt))
        error = goal - q
        error = self._stiffness * np.sign(error) * np.maximum(np.abs(error) - self._play, 0.0)
        late = Command(goal, rate, command.T_world_base)
        action = self._own.actuate(goal - error, qd, motor, late, dt)
        left = self._effort * max(0.0, 1.0 - self._by.fade * self._steps * dt)
        self._steps += 1
        return Actuation(np.clip(action.torque, -left, left), action.rate, np.minimum(action.bound, left))

    def _received(self, command: Command, dt: float) -> Array:
        """Position and rate (2, n) that arrive; a frame that does not leaves the position before it."""
        newest = np.stack([np.asarray(command.q, dtype=float), np.asarray(command.qd, dtype=float)])
        frame = int(self._steps * dt / self._by.frame + 1e-9)
        if frame != self._frame:
            self._frame, self._lost = frame, bool(self._draw.random() < self._by.dropped)
        if self._arrived is None or not self._lost:
            self._arrived = newest
            return newest
        return np.stack([self._arrived[0], np.zeros_like(newest[1])])
