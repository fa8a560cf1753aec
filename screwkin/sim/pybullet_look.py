"""What PyBullet says of a body between two steps: each question is asked at most once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from screwkin.algebra.arrays import Array


class Look:
    """A body between two steps; valid until the next one.

    Links stand in the order of the joints above them, the base before them.
    """

    def __init__(self, p: Any, client: dict[str, int], body: int, joints: Sequence[int]) -> None:
        """Nothing is asked yet.

        Args:
            p: the module of the engine.
            client: the arguments that name its client.
            body: index of the body.
            joints: indices of its joints, n.
        """
        self._p, self._client, self._body, self._indices = p, client, body, joints

    @cached_property
    def joints(self) -> Any:
        """Position, rate, reaction and motor's torque of every joint."""
        return self._p.getJointStates(self._body, self._indices, **self._client)

    @cached_property
    def q(self) -> Array:
        """Positions (n,) [rad or m]."""
        return np.array([joint[0] for joint in self.joints])

    @cached_property
    def qd(self) -> Array:
        """Rates (n,)."""
        return np.array([joint[1] for joint in self.joints])

    @cached_property
    def motor(self) -> Array:
        """Torques (n,) of the bounded motors in the step before [N m or N]."""
        return np.array([joint[3] for joint in self.joints])

    @cached_property
    def base(self) -> Any:
        """Position of the base's CoM and orientation of its principal axes, xyzw."""
        return self._p.getBasePositionAndOrientation(self._body, **self._client)

    @cached_property
    def velocity(self) -> Any:
        """Linear velocity of the base's CoM and angular velocity."""
        return self._p.getBaseVelocity(self._body, **self._client)

    @cached_property
    def links(self) -> Any:
        """State of the link below every joint."""
        return self._p.getLinkStates(self._body, self._indices, 0, 0, **self._client)

    @cached_property
    def com(self) -> Array:
        """CoMs (1 + n, 3) of base and links [m]."""
        return np.array([self.base[0], *[link[0] for link in self.links]])

    @cached_property
    def turned(self) -> Array:
        """Orientations (1 + n, 4) of their principal axes, xyzw."""
        return np.array([self.base[1], *[link[1] for link in self.links]])

    @cached_property
    def axes(self) -> Array:
        """The same as rotation matrices (1 + n, 3, 3)."""
        return rotations_of_quats(self.turned)

    @cached_property
    def touches(self) -> Any:
        """Points that touch what is not the body."""
        return self._p.getContactPoints(self._body, **self._client)


def rotations_of_quats(quats_xyzw: Array) -> Array:
    """Rotation matrices (K, 3, 3) of unit quaternions (K, 4)."""
    squares = quats_xyzw[:, :, None] * quats_xyzw[:, None]
    return np.asarray((squares.reshape(-1, 16) @ _ROTATION).reshape(-1, 3, 3))


def pose_of(position: Any, quat_xyzw: Any) -> Array:
    """Pose (4, 4) of a position and an orientation as PyBullet gives them."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotations_of_quats(np.array([quat_xyzw]))[0], position
    return T


def _rotation_of_squares() -> Array:
    """(16, 9): entries of a rotation matrix, row by row, from the products of a quaternion's components."""
    x, y, z, w = range(4)

    def pair(a: int, b: int) -> Array:
        return np.outer(np.eye(4)[a], np.eye(4)[b])

    xx, yy, zz, ww = (pair(a, a) for a in range(4))
    rows = [
        *(ww + xx - yy - zz, 2 * (pair(x, y) - pair(z, w)), 2 * (pair(x, z) + pair(y, w))),
        *(2 * (pair(x, y) + pair(z, w)), ww - xx + yy - zz, 2 * (pair(y, z) - pair(x, w))),
        *(2 * (pair(x, z) - pair(y, w)), 2 * (pair(y, z) + pair(x, w)), ww - xx - yy + zz),
    ]
    return np.array(rows).reshape(9, 16).T


_ROTATION = _rotation_of_squares()
