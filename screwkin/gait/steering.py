"""How a preview gait moves its CoM over still feet: the waist shifts ahead, and shifts or rolls to the side.

A leg without a roll axis at its ankle keeps its sole flat only while it stands upright seen from the front,
so that a waist that shifts would tilt the soles. Where the waist rolls about the line ahead between the hips,
these stay above their feet, and what is above them carries the CoM to either side. Where the line lies
lower, the waist tilts: it shifts and rolls at once, and a hip carries what is above it on a shorter arm than
where the waist only shifts.

The hips come nearer to each other, seen from above, as the waist rolls. So that the sole that carries the
weight stays level all the same, and does not stand on its edge, the waist also shifts to its side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import X, as_array, rotate
from screwkin.gait.motion import Motion
from screwkin.gait.plan import Plan
from screwkin.gait.record import Gait
from screwkin.kinematics.landmarks import limb_root, waist_frame
from screwkin.model.robot import Robot


@dataclass(frozen=True, eq=False)
class Steering:
    """What moves the CoM: [ahead in m; to the left in m, or the angle of the roll in rad].

    Attributes:
        axis: base axes: rotation (3, 3) whose first column is the axis of the roll, and a point (3,) of it
            [m]; None where the waist shifts.
        bearing: shares (T, feet) of the weight on soles that a shift keeps level; None where none does. With
            them what moves has a third entry: to the left in m.
    """

    axis: tuple[Array, Array] | None = None
    bearing: Motion | None = None

    @classmethod
    def of(cls, robot: Robot, gait: Gait) -> Steering:
        """The roll is about the line ahead, midway between the hips.

        Args:
            robot: with legs and a ``home`` posture.
            gait: its key ``lateral``, and of a waist that tilts its ``waist_height`` and number ``pivot``.
        """
        if gait.lateral == "shift":
            return cls()
        hips = [as_array(limb_root(robot, limb.name)) for limb in robot.limbs if limb.kind == "leg"]
        R, middle = as_array(waist_frame(robot).R).astype(float), np.mean(hips, axis=0)
        if gait.lateral == "tilt":
            waist, up = as_array(waist_frame(robot).p).astype(float), R[:, 2]
            height = gait.waist_height + float((middle - waist) @ up)
            middle = middle - (height - gait.numbers.get("pivot", 0.0)) * up
        return cls((R, middle))

    @property
    def ways(self) -> int:
        """How many entries what moves has."""
        return 2 if self.bearing is None else 3

    def moved(self, planned: Plan, by: Array) -> Plan:
        """The plan with its waist, and the hands that hang from it, moved (T, ways); hands do not roll."""
        along = self._along(by)
        T = planned.T_world_base.copy()
        T[:, :2, 3] += along
        hands = {name: _added(p, along) for name, p in planned.hand_position.items()}
        planned = replace(planned, T_world_base=T, hand_position=hands)
        return planned if self.axis is None else self._rolled(planned, by[:, 1])

    def driven(self, planned: Plan, velocity: Array, acceleration: Array) -> Plan:
        """The plan with rates and accelerations (T, ways) added to waist and hands."""
        v, a = self._along(velocity), self._along(acceleration)
        planned = replace(
            planned,
            base_twist=_added(planned.base_twist, v, 3),
            base_acceleration=_added(planned.base_acceleration, a, 3),
            hand_velocity={name: _added(old, v) for name, old in planned.hand_velocity.items()},
            hand_acceleration={name: _added(old, a) for name, old in planned.hand_acceleration.items()},
        )
        return planned if self.axis is None else self._spun(planned, velocity[:, 1:2], acceleration[:, 1:2])

    def _along(self, by: Array) -> Array:
        """The part (T, 2) of what moves that is a shift."""
        if self.axis is None:
            return by
        return by * (1, 0) if by.shape[-1] == 2 else by[:, [0, 2]]

    def _rolled(self, planned: Plan, angle: Array) -> Plan:
        """The base turned (T,) about the axis, which moves on as before."""
        assert self.axis is not None
        R, point = self.axis
        turn = R @ as_array(rotate(X, angle), (len(angle),)) @ R.T
        T = planned.T_world_base.copy()
        aside = np.einsum("tij,tj->ti", T[:, :3, :3], point - turn @ point)
        T[:, :3, :3] = T[:, :3, :3] @ turn
        T[:, :3, 3] += aside
        twist, rate = planned.base_twist.copy(), planned.base_acceleration.copy()
        omega, alpha = twist[:, :3], rate[:, :3]
        twist[:, 3:] += np.cross(omega, aside)
        rate[:, 3:] += np.cross(alpha, aside) + np.cross(omega, np.cross(omega, aside))
        return replace(planned, T_world_base=T, base_twist=twist, base_acceleration=rate)

    def _spun(self, planned: Plan, rate: Array, push: Array) -> Plan:
        """Rate and acceleration (T, 1) of the roll added; points of the axis move on as before."""
        assert self.axis is not None
        R, point = self.axis
        axis, arm = (np.einsum("tij,j->ti", planned.T_world_base[:, :3, :3], x) for x in (R[:, 0], -point))
        twist, acceleration = planned.base_twist.copy(), planned.base_acceleration.copy()
        before = twist[:, :3].copy()
        twist[:, :3] += rate * axis
        twist[:, 3:] += rate * np.cross(axis, arm)
        alpha = push * axis + rate * np.cross(before, axis)
        inward = [np.cross(omega, np.cross(omega, arm)) for omega in (twist[:, :3], before)]
        acceleration[:, :3] += alpha
        acceleration[:, 3:] += np.cross(alpha, arm) + inward[0] - inward[1]
        return replace(planned, base_twist=twist, base_acceleration=acceleration)


def _added(array: Array, by: Array, at: int = 0) -> Array:
    changed = array.copy()
    changed[:, at : at + 2] += by
    return changed
