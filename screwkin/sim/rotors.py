"""Rotors that turn with their joints alone, in an engine that knows only bodies.

A servo's rotor turns many times faster than its joint, and its inertia as seen at the joint resists the
joint's rate, not the rotation of the link in space. PyBullet has no such inertia. There every link carries a
ball with the rotor's inertia instead, which steadies the step; but it resists rotation in space, as much as
the whole robot does. Generalised forces (B - A) a + c make up for the difference: B is the balls' inertia, A
the rotors', c the inertial force of the balls as their rates' Jacobians change, and a the acceleration that
the step shall have.

That is the acceleration of the step before, and the forces are improved from step to step until they answer
to it. One improvement is enough where its own effect on the acceleration is known: without contacts the mass
matrix says it. A contact lets the forces move the robot much less, and forces that do not know swing up
within a few steps; so points on the floor count as heavy masses. Where one slides or leaves, the forces
settle later.

The stop of a point that strikes the floor is no acceleration to answer to: the floor stopped a leg that the
balls made heavy, and forces that made it light again after the blow would throw it up.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.errors import InputError
from screwkin.model.robot import Robot

SHARE = 0.5
"""Part of the improvement that is made in one step, as friction in the joints is not known to it."""
FIXED = 100.0
"""Mass of a point that touches the floor, in masses of the robot."""


def with_rotors(robot: Robot, rotors: Array, steadied: bool) -> Robot:
    """The robot with a massless ball on every link, whose inertia is that of the rotor at its joint.

    PyBullet knows no rotors that turn with a joint alone. The ball's inertia across the axis, and where
    ``steadied`` a base no lighter than the largest ball, else with a ball of its own, steady stiff joints
    between light links.

    Raises:
        InputError: a rotor at a joint that does not turn.
    """
    if not rotors.any():
        return robot
    links = {link.name: link for link in robot.links}
    balls = dict(zip([joint.child for joint in robot.joints], rotors.tolist(), strict=True))
    if steadied:
        links[robot.base_link] = robot.with_inertia_floor(inertia=float(rotors.max())).link(robot.base_link)
    else:
        balls[robot.base_link] = float(rotors.max())
    for joint in robot.joints:
        if balls[joint.child] and joint.type != "revolute":
            raise InputError(f"PyBullet has no rotor at joint {joint.name}, which does not turn")
    for name, ball in balls.items():
        i = links[name].inertia
        links[name] = replace(links[name], inertia=replace(i, xx=i.xx + ball, yy=i.yy + ball, zz=i.zz + ball))
    return replace(robot, links=tuple(links.values()))


class RelativeRotors:
    """Forces that make balls on links act as rotors at joints, for one body in PyBullet."""

    def __init__(
        self, p: Any, client: dict[str, int], body: int, joints: list[int], rotors: Array, floating: bool
    ) -> None:
        """Read masses, inertias and the tree of a body whose joints all turn.

        Args:
            p: the module of the engine.
            client: the arguments that name its client.
            body: index of the body.
            joints: indices of its joints, n, in the order of the rotors.
            rotors: inertia (n,) as seen at the joints [kg m^2], which every link below carries as a ball;
                the base carries the largest.
            floating: whether the base moves.
        """
        self._first = 6 if floating else 0
        self._p, self._client, self._body, self._joints, self._rotors = p, client, body, joints, rotors
        infos = [p.getJointInfo(body, j, **client) for j in joints]
        dynamics = [p.getDynamicsInfo(body, link, **client) for link in (-1, *joints)]
        self._mass = sum(d[0] for d in dynamics)
        self._root_mass = np.sqrt([d[0] for d in dynamics])
        self._root_balls = np.sqrt([rotors.max(), *rotors])
        self._root_inertia = np.sqrt([d[2] for d in dynamics])
        self._axes = np.array([info[13] for info in infos])
        self._above = np.zeros((len(joints) + 1, len(joints)), dtype=bool)
        for k, info in enumerate(infos):
            parent = joints.index(info[16]) + 1 if info[16] in joints else 0
            self._above[k + 1] = self._above[parent]
            self._above[k + 1, k] = True
        self.reset()

    def reset(self) -> None:
        """Forget the step before."""
        self._velocity: Array | None = None
        self._rows: Array = np.zeros((0, 0))
        self._force = np.zeros(self._first + len(self._joints))
        self._torque = np.zeros(len(self._joints))

    def correct(self, torque: Array, dt: float) -> None:
        """Apply the forces for a step of dt [s] in which motors apply torques (n,) [N m]."""
        p = self._p
        links = p.getLinkStates(self._body, self._joints, 0, 0, **self._client)
        velocity = self._rates()
        mass, rows, touching = self._inertias(links)
        if self._velocity is not None:
            fixed = FIXED * self._mass
            inertia = mass + fixed * touching.T @ touching
            surplus = rows.T @ rows - np.diag(self._at_joints(self._rotors))
            changing = rows.T @ ((rows - self._rows) @ velocity) / dt
            sinking = np.minimum(touching[2::3] @ self._velocity, 0.0)  # points that struck the floor
            struck = fixed * touching[2::3].T @ sinking / dt
            beside = np.linalg.solve(inertia, self._at_joints(torque - self._torque) + struck)
            needed = surplus @ ((velocity - self._velocity) / dt + beside) + changing
            settled = np.linalg.solve(inertia - surplus, needed - self._force)
            self._force = self._force + SHARE * inertia @ settled
            p.setJointMotorControlArray(
                self._body,
                self._joints,
                p.TORQUE_CONTROL,
                forces=self._force[self._first :].tolist(),
                **self._client,
            )
            if self._first:
                moment = self._force[:3].tolist()
                p.applyExternalTorque(self._body, -1, moment, p.WORLD_FRAME, **self._client)
        self._velocity, self._torque, self._rows = velocity, np.array(torque), rows

    def _rates(self) -> Array:
        """Angular and linear velocity of the base's CoM, then joint rates: (6 + n,)."""
        linear, angular = self._p.getBaseVelocity(self._body, **self._client)
        joints = self._p.getJointStates(self._body, self._joints, **self._client)
        return np.array([*angular, *linear, *(joint[1] for joint in joints)])[6 - self._first :]

    def _at_joints(self, values: Array) -> Array:
        """Values (n,) of joints among those of all rates."""
        return np.append(np.zeros(self._first), values)

    def _inertias(self, links: Any) -> tuple[Array, Array, Array]:
        """Mass matrix with the balls, rows whose square is the balls', Jacobian of points on the floor.

        Without the base's rates if it is fixed.
        """
        n = len(links)
        base, turn = self._p.getBasePositionAndOrientation(self._body, **self._client)
        com = np.array([base, *(link[0] for link in links)])
        principal = self._rotations([turn, *(link[1] for link in links)])
        axes = np.einsum("kij,kj->ki", self._rotations([link[5] for link in links]), self._axes)
        angular, linear = np.zeros((2, n + 1, 3, 6 + n))
        angular[:, :, :3] = linear[:, :, 3:6] = np.eye(3)
        x, y, z = (com[0] - com).T
        linear[:, 0, 1], linear[:, 0, 2], linear[:, 1, 0] = -z, y, z
        linear[:, 1, 2], linear[:, 2, 0], linear[:, 2, 1] = -x, -y, x
        arms = com[:, None] - np.array([link[4] for link in links])
        angular[:, :, 6:] = np.where(self._above[:, None], axes.T, 0.0)
        linear[:, :, 6:] = np.where(self._above[:, None], _cross(axes, arms).transpose(0, 2, 1), 0.0)
        turned = self._root_inertia[:, :, None] * np.einsum("kji,kjm->kim", principal, angular)
        carried = self._root_mass[:, None, None] * linear
        free = slice(6 - self._first, None)
        rows = np.concatenate([carried, turned]).reshape(-1, 6 + n)[:, free]
        balls = (self._root_balls[:, None, None] * angular).reshape(-1, 6 + n)[:, free]
        return rows.T @ rows, balls, self._touching(com, angular, linear)[:, free]

    def _touching(self, com: Array, angular: Array, linear: Array) -> Array:
        """Jacobian (3 K, 6 + n) of the points that the floor pressed in the step before."""
        touches = [t for t in self._p.getContactPoints(self._body, **self._client) if t[9] > 0.0]
        link = [(-1, *self._joints).index(touch[3]) for touch in touches]
        arms = np.array([touch[5] for touch in touches]).reshape(-1, 3) - com[link]
        turned = np.cross(angular[link], arms[:, :, None], axis=1)
        return np.asarray((linear[link] + turned).reshape(-1, angular.shape[2]))

    def _rotations(self, quats_xyzw: Any) -> Array:
        """Rotation matrices (..., 3, 3)."""
        matrices = [self._p.getMatrixFromQuaternion(quat) for quat in quats_xyzw]
        return np.array(matrices).reshape(-1, 3, 3)


def _cross(a: Array, b: Array) -> Array:
    """Vector products (L, n, 3) of (n, 3) and (L, n, 3); ``np.cross`` is several times slower."""
    (u, v, w), (x, y, z) = a.T, b.transpose(2, 0, 1)
    return np.stack([v * z - w * y, w * x - u * z, u * y - v * x], axis=-1)
