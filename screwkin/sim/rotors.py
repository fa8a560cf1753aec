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
from screwkin.sim.pybullet_look import Look, rotations_of_quats

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
    """Forces that make balls on links act as rotors at joints, for one body in PyBullet.

    Its m rates are the base's angular velocity and that of its CoM, if it floats, then those of n joints.
    Columns of S (6, m) are their twists at the base's CoM, of which a link has those that move it; A (3, m)
    are their angular velocities.
    """

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
        count = len(joints)
        self._base = 6 if floating else 0
        infos = [p.getJointInfo(body, j, **client) for j in joints]
        dynamics = [p.getDynamicsInfo(body, link, **client) for link in (-1, *joints)]
        self._fixed = FIXED * sum(d[0] for d in dynamics)
        self._root_mass = np.sqrt([d[0] for d in dynamics])[:, None, None]
        self._root_inertia = np.sqrt([d[2] for d in dynamics])[:, :, None]
        turned = rotations_of_quats(np.array([d[4] for d in dynamics[1:]])).transpose(0, 2, 1)
        self._axes = turned @ np.array([info[13] for info in infos])[:, :, None]
        self._joint_in_inertial = -turned @ np.array([d[3] for d in dynamics[1:]])[:, :, None]
        self._row = {joint: k for k, joint in enumerate((-1, *joints))}
        moved = np.zeros((count + 1, self._base + count))
        moved[:, : self._base] = 1.0
        for k, info in enumerate(infos):
            moved[k + 1] = moved[self._row[info[16]]]
            moved[k + 1, self._base + k] = 1.0
        self._moved = moved[:, None]
        self._rotors = np.diag(self._of_joints(rotors))
        self._balls = moved.T @ (np.array([[rotors.max()], *rotors[:, None]]) * moved)
        self._factors = np.zeros((count + 1, 6, 6))
        self._factors[:, 3:, 3:] = self._root_mass * np.eye(3)
        self.reset()

    def reset(self) -> None:
        """Forget the step before."""
        self._velocity: Array | None = None
        self._force = np.zeros(len(self._rotors))
        self._torque = np.zeros(len(self._rotors) - self._base)
        self._angular = np.zeros((3, len(self._rotors)))

    def forces(self, look: Look, torque: Array, dt: float) -> tuple[Array, Array]:
        """Moment (3,) on the base and torques (n,) of the joints through a step [N m].

        Args:
            look: at the body before the step.
            torque: (n,) of the motors in the step [N m].
            dt: duration of the step [s].
        """
        linear, angular = look.velocity
        velocity = np.array([*([*angular, *linear] if self._base else ()), *look.qd.tolist()])
        com, turned = look.com - look.com[0], look.axes
        S = self._twists(com[1:], turned[1:])
        A = S[:3]
        if self._velocity is not None:
            touching = self._touching(look, S)
            inertia = self._inertia(com, turned, S) + self._fixed * touching.T @ touching
            surplus = self._balls * (A.T @ A) - self._rotors
            changing = (self._balls * (A.T @ (A - self._angular))) @ velocity / dt
            down = touching[2::3]
            sinking = np.minimum(down @ self._velocity, 0.0)  # points that struck the floor
            struck = (self._fixed / dt) * (sinking @ down)
            beside = _solved(inertia, self._of_joints(torque - self._torque) + struck)
            needed = surplus @ ((velocity - self._velocity) / dt + beside) + changing
            settled = _solved(inertia - surplus, needed - self._force)
            self._force = self._force + SHARE * (inertia @ settled)
        self._velocity, self._torque, self._angular = velocity, torque, A
        return self._force[:3] if self._base else np.zeros(3), self._force[self._base :]

    def _of_joints(self, values: Array) -> Array:
        """Values (n,) of joints among those of all rates (m,)."""
        return np.concatenate([np.zeros(self._base), values])

    def _twists(self, com: Array, turned: Array) -> Array:
        """Twists S (6, m) at the base's CoM, of links at (n, 3) from it with principal axes (n, 3, 3)."""
        axes = turned @ self._axes
        joints = com + (turned @ self._joint_in_inertial)[:, :, 0]
        S = np.zeros((6, len(self._rotors)))
        S[:, : self._base] = np.eye(6, self._base)
        S[:3, self._base :] = axes[:, :, 0].T
        S[3:, self._base :] = (_crossed_with(-joints) @ axes)[:, :, 0].T
        return S

    def _inertia(self, com: Array, turned: Array, S: Array) -> Array:
        """Mass matrix (m, m) with the balls."""
        factors = self._factors.copy()
        factors[:, :3, :3] = self._root_inertia * turned.transpose(0, 2, 1)
        factors[:, 3:, :3] = self._root_mass * _crossed_with(com)
        rows = (factors.reshape(-1, 6) @ S).reshape(len(com), 6, -1) * self._moved
        flat = rows.reshape(-1, S.shape[1])
        return np.asarray(flat.T @ flat)

    def _touching(self, look: Look, S: Array) -> Array:
        """Jacobian (3 K, m) of the points that the floor pressed in the step before."""
        touches = [touch for touch in look.touches if touch[9] > 0.0]
        if not touches:
            return np.zeros((0, S.shape[1]))
        arms = np.array([touch[5] for touch in touches]) - look.com[0]
        turning = (_crossed_with(arms).reshape(-1, 3) @ S[:3]).reshape(len(touches), 3, -1)
        rows = (turning + S[3:]) * self._moved[[self._row[touch[3]] for touch in touches]]
        return np.asarray(rows.reshape(-1, S.shape[1]))


_CROSS = np.zeros((3, 9))
_CROSS[0, 5] = _CROSS[1, 6] = _CROSS[2, 1] = 1.0
_CROSS[0, 7] = _CROSS[1, 2] = _CROSS[2, 3] = -1.0


def _crossed_with(points: Array) -> Array:
    """Matrices (K, 3, 3) that turn a vector into its vector product with points (K, 3)."""
    return np.asarray((points @ _CROSS).reshape(-1, 3, 3))


def _solved(matrix: Array, right: Array) -> Array:
    """Solution of a small positive definite system; ``np.linalg.solve`` takes four times as long."""
    from scipy.linalg.lapack import dposv

    return np.asarray(dposv(matrix, right)[1])
